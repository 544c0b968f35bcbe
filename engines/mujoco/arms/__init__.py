"""The arms of the running model: servos, brakes and readings."""

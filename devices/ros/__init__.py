"""Gateways to ROS: the simulated arms, consoles and cameras as programs of the real system know them."""

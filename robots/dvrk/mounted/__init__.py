"""The arms of cart and console in a scenario: base pose, tool and start of each arm. SI units, radians."""

"""Gateways to ROS: programs of the real system see the simulated arms, consoles and cameras as theirs."""

"""Everything that reads or writes recordings and ROS bags."""

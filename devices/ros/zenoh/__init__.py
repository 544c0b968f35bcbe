"""ROS 2 over Zenoh, compatible with rmw_zenoh."""

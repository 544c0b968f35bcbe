"""ROS 2 over Zenoh, as rmw_zenoh lays it out."""

"""ROS bags: played into a session, and written from a session's recording."""

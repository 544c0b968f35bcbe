"""ROS bags: played into a session, and made of its recording."""

"""Scores of recordings: of sessions, and of real arms in ROS bags."""

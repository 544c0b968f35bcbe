"""Readers and writers of recordings and ROS bags."""

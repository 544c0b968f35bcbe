"""Markers in a scene, as ROS programs publish them: their store, their frames, how they are drawn."""

"""ROS 2 over DDS: topics on Eclipse Cyclone DDS, services on a small RTPS participant of our own."""

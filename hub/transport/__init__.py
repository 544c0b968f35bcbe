"""Values and control messages between processes, over Zenoh."""

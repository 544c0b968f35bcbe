"""Values and control messages between processes, over Zenoh and over the fast lane."""

"""Blood out of opened tissue, on its surface."""

"""A second face of a running session, to look at with Foxglove: read-only, by Foxglove's protocol."""

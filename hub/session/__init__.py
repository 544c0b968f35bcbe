"""A session: clock, step loop, control requests, start and end."""

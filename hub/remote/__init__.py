"""Connections to hubs, also on other machines: to query their sessions, and to host a device for them."""

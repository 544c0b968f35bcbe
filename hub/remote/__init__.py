"""Connections to hubs, also on other machines: to query sessions, and to host a device."""

"""Devices: what a person holds, wears or sits at, and gateways to programs outside."""

"""Devices: inlets into simulated time, reading threads, network links and clock offsets."""

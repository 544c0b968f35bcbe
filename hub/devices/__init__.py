"""Devices: inlets into simulated time, threads that read them, network links and clock offsets."""

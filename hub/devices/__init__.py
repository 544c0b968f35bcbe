"""Devices on their way into simulated time: inlets, network links, clocks."""

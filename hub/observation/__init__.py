"""Watching a session without taking part: measures, energy books, latencies, summary."""

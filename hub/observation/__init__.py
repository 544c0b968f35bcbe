"""What watches a session without taking part: measures, energy books, latencies, summary."""

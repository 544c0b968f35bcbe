"""`trocar sweep`: the same scenario many times, with varied parameters."""

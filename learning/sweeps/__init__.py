"""`trocar sweep`: the same scenario many times, with other values of its parameters."""

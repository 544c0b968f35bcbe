"""What Trocar uses of SciPy."""

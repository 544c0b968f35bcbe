"""A suturing pad: forces of tissue on a needle, and the displaced skin. NumPy only."""

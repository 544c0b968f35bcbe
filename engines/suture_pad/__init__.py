"""A suturing pad: what a needle meets in tissue, and how the skin looks while it is pulled. NumPy only."""

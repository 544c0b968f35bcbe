"""The elastic material of tissue: constants, forces, and the longest time step."""

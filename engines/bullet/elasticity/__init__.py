"""The elastic material of tissue: constants, forces, and the time step they allow."""

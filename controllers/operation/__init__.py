"""The whole operation: the routines of its phases in turn, with exchanges of instruments between them."""

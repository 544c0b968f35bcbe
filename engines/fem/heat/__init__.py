"""Heat in soft tissue, and the instruments that bring it."""

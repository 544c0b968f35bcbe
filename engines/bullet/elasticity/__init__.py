"""Forces of the elements in Bullet, and its longest time step."""

"""The shapes of organs and the materials they are made of."""

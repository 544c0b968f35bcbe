"""Hands that free the gallbladder from the liver with the hook."""

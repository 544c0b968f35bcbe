"""The probes in Bullet, and the loss of force in their contacts."""

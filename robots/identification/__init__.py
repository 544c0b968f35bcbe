"""The dynamics of an arm from measured joint positions, velocities and efforts."""

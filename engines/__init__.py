"""Participants that own simulated state: MuJoCo, Bullet, FMUs."""

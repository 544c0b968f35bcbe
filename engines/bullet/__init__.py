"""Soft tissue in PyBullet."""

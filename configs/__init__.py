"""Installed scenarios and their data."""

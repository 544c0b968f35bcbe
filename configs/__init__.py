"""Scenarios that come with Trocar, and the data they need."""

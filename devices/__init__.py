"""Participants that live in wall time: what a person holds, wears or sits at."""

"""Mesh files of other programs: limits, parsers in a process of their own."""

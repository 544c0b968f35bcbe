"""Everything that reads or writes recordings."""

"""One session: its clock, its members, its beginning and its end."""

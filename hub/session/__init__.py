"""One session: its clock, its participants, its beginning and its end."""

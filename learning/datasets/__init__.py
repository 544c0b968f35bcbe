"""`trocar dataset`: recordings as a data set to learn from."""

"""`trocar demonstrate`: experts' episodes by the thousand, as a data set."""

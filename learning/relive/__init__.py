"""`trocar relive`: an episode of a data set as a session whose arms follow its set-points."""

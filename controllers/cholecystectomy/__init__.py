"""Routine for the clipping and cutting of duct and artery in a cholecystectomy."""

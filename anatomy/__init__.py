"""Patients of a cholecystectomy: sizes, stiffness, variations, and the places of their organs."""

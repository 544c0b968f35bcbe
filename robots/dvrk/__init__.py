"""The da Vinci Research Kit."""

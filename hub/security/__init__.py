"""Certificates, access rules, and the gate of a session for other machines."""

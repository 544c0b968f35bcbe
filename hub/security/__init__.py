"""Certificates, access rules, and the gate through which other machines join a session."""

"""Hosts: processes stepping participants."""

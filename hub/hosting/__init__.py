"""Hosts: the processes that step participants."""

"""The topics and services that every gateway serves."""

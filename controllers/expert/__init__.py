"""Scripted experts for the training tasks, led by measured poses."""

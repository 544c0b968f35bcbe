"""Scripted experts: programs that do the training tasks from the poses they are given, as a person would."""

"""Behaviour cloning: demonstrations of the oracles, training in PyTorch, and the learnt policy."""

"""Training tasks: events, goals, metrics, and the scores of foreign rules."""

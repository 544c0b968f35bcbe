"""Learning from sessions: sweeps over parameters of a scenario."""

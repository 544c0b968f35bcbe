"""Learning from sessions: sweeps over parameters of a scenario, and environments for Gymnasium."""

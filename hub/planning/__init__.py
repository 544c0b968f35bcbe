"""From a scenario file to a plan: who runs where, and every connection and bond resolved."""

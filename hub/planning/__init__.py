"""From a scenario file to a plan: each participant has a host, and every connection and bond is resolved."""

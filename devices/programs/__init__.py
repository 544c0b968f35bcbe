"""Programs in plain Python that lead arms: the gateway `programs`, and its client, `trocar.connect`."""

"""Programs in plain Python: the gateway `programs`, and the client, `trocar.connect`."""

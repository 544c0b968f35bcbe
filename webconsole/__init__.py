"""The web console: a page in the browser on which a session is seen and driven, and its server."""

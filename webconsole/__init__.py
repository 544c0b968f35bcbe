"""The web console: a page in the browser to see and drive a session, and the page's server."""

"""Organs that hang together by ties, which part when they are pulled, cut or burnt."""

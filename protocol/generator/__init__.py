"""Turns schema.toml into C, Python, byte tables and test vectors."""

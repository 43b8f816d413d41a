"""Simulated runs and error models, compared with recordings."""

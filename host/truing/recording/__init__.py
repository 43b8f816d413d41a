"""Recordings and baselines: in memory, read and written."""

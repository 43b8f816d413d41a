"""Recordings of real robots, each diagnosed from a baseline without friction and delay."""

"""Trajectories: keys and drawn paths to control inputs and sequence files."""

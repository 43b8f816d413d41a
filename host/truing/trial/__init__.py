"""Concealed trials: a robot with an effect hidden in it, and what a diagnosis makes of its recordings."""

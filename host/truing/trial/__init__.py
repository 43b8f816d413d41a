"""Concealed trials: a robot with an effect concealed in it, and the diagnosis of its recordings."""

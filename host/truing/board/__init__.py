"""A board as the host sees it: connecting, driving, its state, parameters, faults and signals."""

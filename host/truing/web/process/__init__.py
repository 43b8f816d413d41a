"""Helper processes: virtual board, diagnosis, simulation."""

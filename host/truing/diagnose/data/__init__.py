"""Recordings as a diagnosis uses them: input checks, arrays, valid rows, encoder fault detection."""

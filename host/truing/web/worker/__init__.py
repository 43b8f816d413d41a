"""The thread that owns the board: its state for the pages, live samples, and their requests."""

"""From recordings to gains, time constants and models, with intervals and honest reasons."""

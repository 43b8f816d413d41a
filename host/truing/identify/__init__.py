"""From recordings to gains, time constants and models, with intervals, or the reason why there is none."""

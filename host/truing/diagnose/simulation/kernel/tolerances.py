"""What counts as the same, where events are looked for."""

from __future__ import annotations

# A shorter span is none.
TINY_S = 1e-10
# Spans that differ by less are the same span.
SAME_S = 1e-12
# A speed within this of an event's speed is at the event, m/s.
SAME_MPS = 1e-9
# Some events are overstepped by this much, so that the next substep finds the wheel past them.
PAST_EVENT_S = 1e-7

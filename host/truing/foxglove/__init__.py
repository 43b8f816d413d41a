"""Signals, poses, floor maps and faults as Foxglove's own messages: served live, or kept as MCAP files."""

"""Recorded runs on disk, and files dropped onto a page."""

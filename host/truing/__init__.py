"""truing: run a two-wheel robot, fetch its recordings, and find what its simulation leaves out."""

__version__ = "0.1.0"

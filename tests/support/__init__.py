"""Stand-ins that tests share: a board in Python, and lines that damage what they carry."""

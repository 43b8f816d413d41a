"""The pages of the view: thin, each a function that builds its elements."""

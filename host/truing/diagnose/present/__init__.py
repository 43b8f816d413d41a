"""A diagnosis for people and programs: text, page, charts, exported models."""

"""One file per effect of the catalogue; a file put here is part of it."""

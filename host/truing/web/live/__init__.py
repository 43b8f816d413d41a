"""The web socket of each page: frames out, keys in."""

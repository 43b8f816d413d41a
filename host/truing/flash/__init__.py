"""Writing firmware to a board: what an image is (`image`), the tools (`tools`), the order (`write`)."""

"""The studies that come with truing: two papers, and recordings of real robots."""

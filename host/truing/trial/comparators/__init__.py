"""Other methods on the same trials: what a team would do first, and what nobody could do better."""

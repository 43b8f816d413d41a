"""Other methods on the same trials: regression, sparse regression, and selection by training error."""

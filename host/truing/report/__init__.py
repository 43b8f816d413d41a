"""Pages and pictures of runs and fits."""

"""The free-run simulation that explains recordings: one compiled kernel assembled from the effects' hooks."""

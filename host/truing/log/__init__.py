"""A board's log: downloaded, resumed, decoded and turned into the columns of a run."""

"""The diagnosis: where a simulation differs from recordings, and which physics it leaves out."""

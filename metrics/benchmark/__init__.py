"""Open benchmark of coders: versioned profiles, runs of coders and of external commands, ranking of results."""

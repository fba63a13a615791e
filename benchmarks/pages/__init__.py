"""Generated pictures and tables of README and docs."""

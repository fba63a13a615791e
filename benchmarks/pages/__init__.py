"""Pictures and tables of README and docs, made from records and from code."""

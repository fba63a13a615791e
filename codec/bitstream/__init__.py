"""Parsing and framing of bitstreams."""

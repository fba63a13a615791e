"""Measures of a pair of pictures: their contract and registry, and the built-in ones."""

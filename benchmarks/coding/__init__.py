"""Benchmarks of coders: rate, quality, header portions, cost and damaged input."""

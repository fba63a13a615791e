"""Limits of the methods: one function per case, each returning rows of measured numbers."""

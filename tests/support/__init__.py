"""Scenes, files and pictures for several test files."""

"""Scenes, files and pictures that several tests share."""

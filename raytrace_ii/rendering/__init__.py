"""Rendering: jobs, executors, pictures written as they come, render sets, contact sheets."""

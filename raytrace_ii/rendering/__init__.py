"""Rendering: jobs, executors, pictures in memory or written band by band, render sets, takes, contact sheets."""

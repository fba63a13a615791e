"""Checks, files, kernels' compilation, parallel work: what every other room of ii_core uses."""

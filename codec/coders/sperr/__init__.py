"""SPERR volume coder, decoded in a process with limits."""

"""Ctrl-C for processes that tests start."""

import signal


def hear_interrupts() -> None:
    """Restore the handler of Ctrl-C, which commands started by a shell with ``&`` ignore."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)

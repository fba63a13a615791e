"""Ctrl-C for processes that tests start."""

import signal


def hear_interrupts() -> None:
    """Undo a shell's ``&``, which makes its commands, so the tests and what they start, ignore Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)

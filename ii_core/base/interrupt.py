"""Ctrl-C during compiled code: control returns to Python within two seconds."""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import TypeVar

Result = TypeVar("Result")


class Terminated(SystemExit):
    """SIGTERM has come; unlike SystemExit of a plugin it ends the process."""


STOPS = (KeyboardInterrupt, Terminated)
"""Exceptions that end the process and that no handler of a plugin's errors may keep."""


def interruptible(call: Callable[[], Result]) -> Result:
    """Return what a function returns; Ctrl-C ends the wait for it at once, whatever it is doing.

    In the main thread the function runs in a thread of its own. After Ctrl-C that thread ends at its next Python
    instruction; the process can end before. In other threads, which get no signals, the function is just called.

    Raises
    ------
    KeyboardInterrupt
        At Ctrl-C.
    """
    if threading.current_thread() is not threading.main_thread():
        return call()
    future: Future[Result] = Future()

    def work() -> None:
        try:
            future.set_result(call())
        except BaseException as error:
            future.set_exception(error)

    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    try:
        return future.result()
    except KeyboardInterrupt:
        _interrupt(thread)
        raise


def _interrupt(thread: threading.Thread) -> None:
    """Raise KeyboardInterrupt in a thread at its next Python instruction; nothing if it has ended."""
    number = ctypes.c_ulong(thread.ident or 0)
    ctypes.pythonapi.PyThreadState_SetAsyncExc(number, ctypes.py_object(KeyboardInterrupt))

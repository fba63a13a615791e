"""How commands end: cleanup, exit within two seconds if interrupted, no empty folders of those that fail."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

GRACE_SECONDS = 1.5  # time limit of the cleanup, even if compiled code runs longer
CODES = {signal.SIGINT: 130, signal.SIGTERM: 143}
SHOW_CURSOR = b"\x1b[?25h"  # progress bars hide the cursor


@contextmanager
def ends_soon() -> Iterator[None]:
    """Exit with cleanup on SIGTERM; end the process if an exit by SIGTERM or Ctrl-C takes too long.

    Python runs signal handlers between its instructions, not while the main thread is in a coder or waits for tracing
    threads. The number of a signal is written to a socket immediately; a thread reads it.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    heard, told = socket.socketpair()
    left = threading.Event()
    told.setblocking(False)
    before = signal.signal(signal.SIGTERM, _terminate)
    wakeup = signal.set_wakeup_fd(told.fileno(), warn_on_full_buffer=False)
    threading.Thread(target=_watch, args=(heard, left), daemon=True).start()
    ended = True
    try:
        yield
    except BaseException as end:
        ended = not isinstance(end, KeyboardInterrupt) and getattr(end, "code", None) not in CODES.values()
        raise
    finally:
        left.set()
        signal.set_wakeup_fd(wakeup)
        signal.signal(signal.SIGTERM, before)
        if ended:
            told.close()  # ends the thread
        else:
            _remove_unfinished()  # of which the interrupt has left the cleanup out
            told.detach()  # Python waits for the threads of pools when it exits: the time limit stays until then


def _terminate(number: int, frame: Any) -> None:
    from ii_core.base.interrupt import Terminated

    raise Terminated(CODES[signal.SIGTERM])


def _remove_unfinished() -> None:
    """Remove unfinished files, which there are none of before the module that makes them is imported."""
    remove = getattr(sys.modules.get("ii_core.base.atomic"), "remove_temporaries", None)
    if remove is not None:
        remove()


def _watch(heard: socket.socket, left: threading.Event) -> None:
    with heard:
        while (data := heard.recv(1)) and data[0] not in CODES:
            pass
        if not data:
            return
        heard.settimeout(GRACE_SECONDS)
        try:
            while heard.recv(64):  # further signals have no effect; the end of the command closes the socket
                pass
        except TimeoutError:
            _stop(CODES[signal.Signals(data[0])], said=left.is_set())


def _stop(code: int, *, said: bool) -> None:
    """End the process without waiting for threads; remove its unfinished files; print "interrupted" unless done."""
    _remove_unfinished()
    if sys.stderr.isatty():
        os.write(2, SHOW_CURSOR)
    if not said:
        os.write(2, b"interrupted\n")
    os._exit(code)


_created: list[Path] = []  # folders created by this command


def create_folder(folder: Path) -> None:
    """Create a folder and its parents."""
    missing = [place for place in (folder, *folder.parents) if not place.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    _created.extend(missing)


@contextmanager
def no_empty_folders() -> Iterator[None]:
    """Remove the folders that `create_folder` has created and that are empty when the block ends."""
    _created.clear()
    try:
        yield
    finally:
        for folder in sorted(_created, key=lambda folder: len(folder.parts), reverse=True):
            with contextlib.suppress(OSError):  # it holds files
                folder.rmdir()

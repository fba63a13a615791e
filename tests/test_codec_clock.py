"""CPU time of encoders' own threads, while other threads come and go."""

import os
import threading
import time

import pytest

from codec.clock import TASKS, OwnThreads, cpu_seconds

pytestmark = pytest.mark.skipif(not os.path.isdir(TASKS), reason="only Linux tells the time of each thread")


def test_threads_that_are_not_the_encoders_count_nothing():
    """One has ended since, one is Python's: taken for the encoder's while they were starting, they are told apart."""
    ended = threading.Thread(target=lambda: None)
    ended.start()
    ended.join()
    stop = threading.Event()

    def busy():
        while not stop.is_set():
            sum(range(1000))

    python = threading.Thread(target=busy)
    python.start()
    time.sleep(0.05)
    own = OwnThreads(lambda: None)
    own._ids = {ended.native_id, python.native_id}
    before = cpu_seconds()
    own.end()
    assert cpu_seconds() - before < 0.02
    stop.set()
    python.join()

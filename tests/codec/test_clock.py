"""CPU time of encoder threads while other threads start and end."""

import os
import threading
import time

import numpy as np
import pytest

from codec.clock import TASKS, OwnThreads, cpu_seconds
from codec.coders.video import open_encoder
from codec.contract import parse_scheme
from ii_core import IIPicture

pytestmark = pytest.mark.skipif(not os.path.isdir(TASKS), reason="only Linux tells the time of each thread")


def test_cpu_time_excludes_threads_of_others():
    """Threads that have ended, and Python's own threads, are distinguished from those of the encoder."""
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


def test_no_encoder_makes_the_process_a_real_time_task():
    """SVT-AV1 run by root does: other processes of the machine then got no CPU time."""
    coder, options = parse_scheme("si-av1:fast")
    film = coder.film(IIPicture(np.zeros((64, 128, 3), np.uint8), (8, 4), (16, 16)), options)
    context = open_encoder(coder, film, coder.constant(30, film, options))
    usual = os.sched_getscheduler(0)
    OwnThreads(context.open)
    assert {os.sched_getscheduler(int(number)) for number in os.listdir(TASKS)} == {usual}

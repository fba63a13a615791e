"""Ctrl-C while the library works: control returns within two seconds, even from compiled code."""

import subprocess
import sys
import textwrap

import pytest

from benchmarks.records import ROOT

SCRIPT = """
import os, signal, sys, threading, time
import numpy as np
from codec import encode
from ii_core import IIPicture, preset
from raytrace_ii import load_scene, render

signal.signal(signal.SIGINT, signal.default_int_handler)  # which a shell's & makes ignored
scene, camera = load_scene("cuboid"), preset("setup1", scale=8)
picture = IIPicture(np.random.default_rng(0).integers(0, 256, (1024, 1024, 3), np.uint8), (64, 64), (16, 16))
small = IIPicture(picture.pixels[:64, :64].copy(), (4, 4), (16, 16))
started = []

def interrupt():
    started.append(time.monotonic())
    os.kill(os.getpid(), signal.SIGINT)

def work():
    {work}

{warm}
threading.Timer(1.5, interrupt).start()
try:
    work()
    print("finished")
except KeyboardInterrupt:
    print(time.monotonic() - started[0], flush=True)
"""
WORKS = {
    # A block of 65536 pixels with 4096 samples takes minutes, during which threads do not return to Python.
    "render": ("render(scene, camera, samples=4096)", "render(scene, preset('setup1', scale=128))"),
    # One call of a library that takes many seconds.
    "encode": ("encode(picture, 'jpegxl:effort=9', bpp=2.0)", "encode(small, 'jpegxl', bpp=2.0)"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", WORKS)
def test_ctrl_c_returns_within_two_seconds(name):
    """On b1dc540 render waited for the blocks of its threads, and encode for the library's call."""
    work, warm = WORKS[name]
    script = textwrap.dedent(SCRIPT).format(work=work, warm=warm)
    run = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert run.stdout and run.stdout != "finished\n", run.stderr
    assert float(run.stdout) < 2.0
    assert "Traceback" not in run.stderr

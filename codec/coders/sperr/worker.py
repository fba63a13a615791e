"""Decode SPERR streams in a process of their own: a program that `codec.coders.sperr.stream` starts, by its path.

The library ends the process with an uncaught exception where a stream is not to its liking, and may read what is not
its own. Here that costs nobody more than this process, which has an end to its memory and time.

Standard input holds slices, rows, columns and the number of streams, then each stream behind its length. To standard
output go a word that all is ready, the volumes as float32, and the CPU seconds of decoding and of the whole process.
"""

from __future__ import annotations

import struct
import sys
import time
from pathlib import Path

HEAD, LENGTH, TIMES = struct.Struct("<4I"), struct.Struct("<Q"), struct.Struct("<2d")
READY = b"here"
BYTES_A_SAMPLE, BYTES = 96, 256 << 20  # a stream of ours takes 40
SECONDS, SECONDS_A_SAMPLE = 10.0, 5e-6  # of CPU time; ours take 0.2 and 2e-7


def main() -> None:
    """Read, decode, write."""
    import numpy as np
    from imagecodecs import sperr_decode

    source, sink = sys.stdin.buffer, sys.stdout.buffer
    *shape, count = HEAD.unpack(source.read(HEAD.size))
    samples = shape[0] * shape[1] * shape[2]
    bound(BYTES + BYTES_A_SAMPLE * samples, SECONDS + SECONDS_A_SAMPLE * count * samples)
    sink.write(READY)
    sink.flush()
    seconds = 0.0
    for _ in range(count):
        (length,) = LENGTH.unpack(source.read(LENGTH.size))
        stream = source.read(length)
        started = time.thread_time()  # finer than that of the process
        volume = sperr_decode(stream, shape=tuple(shape), dtype=np.float32, numthreads=1)
        seconds += time.thread_time() - started
        sink.write(volume.data)
    sink.write(TIMES.pack(seconds, time.process_time()))


def bound(more_bytes: int, seconds: float) -> None:
    """Limit memory, time and traces left of a crash, where the platform can."""
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_CPU, (int(seconds) + 1,) * 2)
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + more_bytes,) * 2)
    except (ImportError, OSError, ValueError):
        pass  # the caller's own limit on time remains


if __name__ == "__main__":
    main()

"""Decoder process for SPERR streams, a program that `codec.coders.sperr.stream` starts by its path.

SPERR aborts on malformed streams, and may read beyond their end. This process limits its memory and time.

Standard input holds slices, rows, columns and the number of streams, then the length and bytes of each stream.
Standard output gets the word `READY`, the volumes as float32, and the CPU seconds of decoding and of the whole
process.
"""

from __future__ import annotations

import struct
import sys
import time
from pathlib import Path

HEAD, LENGTH, TIMES = struct.Struct("<4I"), struct.Struct("<Q"), struct.Struct("<2d")
READY = b"here"
BYTES_A_SAMPLE, BYTES = 96, 256 << 20  # our streams take 40
SECONDS, SECONDS_A_SAMPLE = 10.0, 5e-6  # of CPU time; our streams take 0.2 and 2e-7


def main() -> None:
    """Decode the streams of standard input."""
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
        started = time.thread_time()  # has a finer clock than the process
        volume = sperr_decode(stream, shape=tuple(shape), dtype=np.float32, numthreads=1)
        seconds += time.thread_time() - started
        sink.write(volume.data)
    sink.write(TIMES.pack(seconds, time.process_time()))


def bound(more_bytes: int, seconds: float) -> None:
    """Limit memory, time and core dumps, where the platform can."""
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_CPU, (int(seconds) + 1,) * 2)
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + more_bytes,) * 2)
    except (ImportError, OSError, ValueError):
        pass  # the caller's time limit remains


if __name__ == "__main__":
    main()

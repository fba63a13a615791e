"""Worker processes of fuzzing: cases in order, a new process after each crash, a time limit without output."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

from benchmarks.records import ROOT

STUCK = 300  # seconds without output after which a worker is killed


@dataclass(frozen=True)
class Case:
    """Outcome and cost of one case; ``said`` is the last error line of a dead worker."""

    number: int
    what: str
    seconds: float = 0.0
    megabytes: float = 0.0
    said: str | None = None

    @property
    def finding(self) -> dict[str, Any]:
        """Entry of the list of findings."""
        more = {"seconds": self.seconds} if self.said is None else {"said": self.said}
        return {"number": self.number, "what": self.what, **more}


def cases(module: str, arguments: Sequence[str], count: int) -> Iterator[Case]:
    """Yield the ends of the cases 0 to ``count`` − 1 that ``python -m MODULE ARGUMENTS --range FIRST LAST`` prints.

    Every line of the worker is a JSON list: number, kind of end, CPU seconds and, optionally, megabytes. If a worker
    dies or prints nothing for `STUCK` seconds, its case is yielded as such, and a new worker starts with the next.
    """
    first = 0
    while first < count:
        command = [sys.executable, "-m", module, *arguments, "--range", str(first), str(count)]
        with tempfile.TemporaryFile() as errors:
            worker = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, text=True, cwd=ROOT)
            assert worker.stdout is not None
            with Watchdog(worker) as watchdog:
                for line in worker.stdout:
                    watchdog.seen()
                    yield (case := Case(*json.loads(line)))
                    first = case.number + 1
            if first < count:
                errors.seek(0)
                last = errors.read().decode(errors="replace").strip().splitlines()[-1:]
                what = "stuck" if watchdog.fired else f"died with {worker.wait()}"
                yield Case(first, what, said=" ".join(last)[-300:])
                first += 1


class Watchdog:
    """Kill a worker that prints nothing for too long, or whose caller stops reading."""

    def __init__(self, worker: subprocess.Popen[str]) -> None:
        self.worker, self.fired, self._last = worker, False, time.monotonic()
        self._pool = ThreadPoolExecutor(1)

    def seen(self) -> None:
        """Restart the timeout."""
        self._last = time.monotonic()

    def __enter__(self) -> Watchdog:
        self._pool.submit(self._watch)
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is not None:
            self.worker.kill()
        self.worker.wait()
        self._pool.shutdown()

    def _watch(self) -> None:
        while self.worker.poll() is None:
            if time.monotonic() - self._last > STUCK:
                self.fired = True
                self.worker.kill()
            time.sleep(0.2)

"""Processes: commands in a new one, Ctrl-C for it, and a full disk, which a limit on the size of files simulates."""

import json
import os
import signal
import subprocess
import sys
from contextlib import contextmanager

SCRIPT = """
import json, sys
from raytrace_ii import cli
{before}
for arguments in json.loads(sys.argv[1]):
    sys.argv = ["raytrace-ii", *arguments]
    try:
        cli.main()
    except SystemExit as end:
        print(end="\\0" + str(end.code) + "\\0", flush=True)
        print(end="\\0", file=sys.stderr, flush=True)
"""


def in_one_process(*commands, before="", cwd=None, **environment):
    """Run commands one after another in a new process; return exit code, output and error output of each.

    The end of the process has to be silent.
    """
    arguments = json.dumps(
        [[os.fsdecode(word) if isinstance(word, bytes) else str(word) for word in c] for c in commands]
    )
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT.format(before=before), arguments],
        capture_output=True,
        text=True,
        cwd=cwd,
        env={**os.environ, **environment},
        timeout=100,
    )
    out, err = done.stdout.split("\0"), done.stderr.split("\0")
    assert len(err) == len(commands) + 1 and out[-1] == err[-1] == "", done
    return [(int(code), o, e) for o, code, e in zip(out[:-1:2], out[1::2], err[:-1], strict=True)]


def hear_interrupts() -> None:
    """Restore the handler of Ctrl-C, which commands started by a shell with ``&`` ignore."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@contextmanager
def full_disk(limit):
    """Let no file of this process grow beyond ``limit`` bytes; Python ignores the signal, so that writing fails."""
    import resource

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)

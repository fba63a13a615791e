"""Commands in a new process, for properties of processes: streams, limits of memory, the end of the interpreter."""

import json
import os
import subprocess
import sys

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

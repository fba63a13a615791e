"""Commands on a disk that is full: a limit on the size of files simulates it."""

import subprocess
import sys

COMMAND = """
import resource, sys
from raytrace_ii import cli
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv.pop(1)),) * 2)
cli.main()
"""


def limited(limit, *arguments, cwd):
    """Run a command that can write no file of more than ``limit`` bytes."""
    return subprocess.run(
        [sys.executable, "-c", COMMAND, str(limit), *map(str, arguments)], capture_output=True, text=True, cwd=cwd
    )

"""Files that claim more than they are: refused in a second and in bounded memory, whatever the scheme.

In a process of its own whose address space is limited, with checksums that are right.
"""

import json
import subprocess
import sys

SCRIPT = """
import json, resource, sys, time
from dataclasses import replace
from pathlib import Path
from benchmarks.fuzz import sample
from codec import decode, schemes

CLAIMS = [
    ([1 << 15, 1 << 14], [1, 4]),  # as many pixels as are allowed
    ([1, 4], [1 << 15, 1 << 14]),
    ([1 << 15, 1], [1, 1 << 16]),
    ([1 << 10, 1 << 10], [32, 32]),
    ([1 << 20, 1 << 20], [1 << 20, 1 << 20]),
]
coded = [sample(name) for name in sorted(schemes())]
for one in coded:
    decode(one)
room = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize() + (1 << 29)
resource.setrlimit(resource.RLIMIT_AS, (room, room))
for one in coded:
    for lenses, ei_pixels in CLAIMS:
        mutant = replace(one, structure={**one.structure, "lenses": lenses, "ei_pixels": ei_pixels})
        started = time.process_time()
        try:
            decode(mutant)
            said = "a picture"
        except ValueError as error:
            said = "refused"
        except BaseException as error:
            said = repr(error)
        print(json.dumps([one.scheme, lenses, ei_pixels, said, time.process_time() - started]))
"""


def test_claims_are_refused_fast_and_small():
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    results = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(results) >= 6 * 4
    wrong = [result for result in results if result[3] != "refused" or result[4] > 1]
    assert wrong == []

"""Wrong calls of every public function: each argument in turn is of another type or out of range.

    python -m benchmarks run wrong_calls [--only q_global]

A call must succeed, or raise TypeError or ValueError that names the argument, or OSError if the value is a path.
Other errors are accidental: raised inside, about a value that the caller did not write. A row is
appended to ``benchmarks/results/wrong_calls.jsonl``.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import Any

from benchmarks.arguments import command_line
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import Records, origin

from .attack import WRONG, attack
from .calls import calls

RECORDS = Records("wrong_calls", ("benchmarks.stability.wrong_calls",))


def main() -> None:
    """Attack all, print accidental errors, append the row."""
    parser = command_line(__doc__)
    parser.add_argument("--only", help="one function, without a record")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)  # relative names write here
        named = calls(Path(folder))
        if arguments.only:
            named = {name: call for name, call in named.items() if name == arguments.only}
        found: list[str] = []

        def measure() -> dict[str, Any]:
            counts, lines = attack(named, WRONG)
            found.extend(lines)
            return {"functions": len(named), "counts": dict(counts), "findings": lines[:50]}

        if arguments.only:
            print(measure()["counts"])
        else:
            RECORDS.run([{"values": len(WRONG)}], lambda values: measure(), arguments.again)
        os.chdir("/")
    print("\n".join(found))
    if not arguments.only:
        publish(tables())


def tables() -> Tables:
    """Return the sentence of the page of stability."""
    rows = RECORDS.rows()[-1:]
    if not rows:
        return {("docs/stability.md", "wrong-calls"): []}
    counts = rows[0]["counts"]
    line = (
        f"{rows[0]['functions']} functions, classes and methods, each argument with {len(WRONG)} wrong values: "
        f"{sum(counts.values())} calls, {counts.get('refused', 0)} refused by name, {counts.get('path', 0)} missing "
        f"files, {counts.get('taken', 0)} values that were right, {counts.get('accidental', 0)} accidental errors."
    )
    return {("docs/stability.md", "wrong-calls"): [line, "", origin(rows)]}

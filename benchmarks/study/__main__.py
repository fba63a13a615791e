"""Command line of the study; see the package."""

from __future__ import annotations

import argparse
import sys
import time
from fnmatch import fnmatch
from pathlib import Path

from . import __doc__ as about
from . import pictures, rates, structures, views
from .page import publish
from .runner import Step, perform


def main(arguments: list[str] | None = None) -> None:
    """Run and publish the chosen steps."""
    parser = argparse.ArgumentParser(
        prog="benchmarks.study", description=about, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scale", type=int, default=1, help="divides the lenses of all setups; 16 for a quick look")
    parser.add_argument("--only", default="*", help="steps, with *: rates-apples,views-*")
    parser.add_argument("--out", type=Path, default=None, help="folder of records and pictures; out/study/scale-N")
    parser.add_argument("--force", action="store_true", help="repeat finished steps and compare")
    parser.add_argument("--list", action="store_true", help="list the steps only")
    parser.add_argument("--publish", action="store_true", help="fill docs/study.md from the results")
    asked = parser.parse_args(arguments)
    try:
        steps = all_steps(asked.scale)
    except ValueError as error:
        parser.error(str(error))
    wanted = asked.only.split(",")
    if unknown := [one for one in wanted if not any(fnmatch(step.name, one) for step in steps)]:
        parser.error(f"no step {unknown[0]!r}: known are {', '.join(step.name for step in steps)}")
    chosen = [step for step in steps if any(fnmatch(step.name, one) for one in wanted)]
    if asked.list:
        for step in chosen:
            print(f"{step.name:<24} {step.shows}")
        return
    folder = asked.out or Path("out/study") / f"scale-{asked.scale}"
    started = time.perf_counter()
    made = perform(chosen, folder, force=asked.force)
    print(f"{len(made)} of {len(chosen)} steps in {time.perf_counter() - started:.0f} s: {folder}/")
    if asked.publish:
        publish(folder)
    if broken := [record["step"] for record in made if record.get("repeats") is False]:
        sys.exit(f"not the same as before: {', '.join(broken)}")


def all_steps(scale: int) -> list[Step]:
    """Return every step at a scale of the coding setups: quick steps and steps that others depend on come first.

    Raises
    ------
    ValueError
        If the scale does not divide setup 1.
    """
    if scale not in (1, 2, 4, 8, 16):
        raise ValueError(f"scale is {scale}: 1, 2, 4, 8 or 16 is needed")
    return [step for part in (pictures, rates, views, structures) for step in part.steps(scale)]

"""Command line of the benchmarks: `list`, `run` and `prune`.

    python -m benchmarks list [NAME ...] [--stale]
    python -m benchmarks run NAME ... [OPTION ...]
    python -m benchmarks prune [NAME ...]

Options belong to the benchmark: ``python -m benchmarks run coders --scale 8``, ``run stability -- bd_overlap``; they
need a single name. ``python -m benchmarks run NAME --help`` prints them. ``--stale`` lists records older than the
code that they measure. ``prune`` removes records that have a newer one of the same key.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from benchmarks.age import report
from benchmarks.records import prune
from benchmarks.registry import BENCHMARKS, CLOSED, Benchmark


def main(arguments: Sequence[str] | None = None) -> None:
    """List or run benchmarks."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if stale := given[:1] == ["list"] and "--stale" in given:
        given.remove("--stale")
    first = next((i for i, word in enumerate(given) if word.startswith("-") and i > 1), len(given))
    words, options = given[:first], given[first:]
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("command", choices=("list", "run", "prune"), nargs="?", default="list")
    parser.add_argument("names", nargs="*", metavar="NAME")
    asked = parser.parse_args(words)
    if unknown := [name for name in asked.names if name not in BENCHMARKS]:
        parser.error(f"there is no benchmark {unknown[0]!r}: known are {', '.join(sorted(BENCHMARKS))}")
    if asked.command != "run":
        show = aged if stale else listed if asked.command == "list" else pruned
        if options:
            parser.error(f"{asked.command} takes names alone, not {options[0]}")
        for name in asked.names or BENCHMARKS:
            show(BENCHMARKS[name])
        if show is listed and not asked.names:
            for last, names in CLOSED.items():
                print(f"    closed experiments, in git up to {last}: {', '.join(names)}")
        return
    if not asked.names:
        parser.error("run needs a name: python -m benchmarks list prints them")
    if options and len(asked.names) > 1:
        parser.error(f"options such as {options[0]} need a single name: {len(asked.names)} were given")
    for name in asked.names:
        BENCHMARKS[name].run(options[1:] if options[:1] == ["--"] else options)


def listed(benchmark: Benchmark) -> None:
    """Print the description of a benchmark."""
    print(description(benchmark))


def aged(benchmark: Benchmark) -> None:
    """Print which records of a benchmark are older than its code."""
    if line := report(benchmark):
        print(line)


def pruned(benchmark: Benchmark) -> None:
    """Prune the records of a benchmark, and print what was removed."""
    for path in benchmark.result_files():
        if ".jsonl" in path.suffixes and (removed := prune(path)):
            print(f"{path.name}: {removed} older records removed")


def description(benchmark: Benchmark) -> str:
    """Return name, summary, needs, cost and files of a benchmark as readable text."""
    spent = benchmark.minutes()
    cost = "no times recorded" if spent is None else f"{'at least ' * spent[1]}{spent[0]:.1f} min by its records"
    files = [f"benchmarks/results/{benchmark.pattern}"] * bool(benchmark.records)
    files += benchmark.outputs
    return "\n".join(
        [
            f"{benchmark.name} ({benchmark.room}): {benchmark.summary()}",
            f"    needs   {benchmark.needs or 'nothing besides'}",
            f"    costs   {cost}",
            f"    writes  {', '.join(files) or 'tables of all pages'}",
        ]
    )


if __name__ == "__main__":
    main()

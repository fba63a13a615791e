"""Fuzzing of decoders: random damage to coded pictures, counted by the kind of ending.

    python -m benchmarks run fuzz [--mutations 4000] [--workers 2] [--schemes si-h264,...] [--seed 0]

Payloads of a small picture and whole files are damaged: bits flipped, bytes cut, repeated, replaced or inserted from
another scheme, sizes changed; checksums are corrected. Every decoding must end in a picture of the right shape or a
ValueError, within a second of CPU time and in bounded memory. Workers are processes with a memory limit, so that
crashes are counted. A crash or timeout is recorded with its number; ``--scheme S --only NUMBER`` repeats it. Counts
and findings are rows of ``benchmarks/results/fuzz.jsonl``, one per scheme; an interrupted run continues with missing
schemes.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import tempfile
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.arguments import command_line
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import Records, origin
from benchmarks.workers import cases
from codec import Encoded, decode, encode, parse_scheme, schemes
from codec.contract import find
from ii_core import IIPicture
from ii_core.base.parallel import for_each

RECORDS = Records("fuzz", ("benchmarks.coding.fuzz", "benchmarks.workers"))
LENSES, EI = (16, 8), (4, 4)
ENDS = {"picture": "a picture of the right shape", "refused": "a ValueError"}
SLOW = 1.0  # largest CPU seconds of a refusal
MOST_FINDINGS = 50  # findings of a scheme after which no new worker is started
HEADROOM = 1 << 30  # bytes of address space beyond the use after the first decoding


def main() -> None:
    """Damage, count and record."""
    parser = command_line(__doc__, schemes=schemes())
    parser.add_argument("--mutations", type=int, default=4000, help="of each scheme")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--scheme", help=argparse.SUPPRESS)
    parser.add_argument("--range", type=int, nargs=2, help=argparse.SUPPRESS)
    parser.add_argument("--only", type=int, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.scheme:
        first, last = arguments.range or (arguments.only, arguments.only + 1)
        work(arguments.scheme, arguments.seed, first, last)
        return
    seed, count = arguments.seed, arguments.mutations
    if unknown := set(arguments.schemes) - set(schemes()):
        parser.error(f"no scheme {min(unknown)!r}: known are {', '.join(schemes())}")
    keys = [{"scheme": name, "seed": seed, "mutations": count} for name in arguments.schemes]

    def row(key: dict[str, Any]) -> None:
        record = RECORDS.measure(key, lambda: watched(key["scheme"], seed, count))
        print(f"{key['scheme']}: {record['result']}", flush=True)

    for_each(row, RECORDS.todo(keys, arguments.again), workers=arguments.workers)
    publish(tables())


def tables() -> Tables:
    """Return the sum over all schemes as lines of the page of formats."""
    rows = RECORDS.rows()
    total = sum(sum(row["counts"].values()) for row in rows)
    counts = Counter(kind for row in rows for kind, n in row["counts"].items() for _ in range(n))
    longest = max(row["longest_seconds"] for row in rows)
    ends = ", ".join(f"{counts[kind]} ended in {text}" for kind, text in ENDS.items() if counts[kind])
    bad = total - sum(counts[kind] for kind in ENDS)
    lines = [
        f"{total} mutations over {len(rows)} schemes: {ends}, {bad} otherwise; the longest took {longest:.2f} CPU",
        f"seconds. {origin(rows)}",
    ]
    return {("docs/formats.md", "fuzz"): lines}


def watched(scheme: str, seed: int, count: int) -> dict[str, Any]:
    """Return the counts of all mutations of one scheme; a worker that dies is started again."""
    counts: Counter[str] = Counter()
    findings: list[dict[str, Any]] = []
    longest = 0.0
    for case in cases("benchmarks.coding.fuzz", ("--scheme", scheme, "--seed", str(seed)), count):
        counts[case.what.partition(":")[0]] += 1
        longest = max(longest, case.seconds)
        if case.what not in ENDS or case.seconds > SLOW:
            findings.append(case.finding)
        if case.said is not None and len(findings) > MOST_FINDINGS:
            break
    return {"counts": dict(counts), "longest_seconds": longest, "findings": findings}


def work(scheme: str, seed: int, first: int, last: int, *, limit: bool = True) -> None:
    """Decode mutations by number; print a line of JSON for each."""
    coded = sample(scheme)
    strangers = [sample(name).payload for name in ("si-h264", "jpeg2000")]
    # Decode once, so that compilation and imports count for no mutation; one may turn a stream into a lossless one.
    for once in [coded, *([sample(f"{scheme}:lossless=1")] if "lossless" in find(scheme).options else [])]:
        decode(once)
    room = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize() + HEADROOM
    if limit:
        resource.setrlimit(resource.RLIMIT_AS, (room, room))
    with tempfile.TemporaryDirectory() as folder:
        for number in range(first, last):
            rng = np.random.default_rng((seed, number))
            started = cpu_seconds()
            what = attempt(coded, strangers, rng, Path(folder) / "mutant.ii")
            print(json.dumps([number, what, round(cpu_seconds() - started, 6)]), flush=True)


def cpu_seconds() -> float:
    """Return CPU seconds of this process and of its decoder processes."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def sample(scheme: str) -> Encoded:
    """Return a small detailed picture, coded in the middle of the scheme's range, or without loss."""
    coder, settings = parse_scheme(scheme)
    (k, l), (u, v) = LENSES, EI
    y, x = np.mgrid[: l * v, : k * u]
    shade = 128 + 60 * np.sin(x / 5) * np.cos(y / 3) + 4 * np.random.default_rng(1).standard_normal((l * v, k * u))
    picture = IIPicture(np.stack([shade, 255 - shade, shade / 2], axis=-1).astype(np.uint8), LENSES, EI)
    name = f"{scheme}:gop=5" if "gop" in coder.options else scheme  # none has gop and lossless
    if coder.lossless(settings):
        return encode(picture, name)
    if coder.rate_control:
        return encode(picture, name, bpp=2)
    assert coder.quality_range or coder.qp_range
    if coder.quality_range:
        low, high = coder.quality_range
        return encode(picture, name, quality=type(low)((low + high) / 2))
    assert coder.qp_range
    return encode(picture, name, qp=sum(coder.qp_range) // 2)


def attempt(coded: Encoded, strangers: list[bytes], rng: np.random.Generator, path: Path) -> str:
    """Return the ending of one mutation."""
    try:
        if rng.random() < 0.8:
            mutant = replace(coded, payload=damaged(coded.payload, strangers, rng))
            if rng.random() < 0.1:
                mutant = replace(mutant, structure=other_structure(coded, rng))
            picture = decode(mutant)
        else:
            mutant = replace(coded, structure=other_structure(coded, rng)) if rng.random() < 0.3 else coded
            mutant.save(path)
            if rng.random() < 0.8:
                path.write_bytes(damaged(path.read_bytes(), strangers, rng))
            picture = decode(path)
    except ValueError:
        return "refused"
    except MemoryError:
        return "error: MemoryError"
    except Exception as error:
        return f"error: {type(error).__name__}: {error}"
    (k, l), (u, v) = picture.lenses, picture.ei_pixels
    return "picture" if picture.pixels.shape == (l * v, k * u, 3) else f"error: shape {picture.pixels.shape}"


def damaged(data: bytes, strangers: list[bytes], rng: np.random.Generator) -> bytes:
    """Return bytes after one to three mutations."""
    mutant = bytearray(data)
    for _ in range(rng.integers(1, 4)):
        if not mutant:
            break
        at = int(rng.integers(len(mutant))) if rng.random() < 0.7 else int(rng.integers(min(64, len(mutant))))
        length = int(min(2 ** rng.integers(0, 10), len(mutant) - at))
        match rng.integers(8):
            case 0:
                for position in rng.integers(len(mutant), size=rng.integers(1, 9)):
                    mutant[position] ^= 1 << rng.integers(8)
            case 1:
                mutant[at] = rng.choice([0, 1, 127, 128, 255])
            case 2:
                del mutant[at:]
            case 3:
                del mutant[at : at + length]
            case 4:
                mutant[at:at] = mutant[at : at + length]
            case 5:
                mutant[at : at + length] = rng.bytes(length)
            case 6:
                mutant[at : at + length] = bytes(length)
            case 7:
                stranger = strangers[rng.integers(len(strangers))]
                start = int(rng.integers(len(stranger)))
                mutant[at : at + length] = stranger[start : start + length]
    return bytes(mutant)


def other_structure(coded: Encoded, rng: np.random.Generator) -> dict[str, Any]:
    """Return the structure with other counts, from off by one to more than memory."""
    changed = {**coded.structure, "camera": None}
    for key in ("lenses", "ei_pixels"):
        factors = [1, 1, 1, 2, 3, 100, 1 << 10, 1 << 20]
        changed[key] = [int(n * rng.choice(factors) + rng.integers(0, 2)) for n in changed[key]]
    return changed


if __name__ == "__main__":
    os.environ.setdefault("SVT_LOG", "0")
    main()

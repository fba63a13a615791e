"""Cost of coding: CPU time inside the coder, rearrangement and peak memory of every scheme.

    python -m benchmarks run cost [--scale 2] [--scene apples] [--schemes si-h264,...] [--runs 3]

Every scheme has a process of its own. A small picture is coded first, to import libraries and compile kernels. Then
the picture is coded and decoded ``runs`` times, in the middle of the scheme's quantisers or qualities, in one encoder
run each. The results are medians of CPU time, and the peak growth of resident memory over the bytes of the picture.
Numbers go to ``benchmarks/results/cost.jsonl``, the table into ``docs/structure.md``.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.arguments import command_line
from benchmarks.coding.fuzz import sample
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import Records, origin, table
from codec import Encoded, encode, schemes, timed_decode
from codec.contract import find
from ii_core import IIPicture, preset
from metrics import q_global
from raytrace_ii import load_scene, render

RECORDS = Records("cost", ("benchmarks.coding.cost", "benchmarks.coding.fuzz"))
SCENE, SCALE, RUNS = "apples", 2, 3  # conditions on the page
LARGE = 20  # %: a share of ours that the page names by its scheme
PAGES = Path("/proc/self/statm")


def main() -> None:
    """Measure, print, record and fill the table."""
    parser = command_line(__doc__, scale=SCALE, schemes=schemes())
    parser.add_argument("--scene", default=SCENE)
    parser.add_argument("--runs", type=int, default=RUNS)
    parser.add_argument("--one", nargs=2, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.one:
        print(json.dumps(measured(arguments.one[0], IIPicture.load(arguments.one[1]), arguments.runs)))
        return
    picture_of = {"scene": arguments.scene, "scale": arguments.scale}
    keys = [{**picture_of, "scheme": name, "runs": arguments.runs} for name in arguments.schemes]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "picture.png"
        if RECORDS.todo(keys, arguments.again):
            camera = preset("setup1", scale=arguments.scale)
            render(load_scene(arguments.scene), camera, support=(), noise=1.0).picture.save(path)
        RECORDS.run(keys, lambda scheme, runs, **_: apart(scheme, path, runs), arguments.again)
    publish(tables())


def tables() -> Tables:
    """Return the table of the page of structures."""
    return {("docs/structure.md", "cost"): cost_table(RECORDS.rows(scene=SCENE, scale=SCALE, runs=RUNS))}


def apart(scheme: str, path: Path, runs: int) -> dict[str, Any]:
    """Return times and memory of one scheme, from a process of its own."""
    command = [sys.executable, "-m", "benchmarks.coding.cost", "--runs", str(runs), "--one", scheme, str(path)]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def measured(scheme: str, picture: IIPicture, runs: int) -> dict[str, Any]:
    """Return times and memory of one scheme in this process."""
    timed_decode(sample(scheme))
    found: dict[str, list[float]] = {name: [] for name in ("encode", "encoder", "decode", "decoder")}
    encode_peak = decode_peak = 0
    for _ in range(runs):
        before = reset_peak()
        coded = in_the_middle(picture, scheme)
        encode_peak = max(encode_peak, peak() - before)
        before = reset_peak()
        decoded = timed_decode(coded)
        decode_peak = max(decode_peak, peak() - before)
        assert coded.encode_seconds is not None and coded.codec_seconds is not None
        found["encode"].append(coded.encode_seconds)
        found["encoder"].append(coded.codec_seconds)
        found["decode"].append(decoded.seconds)
        found["decoder"].append(decoded.codec_seconds)
        quality = q_global(picture, decoded.picture)
        del decoded
    size = picture.pixels.nbytes
    return {
        "bpp": coded.bpp,
        "q_global": quality,
        **{f"{name}_seconds": median(values) for name, values in found.items()},
        "encode_peak": encode_peak / size,
        "decode_peak": decode_peak / size,
    }


def in_the_middle(picture: IIPicture, scheme: str) -> Encoded:
    """Code with one encoder run, without search."""
    coder = find(scheme)
    if coder.lossless({key: option.default for key, option in coder.options.items()}):
        return encode(picture, scheme)
    if coder.qp_range:
        return encode(picture, scheme, qp=sum(coder.qp_range) // 2)
    if coder.quality_range:
        low, high = coder.quality_range
        return encode(picture, scheme, quality=type(low)((low + high) / 2))
    return encode(picture, scheme, bpp=0.5)


def reset_peak() -> int:
    """Reset the peak; return the present resident bytes."""
    Path("/proc/self/clear_refs").write_text("5")
    return peak()


def peak() -> int:
    """Return the peak of resident bytes since `reset_peak`."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmHWM"):
            return int(line.split()[1]) * 1024
    raise OSError("this system does not report the peak of resident memory")


def cost_table(rows: list[dict[str, Any]]) -> list[str]:
    """Return a table of CPU seconds and memory in pictures, one row per scheme, and our share of the seconds."""
    lines = []
    for r in rows:
        quality = "lossless" if r["q_global"] is None else format(r["q_global"], ".1f")
        lines.append(
            f"`{r['scheme']}` | {r['bpp']:.3g} | {quality} | {r['encoder_seconds']:.2f} | "
            f"{r['decoder_seconds']:.2f} | {r['encode_peak']:.1f} | {r['decode_peak']:.1f}"
        )
    heads = "scheme | bpp | dB | encoder, s | decoder, s | peak encoding, pictures | peak decoding, pictures"
    said = [ours(rows, encoding=True), ours(rows, encoding=False)]
    return [origin(rows), "", *table(heads, lines, [[r["commit"]] for r in rows]), "", *said]


def ours(rows: list[dict[str, Any]], *, encoding: bool) -> str:
    """Return a sentence with our share of encoding or decoding, over the encoder's time."""
    whole, part = ("encode_seconds", "encoder_seconds") if encoding else ("decode_seconds", "decoder_seconds")
    shares = {r["scheme"]: round(100 * (r[whole] - r[part]) / r["encoder_seconds"]) for r in rows}
    large = {scheme: share for scheme, share in shares.items() if share > LARGE}
    most = max(share for share in shares.values() if share <= LARGE)
    but = ", ".join(f"{share} % for `{scheme}`" for scheme, share in large.items())
    sentence = f"Our share of {'encoding' if encoding else 'decoding'} is at most {most} % of the encoder's time"
    return f"{sentence}, but {but}." if but else f"{sentence}."


if __name__ == "__main__":
    main()

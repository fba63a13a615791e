"""Cases of the readers of measured files: point-spread maps, raw pictures, lenses, answers of observers, results."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from functools import lru_cache, partial
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import Generator

from ii_core import preset
from ii_core.camera.maps import write_maps
from ii_core.camera.prescriptions import lens as read_lens
from ii_core.formats.lfp import read_raw
from ii_core.waves.spread import spread_maps
from ii_core.waves.spread_files import read_spread, write_spread
from metrics.benchmark.profile import profile
from metrics.benchmark.ranking import check_comparable, ranked
from metrics.benchmark.result import FORMAT, NEEDED, VERSION, read_result
from metrics.observers import Options, read_results, verdict
from metrics.observers.plan import make_plan
from metrics.observers.results import sealed
from metrics.observers.simulated import write_simulated

from . import seeds
from .containers import bytes_changed, text_file
from .readers import Read, _as_file, _fresh, _json, _picture_changed, reader
from .trees import json_text, mutated, pick


@lru_cache
def _spread(folder: Path, format: str) -> tuple[Any, dict[str, bytes]]:
    """Sheet and images of the point-spread maps of a small camera."""
    camera = preset("setup1", scale=256)
    write_maps([camera], folder, format=format)
    write_spread([spread_maps(camera, 50.0)], folder, format=format)
    images = {path.name: path.read_bytes() for path in sorted(folder.glob("[SA].*"))}
    return json.loads((folder / "camera.json").read_text("utf-8")), images


@reader("point-spread maps")
def point_spread(rng: Generator, folder: Path) -> Read:
    """Point-spread functions stored as pictures, and their sheet."""
    kind = pick(rng, ("png16", "exr"))
    sheet, images = _spread(folder / f"seed-{kind}", kind)
    damaged = pick(rng, sorted(images)) if rng.random() < 0.3 else ""
    changed = sheet
    if not damaged:
        entry = mutated(sheet["arrays"][0]["spread"], rng, (sheet,))
        changed = {**sheet, "arrays": [{**sheet["arrays"][0], "spread": entry}]}
    case = _fresh(folder)
    (case / "camera.json").write_bytes(_as_file(json_text(changed), rng))
    for name, data in images.items():
        (case / name).write_bytes(_picture_changed(name, data, rng) if name == damaged else data)
    return partial(read_spread, case)


ABOUT, ZMX = seeds.DATA["RAW"], seeds.DATA["ZMX"]


def lfp_section(kind: bytes, content: bytes) -> tuple[bytes, str]:
    """Return a section of a Lytro container, and its name."""
    name = "sha1-" + hashlib.sha1(content).hexdigest()
    head = b"\x89LF" + kind + b"\r\n\x1a\n" + bytes(4) + len(content).to_bytes(4, "big")
    return head + name.encode().ljust(80, b"\0") + content + bytes(-len(content) % 16), name


def lfp_container(packed: bytes, about: bytes, *, second: bool = True, table: Any = None) -> bytes:
    """Return a Lytro container of the first or the second generation, of packed samples and their metadata."""
    image, image_name = lfp_section(b"C", packed)
    told, told_name = lfp_section(b"C", about)
    frame = {"frame": {"imageRef": image_name, "metadataRef": told_name}}
    contents = table or {"frames": [frame]} if second else {"picture": {"frameArray": [frame]}}
    listed, _ = lfp_section(b"M", json_text(contents).encode("utf-8", "surrogatepass"))
    return b"\x89LFP\r\n\x1a\n" + b"\0\0\0\1\0\0\0\0" + listed + told + image


@reader("raw picture")
def raw_picture(rng: Generator, folder: Path) -> Read:
    """A Lytro container, or packed samples with their metadata."""
    packed = np.random.default_rng(0).integers(0, 256, 72, np.uint8).tobytes()
    if rng.random() < 0.2:
        packed = bytes_changed(packed, rng)
    about = _json(ABOUT, rng)
    if rng.random() < 0.3:
        (folder / "case.json").write_bytes(about)
        path = folder / "case.raw"
        path.write_bytes(packed)
        return partial(read_raw, path)
    table = mutated({"frames": [{"frame": {"imageRef": "", "metadataRef": ""}}]}, rng) if rng.random() < 0.1 else None
    data = lfp_container(packed, about, second=rng.random() < 0.7, table=table)
    path = folder / "case.lfp"
    path.write_bytes(bytes_changed(data, rng) if rng.random() < 0.2 else data)
    return partial(read_raw, path)


@lru_cache
def _lenses() -> tuple[Any, ...]:
    """Prescriptions of the package."""
    found = sorted((Path(str(files("assets"))) / "lenses").glob("*.json"))
    return tuple(json.loads(path.read_text("utf-8")) for path in found)


@reader("lens")
def lens(rng: Generator, folder: Path) -> Read:
    """A prescription of a lens, as JSON or as a file of Zemax."""
    if rng.random() < 0.5:
        path = folder / "lens.json"
        path.write_bytes(_json(pick(rng, _lenses()), rng, _lenses()))
    else:
        path = folder / "lens.zmx"
        lines = (
            "  GLAS ___BLANK 1 0 1.5 60",
            "  GLAS F2 2 1",
            "  PARM 1 0.1",
            "  PARM 4 1e99",
            "SURF 9",
            "  GLAS MIRROR",
            "  DISZ -1",
            "UNIT IN",
        )
        path.write_bytes(text_file(ZMX, rng, lines))
    return partial(read_lens, path)


@lru_cache
def _answers(folder: Path) -> tuple[tuple[dict[str, Any], ...], ...]:
    """Records of the files of three SIMULATED observers, without seals."""
    folder.mkdir(exist_ok=True)
    stimuli = [
        {"scene": "a", "name": str(i), "reference": i == 0, "scheme": "si-h264" if i else "", "measures": measures}
        for i, measures in enumerate([{}, *({"q_global": 20.0 + i} for i in range(5))])
    ]
    plan = make_plan(stimuli, [float(i) for i in range(6)], Options(observers=2))
    paths = write_simulated(folder, plan, [5.0, 4.5, 4.0, 3.0, 2.0, 1.0], 3)
    lines = [[json.loads(line) for line in path.read_text("utf-8").splitlines()] for path in paths]
    return tuple(tuple({k: v for k, v in one.items() if k != "check"} for one in each) for each in lines)


@reader("observers")
def observers(rng: Generator, folder: Path) -> Read:
    """Files of observers with valid seals, one of them damaged; sometimes their verdict."""
    case = _fresh(folder)
    whole = _answers(folder / "seed")
    at = int(rng.integers(len(whole)))
    same = mutated(json.loads(whole[0][0]["plan"]), rng, whole[0]) if rng.random() < 0.4 else None
    paths = []
    for i, each in enumerate(whole):
        records: Any = [dict(record) for record in each]
        if same is not None:  # the same changed plan in every file: one file alone would be of another test
            records[0]["plan"] = json_text(same)
        elif i == at:
            records = mutated(records, rng, [list(whole[0])])
        paths.append(case / f"observer-{i + 1:03d}.jsonl")
        data = _sealed(records)
        paths[-1].write_bytes(bytes_changed(data, rng) if i == at and rng.random() < 0.15 else data)
    judged = rng.random() < 0.05  # a verdict takes 0.1 s, mostly for its fits
    return lambda: verdict(read_results(paths)) if judged else read_results(paths)


def _sealed(records: Any) -> bytes:
    """Return changed records as lines whose seals are valid; no lines where a record is not an object of JSON."""
    lines = [""]
    for record in records if isinstance(records, list) else ():
        try:
            value = json.loads(json_text(record))
            if isinstance(value, Mapping) and value:
                lines.append(sealed(dict(value), lines[-1]))
        except (ValueError, RecursionError):
            continue
    return "".join(lines).encode()


@lru_cache
def _result() -> dict[str, Any]:
    """A valid result of a profile of the benchmark."""
    of = profile("small")
    points = [
        {**seeds.POINT, "target_bpp": rate, "bpp": rate, "q_global": 30.0 + i, "decode_seconds": 0.1}
        for i, rate in enumerate(of.rates_bpp)
    ]
    row = {"name": "apples", "sha256": "0" * 64, "points": points}
    told = {"name": of.name, "version": of.version, "sha256": of.digest}
    rest = {**dict.fromkeys(sorted(NEEDED), "a"), "coder": of.anchor}
    return {**rest, "format": FORMAT, "version": VERSION, "profile": told, "pictures": [row]}


@reader("benchmark result")
def benchmark_result(rng: Generator, folder: Path) -> Read:
    """A result of the benchmark of coders, and its ranking beside a valid one of another coder."""
    path, other = folder / "result.json", folder / "other.json"
    path.write_bytes(_json(_result(), rng, (_result(), seeds.STUDY)))
    other.write_text(json.dumps({**_result(), "coder": "another"}))

    def read() -> None:
        named = [(str(one), read_result(one)) for one in (path, other)]
        check_comparable(profile("small"), named)
        ranked(profile("small"), [result for _, result in named])

    return read

"""Installations of the package: size by extras and Python version, and a trial of rendering, coding and measuring.

    python -m benchmarks run install [--pythons python3.11,python3.12] [--extras none,all]

Every installation is a virtual environment of its own, made from this checkout through the package registries, with
the installer of that Python. The size is that of all regular files in its ``site-packages``, without pip, setuptools
and compiled Python files (``*.pyc``). Each installation then renders *Apples* at scale 64, codes it by every scheme
whose libraries it has, and measures the result.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections import Counter
from importlib.metadata import Distribution, distributions
from pathlib import Path
from typing import Any

from benchmarks.arguments import command_line
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import ROOT, Records, origin

RECORDS = Records("install", ("benchmarks.stability.install",))
NONE = "none"
INSTALLERS = {"pip", "setuptools", "wheel"}
LARGEST = 5  # number of distributions named in the table
# Program that the installation runs outside the checkout.
TRIAL = """
import json, platform
from codec import decode, encode, schemes
from ii_core import preset
from ii_core.base.extras import NotInstalled
from metrics import q_global
from raytrace_ii import load_scene, render
picture = render(load_scene("apples"), preset("setup1", scale=64)).picture


def coded(scheme):
    try:
        return encode(picture, scheme, bpp=2.0)
    except NotInstalled:
        return None
    except ValueError:  # it has no rates
        return encode(picture, scheme)


streams = {scheme: coded(scheme) for scheme in schemes()}
found = {scheme: stream and str(q_global(picture, decode(stream))) for scheme, stream in streams.items()}
print(json.dumps({"python": platform.python_version(), "psnr": found}))
"""


def main() -> None:
    """Install, try, record and fill the table."""
    asked = command_line(__doc__, pythons=(sys.executable,), extras=(NONE, "all")).parse_args()
    for python in asked.pythons:
        version = output(python, "-c", "import sys; print(*sys.version_info[:2], sep='.')").strip()
        for key in RECORDS.todo([{"python": version, "extras": extras} for extras in asked.extras], asked.again):
            RECORDS.measure(key, lambda key=key, python=python: measured(python, key["extras"]))
            print(key, flush=True)
    print("\n".join(table()))
    publish(tables())


def measured(python: str, extras: str) -> dict[str, Any]:
    """Return the size in bytes of the installation and of its largest distributions, and the results of its trial."""
    with tempfile.TemporaryDirectory() as folder:
        environment = Path(folder) / "venv"
        output(python, "-m", "venv", str(environment))
        inside = str(environment / "bin" / "python")
        what = str(ROOT) if extras == NONE else f"{ROOT}[{extras}]"
        output(inside, "-m", "pip", "install", "-q", "--no-compile", "--disable-pip-version-check", what)
        output(inside, "-m", "pip", "check", "--disable-pip-version-check")
        site = output(inside, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))").strip()
        kept = [found for found in distributions(path=[site]) if found.name not in INSTALLERS]
        sizes = Counter({found.name: size(found) for found in kept})
        trial = json.loads(output(inside, "-c", TRIAL, folder=folder))
    return {
        "bytes": sizes.total(),
        "distributions": {found.name: found.version for found in kept},
        "largest": dict(sizes.most_common(LARGEST)),
        "trial": trial,
    }


def size(distribution: Distribution) -> int:
    """Return the bytes of the installed files of a distribution, without compiled Python files."""
    files = [Path(str(distribution.locate_file(file))) for file in distribution.files or ()]
    return sum(file.stat().st_size for file in files if file.is_file() and file.suffix != ".pyc")


def output(*command: str, folder: str | Path = ROOT) -> str:
    """Return the output of a command; raise with its error output if it fails."""
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command[:6])}: {done.stderr.strip()[-2000:]}")
    return done.stdout


def tables() -> Tables:
    """Return the table of the tutorial."""
    return {("docs/tutorial.md", "install"): table()}


def table() -> list[str]:
    """Return a table with a row per installation: size and schemes that work; the record has the largest parts."""
    rows = RECORDS.rows()
    if not rows:
        return ["Not measured yet."]
    lines = ["| Python | extras | size | schemes that code |", "|---|---|---|---|"]
    for row in sorted(rows, key=lambda row: (row["extras"] != NONE, row["trial"]["python"])):
        psnr = row["trial"]["psnr"]
        working = sum(value is not None for value in psnr.values())
        cells = (
            row["trial"]["python"],
            row["extras"],
            f"{row['bytes'] / 2**20:.0f} MiB",
            f"{working} of {len(psnr)}",
        )
        lines.append(f"| {' | '.join(cells)} |")
    return [origin(rows), "", *lines]


if __name__ == "__main__":
    main()

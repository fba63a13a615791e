"""Commands that evaluate: measure, study."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .coding import study_orders
from .common import Force, Workers, app, check_output, columns, load_any, progress_bar, spinner

if TYPE_CHECKING:
    from ii_core import IIPicture

RATES = (0.02, 0.05, 0.15, 0.4, 1.0)
SCHEMES = ("si-h264", "ei-h264", "ri-h264", "jpeg2000")
STUDY_SUFFIXES = ("_rd.json", "_rd.csv", "_rd.png")


@app.command()
def measure(
    reference: Annotated[Path, typer.Argument(help="The II-picture as it was.")],
    decoded: Annotated[Path, typer.Argument(help="The II-picture to judge, or a coded file.")],
    json: Annotated[Path | None, typer.Option(help="Write the numbers here.")] = None,
    plots: Annotated[Path | None, typer.Option(help="Draw angles, depth and views into this folder.")] = None,
    depth: Annotated[Path | None, typer.Option(help="Quality over depth, of this map: z in mm, an .exr.")] = None,
    focus: Annotated[bool, typer.Option("--focus", help="Quality over depth, estimated from focus.")] = False,
    force: Force = False,
) -> None:
    """Compare two II-pictures of the same structure."""
    from ii_core import IIPicture
    from ii_core.files import write_json
    from metrics import q_angle, q_global

    if json:
        check_output(json, force)
    if plots:
        from metrics import PLOTS, plot_all

        for name in PLOTS:
            check_output(plots / name, force, make_folder=True)
    a, b = IIPicture.load(reference), load_any(decoded)
    numbers: dict[str, Any] = {
        "reference": str(reference),
        "decoded": str(decoded),
        "q_global": q_global(a, b),
        "unit": "dB",
    }
    rows = {"Q_global": f"{numbers['q_global']:.2f} dB"}
    if a.regular:
        angle = q_angle(a, b)
        numbers["q_angle"] = angle.tolist()
        rows["Q_angle"] = f"{angle.min():.2f} … {angle.max():.2f} dB over {angle.shape[1]}×{angle.shape[0]} angles"
    if a.regular and a.camera and min(a.lenses) >= 11:  # SSIM's window
        from metrics import q_view

        view = q_view(a, b)
        numbers["q_view"] = {**view.values, "mean": view.mean}
        rows["Q_view"] = f"{view.mean:.4f} (" + ", ".join(f"{k} {v:.4f}" for k, v in view.values.items()) + ")"
    layers = _depth_quality(a, b, depth) if depth or focus or plots else None
    if layers is not None:
        numbers["q_depth"] = {"depth_mm": layers.depth_mm.tolist(), "values": layers.values.tolist()}
        numbers["q_depth"] |= {"counts": layers.counts.tolist(), "source": layers.source}
        held = int((layers.counts > 0).sum())
        span = f"{layers.min:.2f} … {layers.max:.2f} dB over {held} layers" if held else "no depth found"
        rows["Q_depth"] = f"{span}; depth: {layers.source}"
    if plots:
        with spinner(f"draw into {plots}"):
            plot_all(a, b, layers, plots)
    if json:
        write_json(json, numbers)
    columns(rows)


def _depth_quality(a: IIPicture, b: IIPicture, depth: Path | None) -> Any:
    """Q_depth over a given depth map or, where the structure allows, over one estimated; else None."""
    from ii_core.files import read_depth
    from metrics import q_depth

    if depth is not None:
        return q_depth(a, b, depth=read_depth(depth))
    if not a.regular or a.camera is None or a.camera.front:
        return None
    with spinner("find depth"):
        return q_depth(a, b)


@app.command()
def study(
    picture: Annotated[Path, typer.Argument(help="An II-picture with its sidecar.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="A folder for chart and numbers.")],
    schemes: Annotated[str, typer.Option(help="Schemes, parted by commas; options of one by semicolons.")] = ",".join(
        SCHEMES
    ),
    rates: Annotated[str, typer.Option(help="Bits per pixel, parted by commas.")] = ",".join(map(str, RATES)),
    orders: Annotated[
        bool, typer.Option("--orders", help="Code nothing: correlation and residuals of every order instead.")
    ] = False,
    workers: Workers = None,
    force: Force = False,
) -> None:
    """Chart quality against rate for several schemes."""
    from codec import parse_scheme
    from ii_core import IIPicture

    if orders:
        study_orders(picture, output, force)
        return
    names = [name.replace(";", ",") for name in schemes.split(",")]
    for name in names:
        parse_scheme(name)  # a misspelt one is found before anything is made
    try:
        targets = [float(rate) for rate in rates.split(",")]
    except ValueError:
        raise ValueError(f"rates are {rates!r}: numbers parted by commas are needed") from None
    for suffix in STUDY_SUFFIXES:
        check_output(output / f"{picture.stem}{suffix}", force, make_folder=True)
    original = IIPicture.load(picture)
    run_study(original, picture.stem, names, targets, output, workers=workers)


def run_study(
    picture: IIPicture, name: str, schemes: Sequence[str], rates: Sequence[float], folder: Path, *,
    workers: int | None = None, extra: dict[str, Any] | None = None,
) -> None:  # fmt: skip
    """Measure; leave name_rd.json, .csv and, drawn from the JSON, .png in a folder; print a table."""
    from codec import decode, encode
    from metrics import rate_distortion, rd_chart, read_study, write_csv, write_study

    from ..rendering import cores

    with progress_bar(f"code {name}") as report:
        records = rate_distortion(
            picture, schemes, rates, encode=encode, decode=decode, progress=report, workers=workers or cores()
        )
    numbers, table, chart = (folder / f"{name}{suffix}" for suffix in STUDY_SUFFIXES)
    write_study(numbers, name, records, extra, picture=picture)
    write_csv(table, records)
    drawn = read_study(numbers)
    rd_chart(drawn, chart)
    print_summary(name, drawn)


def print_summary(name: str, study: dict[str, Any]) -> None:
    """The study as a table in the terminal."""
    from rich.console import Console
    from rich.table import Table

    from metrics import summary_table

    rows = summary_table(study)
    table = Table(title=f"{name}: Q_global in dB at bits per pixel; gain, BD-rate and BD-PSNR against jpeg2000")
    for column in rows[0]:
        table.add_column(column, justify="left" if column == "scheme" else "right", no_wrap=True)
    for row in rows:
        table.add_row(*row.values())
    console = Console()
    Console(width=max(console.width, 150)).print(table)

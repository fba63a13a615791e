"""Commands that evaluate: measure, study."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .cluster import Dask, check_cluster, cluster
from .coding import study_orders
from .common import Force, Workers, app, check_outputs, check_unused, columns, load_any, tell_nominal
from .plugins import Plugins, load_plugins
from .progress import progress_bar, spinner
from .tables import print_table
from .words import one_line, say

if TYPE_CHECKING:
    from ii_core import IIPicture

PICTURES = "pictures_rd.json"
SCHEMES = ("si-h264", "ei-h264", "ri-h264", "jpeg2000")
STUDY_ENDS = (".tex", ".png", ".pdf")
OVER_DEPTH = ("q_depth_min", "q_depth_mean", "q_depth_max")
Layers = Annotated[
    str | None,
    typer.Option(
        help="Depth layers: NEAR:FAR:COUNT in mm, spaced in equal ratios; or COUNT layers one gap apart, from the "
        "pixel plane on; or dissertation, 250 of the latter; or px:LOW:HIGH:COUNT in equal steps of disparity, in "
        "pixels a view. Default: 250 layers over all depths of the picture."
    ),
]
Method = Annotated[str, typer.Option(help="Method of depth from focus: dissertation or robust.")]


@app.command()
def measures(plugin: Plugins = None) -> None:
    """List the measures that studies chart."""
    from metrics import known_measures

    load_plugins(plugin)
    columns({name: measure.caption for name, measure in known_measures().items()})


@app.command()
def measure(
    context: typer.Context,
    reference: Annotated[Path, typer.Argument(help="The original II-picture, or a folder of frames.")],
    decoded: Annotated[
        Path, typer.Argument(help="The decoded II-picture, a plain picture of the same size, or a coded file.")
    ],
    json: Annotated[Path | None, typer.Option(help="Write the numbers to this .json.")] = None,
    plots: Annotated[
        Path | None, typer.Option(help="Write charts of angles, depth, views and errors into this folder.")
    ] = None,
    depth: Annotated[Path | None, typer.Option(help="Measure Q_depth with this map of z in mm (.exr).")] = None,
    depth_from_focus: Annotated[
        bool, typer.Option("--depth-from-focus", help="Measure Q_depth with depth from focus.")
    ] = False,
    method: Method = "dissertation",
    layers: Layers = None,
    ssim: Annotated[
        bool,
        typer.Option(
            "--ssim", help="Also measure SSIM and MS-SSIM of every sub-image, and JPEG Pleno's PSNR-YUV and SSIM."
        ),
    ] = False,
    mask: Annotated[Path | None, typer.Option(help="Measure only the pixels that are white in this picture.")] = None,
    plugin: Plugins = None,
    force: Force = False,
) -> None:
    """Compare two II-pictures of the same structure, or two takes over time."""
    from ii_core import IIPicture
    from ii_core.base.atomic import atomic_folder
    from ii_core.base.extras import load
    from ii_core.base.files import read_depth, read_image, write_json
    from metrics import report

    load_plugins(plugin)
    files = [json] if json else []
    check_outputs(files, force)
    if reference.is_dir():
        from .take import measure_frames

        check_unused(
            context, f"{reference} is a take, which", "depth", "depth_from_focus", "method", "layers", "ssim", "mask"
        )
        measure_frames(reference, decoded, json, plots, force)
        return
    if not (depth or depth_from_focus or plots):
        check_unused(context, "a measurement without --depth-from-focus, --depth or --plots", "method", "layers")
    if depth:
        check_unused(context, "--depth", "method", "depth_from_focus")
    if plots:
        load("matplotlib")  # before the work
        from metrics import PLOTS, plot_all

        check_outputs([*files, *(plots / name for name in PLOTS)], force, make_folder=True)
    a = IIPicture.load(reference)
    tell_nominal(a, str(reference))
    b = _judged(decoded, a)
    made = report(
        a,
        b,
        mask=None if mask is None else read_image(mask, size=a.size).min(axis=2) > 0,
        ssim=ssim,
        over_depth=bool(depth or depth_from_focus or plots),
        depth=None if depth is None else read_depth(depth, size=a.size),
        layers_mm=_layers(layers, a),
        method=method,
    )
    with ExitStack() as outputs:  # numbers and charts appear together, or a stopped run leaves neither
        if plots:
            folder = outputs.enter_context(atomic_folder(plots))
            with spinner(f"draw into {plots}"):
                plot_all(a, b, made.depth, folder)
        if json:
            write_json(json, {"reference": str(reference), "decoded": str(decoded), **made.numbers})
    columns(made.rows)
    if _is_bare(decoded):  # anything of this size is compared, a picture of depths as well
        print(
            f"note: {one_line(str(decoded))} has no sidecar: the structure of the reference is taken", file=sys.stderr
        )


def _is_bare(path: Path) -> bool:
    """Whether a picture has no sidecar."""
    from ii_core.base.files import IMAGE_TYPES
    from ii_core.picture.picture import sidecar

    return path.suffix.lower() in IMAGE_TYPES and not sidecar(path).exists()


def _judged(path: Path, reference: IIPicture) -> IIPicture:
    """Return the decoded picture; without a sidecar it has the structure of the reference."""
    from ii_core.base.files import image_header, read_image
    from ii_core.picture.picture import sidecar

    if not _is_bare(path):
        return load_any(path)
    shape, _ = image_header(path)
    if shape != reference.pixels.shape:
        raise ValueError(
            f"{path} has no sidecar {sidecar(path).name}, and {shape[1]}×{shape[0]} px of {shape[2]} channels: "
            f"those of the reference, {reference.size[0]}×{reference.size[1]} of 3, are needed"
        )
    return reference.with_pixels(read_image(path))


def _layers(text: str | None, picture: IIPicture) -> Any:
    """Return depths of layers from ``dissertation``, ``250``, ``5:200:60`` or ``px:-2:2:60``; None if no text."""
    from ii_core.picture.view import camera_of
    from metrics import disparity_layers, linear_layers, logarithmic_layers

    if text is None:
        return None
    if text == "dissertation":
        return linear_layers(camera_of(picture))
    in_pixels = text.startswith("px:")
    *span, count = text.removeprefix("px:").split(":")
    try:
        ends, number = [float(end) for end in span], int(count)
    except ValueError:
        ends, number = [], 0
    if len(ends) not in (0, 2) or not number or (in_pixels and not ends):
        raise ValueError(
            f"layers are {text!r}: dissertation, a number, NEAR:FAR:COUNT or px:LOW:HIGH:COUNT is needed"
        )
    try:
        if in_pixels:
            return disparity_layers(camera_of(picture), ends[0], ends[1], number)
        return logarithmic_layers(ends[0], ends[1], number) if ends else linear_layers(camera_of(picture), number)
    except ValueError as error:
        raise ValueError(f"layers are {text!r}: {error}") from None


@app.command()
def study(
    context: typer.Context,
    pictures: Annotated[list[Path], typer.Argument(help="II-pictures with their sidecars.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="A folder for charts and numbers.")],
    schemes: Annotated[
        str, typer.Option(help="Schemes separated by commas; options of a scheme by semicolons.")
    ] = ",".join(SCHEMES),
    anchor: Annotated[
        str | None, typer.Option(help="Anchor: the scheme of comparison; the first if not given.")
    ] = None,
    rates: Annotated[
        str | None,
        typer.Option(help="Bits per pixel, separated by commas; five that all schemes reach if not given."),
    ] = None,
    measures: Annotated[
        str, typer.Option(help="Measures to chart, separated by commas: q_global, q_view, q_depth …")
    ] = "q_global",
    depth: Annotated[
        Path | None, typer.Option(help="For q_depth: map of z in mm (.exr); by default from focus.")
    ] = None,
    method: Method = "dissertation",
    layers: Layers = None,
    orders: Annotated[
        bool, typer.Option("--orders", help="Compute correlation and residuals of every order instead of coding.")
    ] = False,
    workers: Workers = None,
    dask: Dask = None,
    plugin: Plugins = None,
    force: Force = False,
) -> None:
    """Chart quality against rate for several schemes.

    Every point is written when it is measured. The same command continues a study that was stopped, and draws again
    what is measured already.
    """
    from codec import parse_scheme
    from ii_core import IIPicture
    from ii_core.base.extras import load
    from ii_core.base.files import read_depth
    from metrics.measures.measure import measure_of
    from metrics.rates.rd import identity

    if orders:
        coding = ("schemes", "anchor", "rates", "measures", "depth", "method", "layers", "workers", "dask")
        check_unused(context, "--orders", *coding)
    check_cluster(workers, dask, plugin)
    load_plugins(plugin)
    if not orders:
        for library in ("matplotlib", "bjontegaard"):  # before the work
            load(library)
    stems = [picture.stem for picture in pictures]
    if len(set(stems)) < len(stems):
        raise ValueError(f"pictures are named {', '.join(stems)}: every picture needs a name of its own")
    if orders:
        for picture in pictures:
            study_orders(picture, output, force)
        return
    names = [_scheme(name) for name in schemes.split(",")]
    for name in names:
        parse_scheme(name)  # an unknown name is an error before any output
    if anchor is not None and (anchor := _scheme(anchor)) not in names:
        raise ValueError(f"anchor is {anchor!r}: one of the schemes {', '.join(names)} is needed")
    if depth is not None and len(pictures) > 1:
        raise ValueError(f"--depth is the map of one picture, {len(pictures)} are given: study them one by one")
    targets, wanted = _rates(rates), _measures(measures)
    if not any(measure_of(name).needs.depth for name in wanted):
        check_unused(context, f"--measures {measures}", "depth", "method", "layers")
    if depth is not None:
        check_unused(context, "--depth", "method")
    means = [output / PICTURES] if len(stems) > 1 else []
    files = [*(file for stem in stems for file in study_files(output, stem, wanted)), *means]
    begun = not force and any(map(os.path.lexists, files)) and not all(map(os.path.lexists, files))
    if not begun:
        check_outputs(files, force, make_folder=True)
    own: set[Path] = set()
    jobs: list[tuple[IIPicture, str, dict[str, Any]]] = []
    for picture, stem in zip(pictures, stems, strict=True):
        original = IIPicture.load(picture)
        z = None if depth is None else read_depth(depth, size=original.size)
        over_depth = {"depth": z, "method": method, "layers_mm": _layers(layers, original)}
        jobs.append((original, stem, {"measures": wanted, "anchor": anchor, **over_depth}))
        if begun and is_measured(original, stem, names, targets, output, **jobs[-1][2]):
            own.update(study_files(output, stem, wanted))
    check_outputs(files, force, make_folder=True, own={*own, *means} if own else own)
    with cluster(dask, identity) as executor:
        for original, stem, options in jobs:
            run_study(
                original, stem, names, targets, output, workers=workers, executor=executor, resume=begun, **options
            )
    if len(stems) > 1:
        write_means(output, stems, wanted)


def _scheme(text: str) -> str:
    return text.strip().replace(";", ",")


def _rates(text: str | None) -> list[float] | None:
    if text is None:
        return None
    try:
        return [float(rate) for rate in text.split(",")]
    except ValueError:
        raise ValueError(f"rates are {text!r}: numbers separated by commas are needed") from None


def _measures(text: str) -> list[str]:
    """Return names of measures, each once; ``q_depth`` means its minimum, mean and maximum."""
    from metrics import known_measures

    names = dict.fromkeys(
        name for given in text.split(",") for name in (OVER_DEPTH if given == "q_depth" else (given,))
    )
    known = known_measures()
    if unknown := [name for name in names if name not in known]:
        raise ValueError(f"unknown measure {unknown[0]!r}: known are q_depth, {', '.join(known)}")
    return list(names)


def study_files(folder: Path, name: str, measures: Sequence[str]) -> list[Path]:
    """Return the files of `run_study`: numbers, and a table and charts per measure."""
    stems = [_stem(name, measure) for measure in measures]
    files = [f"{name}_rd.json", f"{name}_rd.csv", *(f"{stem}{end}" for stem in stems for end in STUDY_ENDS)]
    if set(OVER_DEPTH) <= set(measures):
        files += [f"{name}_q_depth.png", f"{name}_q_depth.pdf"]
    return [folder / file for file in files]


def _stem(name: str, measure: str) -> str:
    return f"{name}_rd" if measure == "q_global" else f"{name}_{measure}"


def run_study(
    picture: IIPicture, name: str, schemes: Sequence[str], rates: Sequence[float] | None, folder: Path, *,
    workers: int | None = None, executor: Any = None, extra: dict[str, Any] | None = None,
    measures: Sequence[str] = ("q_global",), anchor: str | None = None, resume: bool = False, **over_depth: Any,
) -> None:  # fmt: skip
    """Measure a study; write `study_files` into a folder, with charts and tables from the JSON; print the tables.

    Points are kept in ``NAME_rd.points.jsonl`` until all are measured; a study that was killed continues from there.
    Rates default to `default_rates`. ``over_depth`` holds depth, layers_mm and method of `measuring`. With
    ``resume``, a study whose numbers are complete is drawn without measuring it again.
    """
    from codec import encode, timed_decode
    from ii_core.base.parallel import cores
    from metrics import default_rates, measuring, provenance, rate_distortion, write_study

    provenance()  # record the commit that measures, even if the checkout changes meanwhile
    log = _log(picture, name, folder, measures, over_depth)
    if resume and is_measured(picture, name, schemes, rates, folder, measures=measures, anchor=anchor, **over_depth):
        log.remove()
        draw_study(folder, name, measures)
        return
    more = measuring(picture, measures, **over_depth) if set(measures) - {"q_global"} else None
    request = log.request(list(schemes), None if rates is None else list(rates), anchor)
    if log.known:
        print(f"{name}: {len(log.known)} points are kept from an interrupted run")
    if workers is None and executor is None:
        workers = cores()
    means: dict[str, Any] = {"workers": workers, "executor": executor}
    means |= {"encode": encode, "decode": timed_decode, "measure": more, "keep": log.keep}
    if rates is None:
        with progress_bar(f"find the rates of {name}") as report:
            rates, found = default_rates(picture, schemes, known=log.known, progress=report, **means)
        log.known.update(found)
        say(f"{name}: rates {', '.join(f'{rate:g}' for rate in rates)} bpp")
    with progress_bar(f"code {name}") as report:
        records = rate_distortion(picture, schemes, rates, known=log.known, progress=report, **means)
    extra = {**(extra or {}), "request": request}
    write_study(folder / f"{name}_rd.json", name, records, extra, picture=picture, anchor=anchor)
    log.remove()
    draw_study(folder, name, measures)


def _log(picture: IIPicture, name: str, folder: Path, measures: Sequence[str], over_depth: dict[str, Any]) -> Any:
    from metrics import PointLog

    return PointLog(folder / f"{name}_rd.points.jsonl", picture, measures=sorted(measures), **over_depth)


def is_measured(
    picture: IIPicture, name: str, schemes: Sequence[str], rates: Sequence[float] | None, folder: Path, *,
    measures: Sequence[str], anchor: str | None, **over_depth: Any,
) -> bool:  # fmt: skip
    """Return whether the folder holds all numbers of this study, measured by this code from the same inputs."""
    from metrics import read_study

    numbers = folder / f"{name}_rd.json"
    if not numbers.is_file():
        return False
    log = _log(picture, name, folder, measures, over_depth)
    request = log.request(list(schemes), None if rates is None else list(rates), anchor)
    try:
        extra = read_study(numbers).get("extra")
    except ValueError:
        return False
    return isinstance(extra, dict) and extra.get("request") == request


def draw_study(folder: Path, name: str, measures: Sequence[str]) -> None:
    """Draw the charts and write the tables of a study from its JSON; print the tables."""
    from metrics import depth_rate_chart, rd_chart, read_study, summary_table, write_csv, write_latex
    from metrics.measures.quality import told_outside

    drawn = read_study(folder / f"{name}_rd.json")
    write_csv(folder / f"{name}_rd.csv", drawn["points"])
    for measure in measures:
        table, *charts = (folder / f"{_stem(name, measure)}{end}" for end in STUDY_ENDS)
        write_latex(table, summary_table(drawn, measure=measure), f"{name}: {about(measure, drawn['anchor'])}")
        for chart in charts:
            rd_chart(drawn, chart, measure=measure)
        print_summary(name, drawn, measure)
    if lost := {point["depth_outside"] for point in drawn["points"] if "depth_outside" in point}:
        say(f"{name}: {told_outside(max(lost))}")
    if set(OVER_DEPTH) <= set(measures):
        for end in (".png", ".pdf"):
            depth_rate_chart(drawn, folder / f"{name}_q_depth{end}")


def write_means(folder: Path, names: Sequence[str], measures: Sequence[str]) -> None:
    """Write the mean differences over several pictures into a folder; print them."""
    from ii_core.base.files import write_json
    from metrics import mean_differences, provenance, read_study
    from metrics.rates.points import spelt

    studies = [read_study(folder / f"{name}_rd.json") for name in names]
    means = {measure: mean_differences(studies, measure=measure) for measure in measures}
    write_json(
        folder / PICTURES,
        {
            "format": "ii-rd-pictures", "version": 1, **provenance(), "pictures": list(names),
            "anchor": studies[0]["anchor"], "differences": spelt(means),
        },
    )  # fmt: skip
    for measure, schemes in means.items():
        say(f"mean of {len(names)} pictures, {about(measure, studies[0]['anchor'])}:")
        columns({scheme: _means(found, measure) for scheme, found in schemes.items()})


def _means(found: dict[str, Any], measure: str) -> str:
    from metrics.measures.measure import measure_of

    kind = measure_of(measure)
    unit = f" {kind.unit}" if kind.unit else ""
    shown = {
        "gain": ("gain", kind.digits, unit), "bd_rate_percent": ("BD-rate", 1, " %"),
        "bd_quality": ("at equal rate", kind.digits, unit),
    }  # fmt: skip
    parts = []
    for name, (label, digits, unit) in shown.items():
        value, count = found[name], found["pictures"][name]
        parts.append(f"{label} " + (f"{value:+.{digits}f}{unit} ({count})" if count else "–"))
    return ", ".join(parts)


def about(measure: str, anchor: str) -> str:
    """Return the caption of the table of a measure."""
    from metrics.measures.measure import measure_of

    return f"{measure_of(measure).caption} at bits per pixel; gain and Bjøntegaard differences against {anchor}"


def print_summary(name: str, study: dict[str, Any], measure: str = "q_global") -> None:
    """Print the study as a table in the terminal."""
    from metrics import summary_table

    print_table(f"{name}: {about(measure, study['anchor'])}", summary_table(study, measure=measure))

"""Commands of tests with observers: subjective makes a test, opinions analyses its results."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .common import Force, app, check_outputs, check_page, columns, pair
from .plugins import Plugins, load_plugins
from .progress import progress_bar
from .words import say

if TYPE_CHECKING:
    from ii_core import IIPicture
    from metrics.observers import Stimulus, Verdict

MEASURES = ("q_global", "q_angle_min", "q_view", "q_view_psnr")


@app.command()
def subjective(
    pictures: Annotated[
        list[Path],
        typer.Argument(help="For each scene the original II-picture with its sidecar, then its coded files."),
    ],
    output: Annotated[Path | None, typer.Option("-o", "--output", help="The page, .html.")] = None,
    method: Annotated[str, typer.Option(help="dsis (ITU-R BT.500) or pairs.")] = "dsis",
    show: Annotated[
        str, typer.Option(help="front: one view; views: five; across, around: pseudo-video along a path.")
    ] = "around",
    frames: Annotated[int, typer.Option(help="Views of a pseudo-video.")] = 24,
    size: Annotated[str | None, typer.Option(help="Pixels of a view, as 512x256; one per lens if not given.")] = None,
    seconds: Annotated[float, typer.Option(help="Seconds of each picture.")] = 10.0,
    grey: Annotated[float, typer.Option(help="Seconds of grey between reference and picture.")] = 3.0,
    block: Annotated[int, typer.Option(help="Presentations between breaks.")] = 40,
    observers: Annotated[int, typer.Option(help="Number of different orders, even.")] = 24,
    training: Annotated[int, typer.Option(help="Training presentations, which do not count.")] = 3,
    seed: Annotated[int, typer.Option(help="Seed of the orders.")] = 0,
    title: Annotated[str, typer.Option(help="Title shown to the observers.")] = "Quality of pictures",
    measures: Annotated[
        str | None,
        typer.Option(help="Measures that opinions are compared with, or none; four that need no depth if not given."),
    ] = None,
    serve: Annotated[
        bool, typer.Option("--serve", help="Serve the test on this machine; answers go to --results.")
    ] = False,
    results: Annotated[Path, typer.Option(help="Folder of --serve, one file for each observer.")] = Path("results"),
    port: Annotated[int, typer.Option(help="Port of --serve; 0 for any free one.")] = 0,
    plugin: Plugins = None,
    force: Force = False,
) -> None:
    """Make a test with observers: one page for a browser that shows coded pictures and keeps the answers."""
    from metrics.observers import Options, write_test

    from .server import Answers, serve_folder

    load_plugins(plugin)
    options = Options(
        method=method, show=show, frames=frames, seconds=seconds, grey_seconds=grey, block=block,
        observers=observers, training=training, seed=seed,
    )  # fmt: skip
    check_page(output, serve, port, force)
    points = None if size is None else pair("size", size)
    stimuli = _stimuli(pictures, measures)
    with progress_bar("views") as report:
        written: dict[str, Any] = {"size": points, "title": title, "progress": lambda a, b: report(a, b, "")}
        if output is not None:
            plan = write_test(output, stimuli, options, **written)
            say(f"{output}: {output.stat().st_size / 2**20:.1f} MB, {_length(plan)}")
            return
        import tempfile

        folder = tempfile.TemporaryDirectory(prefix="raytrace-ii-")
        plan = write_test(Path(folder.name) / "index.html", stimuli, options, served=True, **written)
    import json

    from metrics.observers.store import ResultFolder

    with folder:
        say(f"{_length(plan)}; answers go to {results}/")
        serve_folder(folder.name, port, Answers.into(ResultFolder(results, json.dumps(plan, ensure_ascii=False))))


def _length(plan: dict[str, Any]) -> str:
    from metrics.observers.plan import duration_s

    return f"{len(plan['orders'][0])} presentations, about {duration_s(plan) / 60:.0f} minutes for an observer"


def _stimuli(paths: list[Path], measures: str | None) -> list[Stimulus]:
    """Return references and coded pictures; a picture begins a scene, coded files belong to it."""
    from codec import Encoded, decode
    from ii_core import IIPicture
    from ii_core.base.files import IMAGE_TYPES
    from metrics import measuring
    from metrics.observers import Stimulus

    made: list[Stimulus] = []
    reference: IIPicture | None = None
    for path in paths:
        if path.suffix.lower() in IMAGE_TYPES:
            reference = IIPicture.load(path)
            names = _possible(reference) if measures is None else [] if measures == "none" else measures.split(",")
            measure = measuring(reference, names)
            made.append(Stimulus(scene=path.stem, name="reference", picture=reference, reference=True))
            continue
        if reference is None:
            raise ValueError(f"{path} comes before any picture: give the original first, then its coded files")
        coded = Encoded.load(path)
        picture = decode(coded)
        name = f"{coded.scheme}, {coded.bpp:.3g} bpp"
        reference.check_same_structure(picture)
        found = measure(picture)
        values = {name: found[name] for name in names}
        made.append(
            Stimulus(
                scene=made[-1].scene, name=name, picture=picture, scheme=coded.scheme, bpp=coded.bpp, measures=values
            )
        )
    return made


def _possible(reference: IIPicture) -> list[str]:
    """Return the names in `MEASURES` whose needs the picture meets."""
    from metrics import MEASURES as KNOWN
    from metrics import PicturePair

    pair = PicturePair(reference, reference)
    return [name for name in MEASURES if KNOWN[name].needs.unmet(pair) is None]


@app.command()
def opinions(
    results: Annotated[list[Path], typer.Argument(help="Files of observers, or a folder of them.")],
    json: Annotated[Path | None, typer.Option(help="Write the numbers to this .json.")] = None,
    chart: Annotated[
        Path | None, typer.Option(help="Draw scores over measures into this .png, .pdf or .svg.")
    ] = None,
    confidence: Annotated[float, typer.Option(help="Level of the confidence intervals.")] = 0.95,
    force: Force = False,
) -> None:
    """Analyse results of a test with observers: scores with intervals, and their prediction by measures."""
    from ii_core.base.atomic import atomic_path
    from ii_core.base.files import write_json
    from ii_core.display.figure import check_suffix
    from metrics.observers import read_results, verdict
    from metrics.plots.opinion_chart import opinion_chart

    check_outputs([path for path in (json, chart) if path], force)
    if chart is not None:
        check_suffix(chart)
    files = [file for path in results for file in (sorted(path.glob("*.jsonl")) if path.is_dir() else [path])]
    if not files:
        raise ValueError(f"{results[0]} holds no file of an observer: observer-001.jsonl is needed")
    made = verdict(read_results(files), confidence=confidence)
    for note in made.notes:
        say(f"note: {note}")
    _print(made)
    with ExitStack() as outputs:  # numbers and chart appear together, or a stopped run leaves neither
        if chart:
            opinion_chart(made, outputs.enter_context(atomic_path(chart)))
        if json:
            write_json(json, made.numbers)


def _print(made: Verdict) -> None:
    say(f"{made.unit}, {made.observers} observers")
    rows = {}
    for one in made.judged:
        stimulus = made.plan["stimuli"][one.stimulus]
        rows[f"{stimulus['scene']}, {stimulus['name']}"] = f"{one.score:.2f} ± {one.half_width:.2f} ({one.given})"
    columns(rows)
    if made.predictions:
        say("prediction by measures: PLCC after the monotone fit, SROCC, RMSE, outlier ratio")
    columns(
        {
            f"{measure}, {group}": f"{p.plcc:.3f}  {p.srocc:.3f}  {p.rmse:.3f}  {p.outlier_ratio:.0%}"
            for (measure, group), p in made.predictions.items()
        }
    )

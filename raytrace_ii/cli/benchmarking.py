"""Commands of the open benchmark: benchmark, ranking."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .cluster import Dask, check_cluster, cluster
from .common import Force, app, check_outputs, columns
from .plugins import Plugins, load_plugins
from .progress import progress_bar, say_done
from .words import say

if TYPE_CHECKING:
    from metrics.benchmark.profile import Reference
    from metrics.benchmark.subject import Subject


@app.command()
def benchmark(
    profile: Annotated[
        str | None, typer.Argument(help="Name or .toml file of a profile; lists all if not given.")
    ] = None,
    scheme: Annotated[
        str | None, typer.Option(help="Scheme from `raytrace-ii schemes`, options after a colon.")
    ] = None,
    anchor: Annotated[
        str | None, typer.Option(help="Coder of FFmpeg with best settings, such as vvenc; `--anchor list` lists all.")
    ] = None,
    external: Annotated[
        tuple[str, str],
        typer.Option(help="Commands of an encoder and a decoder: 'enc {in} {out} {bpp}' 'dec {in} {out}'."),
    ] = ("", ""),
    decoded: Annotated[
        Path | None,
        typer.Option(help="Folder of decoded views and sizes, PICTURE/TARGET, of a coder that ran elsewhere."),
    ] = None,
    name: Annotated[str | None, typer.Option(help="Name of --external or --decoded in results.")] = None,
    views: Annotated[
        str, typer.Option(help="Files of views for --external and --decoded: ppm, pgx or ycbcr of 10 bit, or png.")
    ] = "ppm",
    pictures: Annotated[
        Path | None,
        typer.Option(help="Folder of photographs, or of `raytrace-ii render --set benchmark`; rendered if none."),
    ] = None,
    only: Annotated[
        str | None, typer.Option(help="Some pictures of the profile, such as flowers,toys; all by default.")
    ] = None,
    list_: Annotated[
        bool, typer.Option("--list", help="List the pictures of the profile, and where photographs are had.")
    ] = False,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="The result, .json.")] = None,
    workers: Annotated[int | None, typer.Option(help="Points measured at a time, in threads; 1 by default.")] = None,
    dask: Dask = None,
    plugin: Plugins = None,
    force: Force = False,
) -> None:
    """Run a coder, or external commands, on the pictures of a benchmark.

    Every point is written when it is measured. The same command continues a run that failed or was stopped.
    """
    from metrics.benchmark.anchors import ANCHORS
    from metrics.benchmark.profile import profile as profile_of
    from metrics.benchmark.profile import profile_names
    from metrics.benchmark.result import run, write_result
    from metrics.benchmark.run_log import RunLog
    from metrics.rates.rd import identity

    from .benchmark_coders import coder_of
    from .benchmark_pictures import listing, rendered, stored

    load_plugins(plugin)
    if anchor == "list":
        columns({name: one.about for name, one in ANCHORS.items()})
        return
    if profile is None:
        columns(profile_names())
        return
    check_cluster(workers, dask, plugin)
    defined = profile_of(profile)
    if only is not None:
        defined = defined.only(only.split(","))
    if list_:
        for line in listing(defined, pictures):
            say(line)
        return
    if output is None:
        raise ValueError("output is missing: -o result.json is needed")
    check_outputs([output], force)
    coder, tools = coder_of(defined, scheme, anchor, external, decoded, name, views)
    made = rendered if pictures is None else stored(defined, pictures)
    if (named := tools.pop("named", None)) is not None:
        read = made

        def made(reference: Reference) -> Subject:
            return named(reference, read(reference))

    log = RunLog(output.with_suffix(".points.jsonl"), defined, coder, tools.get("commands"), restart=force)
    try:
        with (
            cluster(dask, identity) as executor,
            progress_bar(f"{defined.name} {defined.version}, {coder}") as progress,
        ):
            means = {"workers": workers or 1} if executor is None else {"executor": executor}
            result = run(defined, coder, made, progress=progress, log=log, means=means, **tools)
    except ValueError as error:
        kept = f"; finished points are in {log.path}, the same command continues" if log.path.exists() else ""
        raise ValueError(f"{error}{kept}") from error
    write_result(output, result)
    log.remove()
    changed = [row["name"] for row in result["pictures"] if row["as_defined"] is False]
    if changed:
        say(f"not the pixels of the definition: {', '.join(changed)}; such results are ranked among themselves alone")
    points = [point for row in result["pictures"] for point in row["points"]]
    say_done(f"{output}: {coder} meets {sum(p['reached'] for p in points)} of {len(points)} targets")


@app.command()
def ranking(
    profile: Annotated[str, typer.Argument(help="The profile of all results.")],
    results: Annotated[list[Path], typer.Argument(help="Results of `raytrace-ii benchmark`.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="The page, .md; beside it .csv, .tex and .svg.")],
    plugin: Plugins = None,
    force: Force = False,
) -> None:
    """Rank results of a benchmark on a page to hand out, with all numbers, a LaTeX table and a chart."""
    from metrics.benchmark.profile import profile as profile_of
    from metrics.benchmark.ranking import ranked
    from metrics.benchmark.ranking_page import page_paths, write_page
    from metrics.benchmark.result import read_result

    load_plugins(plugin)
    if output.suffix != ".md":
        raise ValueError(f"{output} is no Markdown page: .md is needed")
    defined = profile_of(profile)
    check_outputs(page_paths(output), force)
    read = [(str(path), read_result(path)) for path in results]
    write_page(output, defined, read)
    for place, row in enumerate(ranked(defined, [result for _, result in read]), 1):
        say(f"{place}  {row['coder']}  {row['met']} of {row['targets']} targets, {row['quality']:.2f}")

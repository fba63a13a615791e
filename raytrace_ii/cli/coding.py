"""Commands that code: schemes, encode, decode, extract."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .common import Force, app, check_outputs, check_unused, columns, image_file, picture_files
from .plugins import Plugins, load_plugins
from .progress import progress_bar, say_done, spinner
from .tables import print_table
from .words import say

TAKE_SCHEME = "si-h264"  # of a folder of frames, if none is given


@app.command()
def schemes(
    names: Annotated[list[str] | None, typer.Argument(help="Only these.")] = None,
    help_options: Annotated[bool, typer.Option("--help-options", help="List the options of each scheme.")] = False,
    plugin: Plugins = None,
) -> None:
    """List the coding schemes."""
    from codec import options, schemes

    load_plugins(plugin)
    known = schemes()
    asked = {name: options(name) for name in names or known}  # an unknown name is an error before any output
    if not help_options:
        columns({name: known[name] for name in asked})
        return
    for name, lines in asked.items():
        say(f"{name}: {known[name]}")
        columns({f"  {key}": text for key, text in lines.items()})


@app.command()
def encode(
    context: typer.Context,
    picture: Annotated[Path, typer.Argument(help="An II-picture with its sidecar, or a folder of frames.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="The coded file.")],
    scheme: Annotated[
        str | None,
        typer.Option(help="From `raytrace-ii schemes`, options after a colon; if not given, the best general one."),
    ] = None,
    bpp: Annotated[float | None, typer.Option(help="Target rate, bits per pixel.")] = None,
    qp: Annotated[int | None, typer.Option(help="Constant quantiser.")] = None,
    quality: Annotated[float | None, typer.Option(help="Quality on the scheme's own scale.")] = None,
    walk: Annotated[str, typer.Option(help="II-video: view-first, time-first or interleaved.")] = "view-first",
    span: Annotated[int, typer.Option(help="II-video: instants of a group of pictures, 0 for all.")] = 8,
    group: Annotated[int, typer.Option(help="II-video: views of a group of pictures, 0 for all.")] = 0,
    strip: Annotated[int, typer.Option(help="II-video, interleaved: views of a strip.")] = 4,
    rate_over: Annotated[str, typer.Option(help="II-video: meet --bpp over the take, or in each segment.")] = "take",
    plugin: Plugins = None,
    force: Force = False,
) -> None:
    """Code an II-picture, or a folder of frames as II-video."""
    from codec import Plan, encode, general_scheme
    from ii_core import IIPicture
    from ii_core.base.files import IMAGE_TYPES

    load_plugins(plugin)
    if output.suffix.lower() in IMAGE_TYPES:
        raise ValueError(f"{output} is a picture's name: .ii is needed")
    check_outputs([output], force)
    if picture.is_dir():
        from .take import encode_frames

        if quality is not None:
            raise ValueError(f"quality is {quality:g}: II-video is coded by --bpp or --qp")
        plan = Plan(walk=walk, span=span, group=group, strip=strip)
        encode_frames(picture, output, scheme or TAKE_SCHEME, plan, bpp=bpp, qp=qp, rate=rate_over)
        return
    check_unused(context, f"{picture} is one picture, which", "walk", "span", "group", "strip", "rate_over")
    if quality is not None and quality.is_integer():
        quality = int(quality)  # schemes of whole qualities
    original = IIPicture.load(picture)
    chosen = scheme is None
    scheme = scheme or general_scheme(original, bpp=bpp, qp=qp, quality=quality)
    with progress_bar(f"{scheme} codes {picture.name}", at_once=True) as report:
        coded = encode(original, scheme, bpp=bpp, qp=qp, quality=quality, progress=report)
    coded.save(output)
    runs = f" after {coded.runs} encoder runs" if coded.runs and coded.runs > 1 else ""
    by = f" by {scheme}, the best general scheme for this picture" if chosen else ""
    say_done(f"{output}: {coded.nbytes} bytes, {coded.bpp:.4g} bpp{runs}{by}")
    if not coded.reached:
        say(f"{scheme} cannot reach {bpp:g} bpp with this picture: the nearest rate is {coded.bpp:.4g} bpp")


@app.command()
def decode(
    coded: Annotated[Path, typer.Argument(help="A file from `raytrace-ii encode`.")],
    output: Annotated[Path, typer.Option("-o", "--output", help=".png or .tif; a folder for all frames of a take.")],
    component: Annotated[
        str | None,
        typer.Option(help="Decode one component image only: u,v of SIs, k,l of EIs, v,l of RIs."),
    ] = None,
    max_pixels: Annotated[
        int | None, typer.Option(help="Largest number of pixels to decode, 2^27 by default; bounds memory.")
    ] = None,
    frame: Annotated[int | None, typer.Option(help="Decode only this frame of a take, from 0.")] = None,
    partial: Annotated[
        bool, typer.Option("--partial", help="Decode the frames before the damage of a truncated or damaged take.")
    ] = False,
    plugin: Plugins = None,
    force: Force = False,
) -> None:
    """Decode an II-picture, one component image of it, or the frames of a take."""
    from codec import Encoded, decode, decode_component, is_take
    from ii_core.base.files import check_file, write_image

    load_plugins(plugin)
    check_file(coded)
    limit = {} if max_pixels is None else {"max_pixels": max_pixels}
    if is_take(coded):
        from .take import decode_frames

        place = None if component is None else _place(component)
        decode_frames(coded, output, frame, place, force, {"partial": partial, **limit})
        return
    if partial or frame is not None:
        raise ValueError(f"{coded} is one picture: --frame and --partial are for takes")
    stream = Encoded.load(coded)
    files = picture_files if component is None else image_file
    check_outputs(files(output, stream.dtype), force)
    with progress_bar(f"decode {coded.name}", at_once=True) as report:
        if component is None:
            decode(stream, **limit, progress=report).save(output)
        else:
            write_image(output, decode_component(stream, _place(component)))
    say_done(f"{output}: {stream.scheme} at {stream.bpp:.4g} bpp")


@app.command()
def extract(
    coded: Annotated[Path, typer.Argument(help="A file from `raytrace-ii encode`.")],
    output: Annotated[
        Path,
        typer.Option("-o", "--output", help="A video or picture file, by scheme .mkv, .mp4, .obu, .jp2, …"),
    ],
    plugin: Plugins = None,
    force: Force = False,
) -> None:
    """Extract the coded stream into a file for other programs, without coding it again."""
    from codec import Encoded, extract
    from ii_core.base.files import check_file

    load_plugins(plugin)
    check_file(coded)
    check_outputs([output], force)
    stream = Encoded.load(coded)
    with spinner(f"extract {coded.name}"):
        shown = extract(stream, output)
    say_done(f"{output}: {output.stat().st_size} bytes around {len(stream.payload)} of {stream.scheme}, {shown}")


def _place(text: str) -> tuple[int, int]:
    try:
        a, b = (int(part) for part in text.split(","))
    except ValueError:
        raise ValueError(f"component is {text!r}: two whole numbers as in 3,4 are needed") from None
    return a, b


def study_orders(path: Path, folder: Path, force: bool) -> None:
    """Write NAME_orders.json and print its table of correlation and residuals by order."""
    from codec import analyse_orders
    from ii_core import IIPicture
    from ii_core.base.files import write_json
    from metrics import provenance

    numbers = folder / f"{path.stem}_orders.json"
    check_outputs([numbers], force, make_folder=True)
    with spinner(f"analyse {path.name}"):
        rows = [analysis.to_json() for analysis in analyse_orders(IIPicture.load(path))]
    write_json(numbers, {**provenance(), "picture": path.name, "rows": rows})
    table = [
        {
            "images": row["kind"], "order": row["order"], "frames": str(row["frames"]),
            "mean c": f"{row['correlation_mean']:.4f}", "σ of c": f"{row['correlation_sigma']:.4f}",
            "undefined": str(row["undefined"]), "e": f"{row['energy']:.4g}",
            "e a sample": f"{row['energy_per_sample']:.1f}",
        }
        for row in rows
    ]  # fmt: skip
    print_table(f"{path.stem}: consecutive frames; e is the mean energy of their difference", table, names=2)

"""The command ``raytrace-ii``: render, code, measure and study II-pictures.

The only module that reaches every package; it does so inside its functions, so that help comes at once.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from ii_core import IIPicture

    from .render import Shot

app = typer.Typer(
    help="Integral imaging: synthesize, code and evaluate 3-D pictures.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

Force = Annotated[bool, typer.Option("--force", help="Replace files that are there already.")]
Workers = Annotated[int | None, typer.Option(help="Threads; as many as cores if not given.")]

RATES = (0.02, 0.05, 0.15, 0.4, 1.0)
SCHEMES = ("si-h264", "ei-h264", "ri-h264", "jpeg2000")
STUDY_SUFFIXES = ("_rd.json", "_rd.csv", "_rd.png")


@app.command()
def scenes() -> None:
    """List the scenes that come with the package."""
    from .load import scene_names

    _columns(scene_names())


@app.command()
def cameras() -> None:
    """List the cameras."""
    from ii_core import camera_names

    _columns(dict(sorted(camera_names().items())))


@app.command()
def schemes() -> None:
    """List the coding schemes."""
    from codec import schemes

    _columns(schemes())


@app.command()
def camera(
    name: Annotated[str, typer.Argument(help="A camera's name, or a .json file.")] = "",
    output: Annotated[Path | None, typer.Option("-o", "--output", help="A folder for L and D maps.")] = None,
    scale: Annotated[int, typer.Option(help="Divides the number of lenses.")] = 1,
    format: Annotated[str, typer.Option(help="Of the maps: png16, png8, exr or hdr.")] = "png16",
    report: Annotated[
        bool, typer.Option("--report", help="Print what the camera can do, and what limits it.")
    ] = False,
    solve: Annotated[str | None, typer.Option(help="Find what is missing: pitch=0.39,gap=0.73,pixel=0.0061")] = None,
    force: Force = False,
) -> None:
    """Store a camera as L and D maps, report on it, or solve for a missing measure."""
    from ii_core import preset_cameras, write_maps
    from ii_core.maps import check_format

    check_format(format)
    if solve is not None:
        _print_solution(solve)
        return
    if not name:
        raise ValueError("no camera is named: see raytrace-ii cameras")
    arrays = preset_cameras(name, scale=scale)
    if output is None or report:
        from ii_core.properties import report as describe

        print("\n\n".join(describe(array) for array in arrays))
    if output is not None:
        _check_output(output / "camera.json", force, make_folder=True)
        with progress_bar(f"write {output}") as tell:
            write_maps(arrays, output, format=format, progress=lambda done, total: tell(done, total, ""))


MEASURES = {
    "pitch": "lens_pitch_mm",
    "gap": "gap_mm",
    "pixel": "pixel_pitch_mm",
    "ei": "ei_pixels",
    "angle": "view_angle_deg",
}


def _print_solution(text: str) -> None:
    from ii_core.properties import solve

    given: dict[str, Any] = {}
    for item in text.split(","):
        key, _, value = item.partition("=")
        try:
            given[MEASURES[key.strip()]] = float(value)
        except (KeyError, ValueError):
            raise ValueError(f"{item!r} is no measure: {', '.join(MEASURES)} = number are known") from None
    _columns({key: f"{value:.6g}" for key, value in solve(**given).items()})


@app.command()
def render(
    scene: Annotated[str, typer.Argument(help="A scene's name, or a .toml file.")],
    output: Annotated[Path, typer.Option("-o", "--output", help=".png, .tif (8 or 16 bit) or .exr (linear float).")],
    camera: Annotated[str, typer.Option(help="A camera's name, a .json file, or a folder of maps.")] = "setup1",
    scale: Annotated[int, typer.Option(help="Divides the number of lenses, at the same pixels per lens.")] = 1,
    at: Annotated[str | None, typer.Option(help="Where the camera stands in the scene, mm: x,y,z.")] = None,
    samples: Annotated[int, typer.Option(help="Rays per pixel.")] = 1,
    seed: Annotated[int, typer.Option(help="Of samples and noise.")] = 0,
    noise: Annotated[float, typer.Option(help="σ of sensor noise, in steps of 8 bits.")] = 0.0,
    bits: Annotated[int, typer.Option(help="8 or 16, for .png and .tif.")] = 8,
    depth: Annotated[Path | None, typer.Option(help="Write z in mm to this .exr.")] = None,
    normal: Annotated[Path | None, typer.Option(help="Write unit normals to this .exr.")] = None,
    object_id: Annotated[Path | None, typer.Option(help="Write object numbers to this .exr, −1 for none.")] = None,
    projection: Annotated[Path | None, typer.Option(help="Write what a 2D camera sees to this .png.")] = None,
    workers: Workers = None,
    force: Force = False,
) -> None:
    """Ray trace a scene through a camera.

    A camera of one lens stands back and gives its picture upright. A camera of several pixel arrays gives as many
    pictures, numbered.
    """
    from .load import load_scene

    wanted = {"depth": depth, "normal": normal, "object_id": object_id}
    extra = {name: path for name, path in wanted.items() if path is not None}
    if bits not in (8, 16):
        raise ValueError(f"bits is {bits}: 8 or 16 is needed")
    dtype = "float32" if output.suffix == ".exr" else f"uint{bits}"
    arrays = _cameras(camera, scale)
    poses = [_pose(array, at) for array in arrays]
    names = [_numbered(len(arrays), i) for i in range(len(arrays))]
    for numbered in names:
        _check_picture(numbered(output), dtype, force)
        for path in extra.values():
            _check_picture(numbered(path), "float32", force)
    if projection:
        _check_picture(projection, "uint8", force)
    loaded = load_scene(scene)
    options = {"samples": samples, "seed": seed, "noise": noise, "dtype": dtype, "workers": workers}
    for array, pose, numbered in zip(arrays, poses, names, strict=True):
        shot = _shoot(loaded, array, numbered(output).stem, pose=pose, support=tuple(extra), **options)
        with spinner(f"write {numbered(output)}"):
            _save_shot(shot, numbered(output), {name: numbered(path) for name, path in extra.items()})
        _say_stats(shot)
    if projection:
        _save_projection(loaded, arrays[0], projection, workers)


def _cameras(name: str, scale: int) -> Sequence[Any]:
    """The pixel arrays of a camera: by name, from a file, or from a folder of maps."""
    from ii_core import preset_cameras, read_maps

    if not Path(name).is_dir():
        return preset_cameras(name, scale=scale)
    if scale != 1:
        raise ValueError(f"scale is {scale}: maps have the size they have")
    return read_maps(name)


def _pose(camera: Any, at: str | None) -> Any:
    """Where a camera stands: where it is told, or, if it has but one lens, where z = 0 fills its picture."""
    import numpy as np

    from ii_core import stand_back

    if at is None:
        return stand_back(camera.model) if camera.lenses == (1, 1) and camera.model else None
    pose = np.eye(4)
    try:
        pose[:3, 3] = [float(x) for x in at.split(",")]
    except ValueError:
        raise ValueError(f"at is {at!r}: three numbers x,y,z are needed") from None
    return pose


def _numbered(count: int, i: int) -> Callable[[Path], Path]:
    return lambda path: path if count == 1 else path.with_name(f"{path.stem}_{i}{path.suffix}")


def _shoot(scene: Any, camera: Any, title: str, **options: Any) -> Shot:
    from .render import render

    with progress_bar(f"render {title}") as report:
        return render(scene, camera, progress=lambda done, total: report(done, total, ""), **options)


def _save_shot(shot: Shot, output: Path, extra: dict[str, Path]) -> None:
    """The picture and its support images, upright if the camera has but one lens."""
    import numpy as np

    from ii_core import orthoscopic
    from ii_core.files import write_image

    flat = shot.picture.lenses == (1, 1)
    (orthoscopic(shot.picture) if flat else shot.picture).save(output)
    for name, path in extra.items():
        image = getattr(shot, name).astype(np.float32)
        write_image(path, image[::-1, ::-1] if flat else image)


def _save_projection(scene: Any, camera: Any, path: Path, workers: int | None) -> None:
    from ii_core import orthoscopic, projection_camera
    from ii_core.files import write_image

    if camera.model is None:
        raise ValueError("the maps do not say what camera they are of: there is no 2D projection to match")
    pinhole, pose = projection_camera(camera.model, 1024)
    view = _shoot(scene, pinhole, path.stem, samples=4, pose=pose, support=(), workers=workers)
    write_image(path, orthoscopic(view.picture).pixels)


@app.command()
def encode(
    picture: Annotated[Path, typer.Argument(help="An II-picture with its sidecar.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="The coded file.")],
    scheme: Annotated[str, typer.Option(help="As in `raytrace-ii schemes`, options after a colon.")] = "si-h264",
    bpp: Annotated[float | None, typer.Option(help="Bits per pixel to aim at.")] = None,
    qp: Annotated[int | None, typer.Option(help="Quantiser to keep.")] = None,
    force: Force = False,
) -> None:
    """Code an II-picture."""
    from codec import encode
    from ii_core import IIPicture

    _check_output(output, force)
    original = IIPicture.load(picture)
    with spinner(f"{scheme} codes {picture.name}"):
        coded = encode(original, scheme, bpp=bpp, qp=qp)
    coded.save(output)
    print(f"{output}: {coded.nbytes} bytes, {coded.bpp:.4g} bpp in {coded.encode_seconds:.1f} s")
    if not coded.reached:
        print(f"{scheme} cannot reach {bpp:g} bpp with this picture: {coded.bpp:.4g} is as near as it comes")


@app.command()
def decode(
    coded: Annotated[Path, typer.Argument(help="A file that `encode` wrote.")],
    output: Annotated[Path, typer.Option("-o", "--output", help=".png or .tif.")],
    force: Force = False,
) -> None:
    """Decode an II-picture."""
    from codec import decode

    _check_picture(output, "uint8", force)
    with spinner(f"decode {coded.name}"):
        picture = decode(coded)
    picture.save(output)


@app.command()
def regular(
    picture: Annotated[Path, typer.Argument(help="An II-picture of a hexagonal, non-integer or shifted structure.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="The same as a regular one.")],
    method: Annotated[
        str, typer.Option(help="rectangle (no pixel changes) or resample (centred on lenses).")
    ] = "resample",
    mask: Annotated[Path | None, typer.Option(help="Write which pixels a lens owns, white, to this .png.")] = None,
    force: Force = False,
) -> None:
    """Bring an II-picture to a regular structure, which coding and views need."""
    import numpy as np

    from ii_core import IIPicture, resampled, smallest_rectangle
    from ii_core.files import image_types, write_image

    methods = {"rectangle": smallest_rectangle, "resample": resampled}
    if method not in methods:
        raise ValueError(f"unknown method {method!r}: known are {', '.join(methods)}")
    image_types(output)
    _check_output(output, force)
    if mask:
        _check_picture(mask, "uint8", force)
    with spinner(f"{method} {picture.name}"):
        made, owned = methods[method](IIPicture.load(picture))
        made.save(output)
        if mask:
            write_image(mask, owned.astype(np.uint8) * 255)
    (k, l), (u, v) = made.lenses, made.ei_pixels
    print(f"{output}: {k}×{l} lenses of {u}×{v} px, {owned.mean():.1%} of the pixels owned by their lens")


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
        _check_output(json, force)
    if plots:
        from metrics import PLOTS, plot_all

        for name in PLOTS:
            _check_output(plots / name, force, make_folder=True)
    a, b = IIPicture.load(reference), _picture(decoded)
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
    _columns(rows)


def _depth_quality(a: IIPicture, b: IIPicture, depth: Path | None) -> Any:
    """Q_depth over a given depth map or, where the structure allows, over one estimated; else None."""
    from ii_core.files import read_image
    from metrics import q_depth

    if depth is not None:
        return q_depth(a, b, depth=read_image(depth)[..., 0])
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
    workers: Workers = None,
    force: Force = False,
) -> None:
    """Chart quality against rate for several schemes."""
    from codec import parse_scheme
    from ii_core import IIPicture

    names = [name.replace(";", ",") for name in schemes.split(",")]
    for name in names:
        parse_scheme(name)  # a misspelt one is found before anything is made
    try:
        targets = [float(rate) for rate in rates.split(",")]
    except ValueError:
        raise ValueError(f"rates are {rates!r}: numbers parted by commas are needed") from None
    for suffix in STUDY_SUFFIXES:
        _check_output(output / f"{picture.stem}{suffix}", force, make_folder=True)
    original = IIPicture.load(picture)
    run_study(original, picture.stem, names, targets, output, workers=workers)


def run_study(
    picture: IIPicture, name: str, schemes: Sequence[str], rates: Sequence[float], folder: Path, *,
    workers: int | None = None, extra: dict[str, Any] | None = None,
) -> None:  # fmt: skip
    """Measure; leave name_rd.json, .csv and, drawn from the JSON, .png in a folder; print a table."""
    from codec import decode, encode
    from metrics import rate_distortion, rd_chart, read_study, write_csv, write_study

    from .render import cores

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


def _picture(path: Path) -> IIPicture:
    """An II-picture, or the one in a coded file."""
    from ii_core import IIPicture
    from ii_core.files import IMAGE_TYPES

    if path.suffix in IMAGE_TYPES:
        return IIPicture.load(path)
    from codec import decode

    return decode(path)


def _check_picture(path: Path, dtype: str, force: bool) -> None:
    """Raise, before any work, unless a picture of this type can be written there."""
    from ii_core.files import image_types

    if dtype not in image_types(path):
        raise ValueError(f"{path} cannot hold {dtype} pixels: {path.suffix} takes {', '.join(image_types(path))}")
    _check_output(path, force)


def _check_output(path: Path, force: bool, *, make_folder: bool = False) -> None:
    """Raise, before any work, unless a file can be written there without losing another."""
    if make_folder:
        path.parent.mkdir(parents=True, exist_ok=True)
    if not path.parent.is_dir():
        raise FileNotFoundError(f"cannot write {path}: {path.parent} is no folder")
    if not os.access(path.parent, os.W_OK):
        raise PermissionError(f"cannot write {path}: {path.parent} cannot be written")
    if path.exists() and not force:
        raise FileExistsError(f"{path} is there already: --force replaces it")


def _columns(rows: dict[str, str]) -> None:
    """Names and what they are, in two columns."""
    width = max(map(len, rows), default=0)
    for name, text in rows.items():
        print(f"{name:<{width}}  {text}")


def _say_stats(shot: Shot) -> None:
    s = shot.stats
    counts = ", ".join(f"{count / 1e6:.2f} M {kind}" for kind, count in s.rays.items() if count)
    print(f"{counts} rays in {s.seconds:.1f} s, {s.embree_seconds:.1f} s of {s.cpu_seconds:.1f} CPU s inside Embree")


@contextmanager
def progress_bar(title: str) -> Iterator[Callable[[int, int, str], None]]:
    """A bar on the terminal's error stream; yields what to call with done, total and a word on the last step."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    bar = Progress(*columns, TextColumn("{task.fields[step]}"), console=Console(stderr=True))
    task = bar.add_task(title, total=None, step="")

    def report(done: int, total: int, step: str) -> None:
        bar.start()  # only now: what fails before its first step leaves no empty bar
        bar.update(task, completed=done, total=total, step=step)

    try:
        yield report
    finally:
        if bar.live.is_started:
            bar.stop()


@contextmanager
def spinner(title: str) -> Iterator[None]:
    """A sign of life on the terminal's error stream, for work whose steps cannot be counted."""
    from rich.console import Console

    with Console(stderr=True).status(title):
        yield


def main() -> None:
    """Run the command; a bad input is one line on the error stream and exit code 2."""
    try:
        code = app(standalone_mode=False)
        sys.exit(code if isinstance(code, int) else 0)
    except (ValueError, OSError, MemoryError) as error:
        _fail(str(error) or type(error).__name__)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        sys.exit(130)
    except typer.Abort:
        sys.exit(130)
    except Exception as error:
        # A wrong option or argument: typer's own complaint, without its frame.
        if not hasattr(error, "format_message"):
            raise
        _fail(error.format_message())


def _fail(message: str) -> None:
    print(f"error: {' '.join(message.split())}", file=sys.stderr)
    sys.exit(2)


if __name__ == "__main__":
    main()

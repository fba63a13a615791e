"""The command render: one scene, or a set of scenes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .cluster import Dask, cluster
from .common import (
    Force,
    Workers,
    app,
    check_only,
    check_outputs,
    check_unused,
    grouped,
    image_file,
    picture_files,
)
from .progress import progress_bar, say_done

if TYPE_CHECKING:
    from ..rendering.render import Stats
    from ..scene.scene import Scene

Exr = Path | None


@dataclass(frozen=True, kw_only=True)
class Motion:
    """Options of a moving scene."""

    frames: Annotated[
        str, typer.Option(help="Frames of a moving scene: 5, 0..47 or all; the output is a folder.")
    ] = ""
    clip: Annotated[str, typer.Option(help="Name of the animation in a glTF file.")] = ""
    fps: Annotated[float | None, typer.Option(help="Frames per second, in place of the file's.")] = None


@dataclass(frozen=True, kw_only=True)
class Placing:
    """Options of how a mesh file stands in the scene."""

    rotate: Annotated[str, typer.Option(help="Rotation of a mesh file about x, then y, then z, degrees: x,y,z.")] = (
        "0,0,0"
    )
    fit: Annotated[str, typer.Option(help="Names of a mesh file's parts that fill the picture, such as 'head*'.")] = (
        "*"
    )

    def options(self) -> dict[str, Any]:
        """Return what a scene or take is loaded with, by name."""
        return {"rotate_deg": _floats("rotate", self.rotate, 3, 3), "fit": self.fit}


@dataclass(frozen=True, kw_only=True)
class Photograph:
    """Options of a picture with depth in place of a scene."""

    rgbd: Annotated[
        tuple[Path, Path] | None,
        typer.Option(help="A picture and its depth map (.exr, .pfm, .png) as a scene."),
    ] = None
    field_deg: Annotated[float, typer.Option(help="Horizontal angle of view of its camera.")] = 60.0
    inverse: Annotated[
        float | None,
        typer.Option(help="The map is 1/z without a scale: the darkest is so many times as far as the brightest."),
    ] = None

    def scene(self) -> Scene:
        """Return the scene of the files."""
        from ..files.rgbd import read_rgbd

        assert self.rgbd is not None
        return read_rgbd(*self.rgbd, field_deg=self.field_deg, inverse=self.inverse)


@dataclass(frozen=True, kw_only=True)
class Place:
    """Options of where the camera stands."""

    at: Annotated[str | None, typer.Option(help="Position of the camera in the scene, mm: x,y,z.")] = None
    look_at: Annotated[str | None, typer.Option(help="Scene point on the axis of the camera, mm: x,y,z.")] = None
    up: Annotated[str | None, typer.Option(help="Direction of the camera's top, such as 0,1,0.")] = None
    turn: Annotated[
        str | None, typer.Option(help="Rotation after look-at, degrees: right, or right,up or right,up,clockwise.")
    ] = None

    def pose(self, camera: Any) -> Any:
        """Return the pose: as given; by default z = 0 fills the picture of a camera of one lens."""
        from ii_core import camera_pose, stand_back

        usual = stand_back(camera.model) if camera.lenses == (1, 1) and camera.model else None
        if self.at is self.look_at is self.up is self.turn is None:
            return usual
        usual_place = (0.0, 0.0, 0.0) if usual is None else usual[:3, 3]
        turns = _floats("turn", self.turn, 1, 3) if self.turn is not None else []
        return camera_pose(
            usual_place if self.at is None else _floats("at", self.at, 3, 3),
            look_at_mm=None if self.look_at is None else _floats("look-at", self.look_at, 3, 3),
            up=(0.0, 1.0, 0.0) if self.up is None else _floats("up", self.up, 3, 3),
            turn_deg=turns + [0.0] * (3 - len(turns)),
        )


@dataclass(frozen=True, kw_only=True)
class Sampling:
    """Options of the samples of pixels."""

    samples: Annotated[str, typer.Option(help="Rays per pixel, 4..64 (adaptive, powers of 2), or edges [1].")] = ""
    error: Annotated[
        float | None,
        typer.Option(help="Target error of a pixel in 8-bit steps [0.5]; alone it means edges."),
    ] = None
    seed: Annotated[int, typer.Option(help="Seed of samples and noise.")] = 0
    noise: Annotated[float, typer.Option(help="σ of sensor noise, in 8-bit steps.")] = 0.0
    texture_filter: Annotated[
        bool, typer.Option(help="Read image textures over a ray's width; --no-texture-filter reads them at a point.")
    ] = True
    audit: Annotated[
        float, typer.Option(help="Share of pixels to render again in full, such as 0.001, to measure the error.")
    ] = 0.0
    bits: Annotated[int, typer.Option(help="Bits per channel: 8, or 16 for .png and .tif.")] = 8

    def check(self, one_picture: bool) -> None:
        """Raise ValueError for another number of bits than 8 and 16, and for an audit of several pictures."""
        if self.bits not in (8, 16):
            raise ValueError(f"bits is {self.bits}: 8 or 16 is needed")
        if self.audit and not one_picture:
            raise ValueError("--audit is of one picture: without --frames and --set")

    def options(self) -> dict[str, Any]:
        """Return what all ways to render take, by name."""
        samples = _samples(self.samples, self.error)
        return {**samples, "seed": self.seed, "noise": self.noise, "texture_filter": self.texture_filter}


@dataclass(frozen=True, kw_only=True)
class Images:
    """Options of files beside the picture."""

    support: Annotated[Exr, typer.Option(help="Write all support images to this .exr, as named channels.")] = None
    depth: Annotated[Exr, typer.Option(help="Write z in mm from the pixel plane to this .exr.")] = None
    ray_length: Annotated[Exr, typer.Option(help="Write ray length in mm from the lens to this .exr.")] = None
    disparity: Annotated[Exr, typer.Option(help="Write disparity in pixels between lenses to this .exr.")] = None
    normal: Annotated[Exr, typer.Option(help="Write unit normals of the faces to this .exr.")] = None
    shading_normal: Annotated[Exr, typer.Option(help="Write unit shading normals to this .exr.")] = None
    object_id: Annotated[Exr, typer.Option(help="Write object numbers to this .exr, −1 for none.")] = None
    coverage: Annotated[Exr, typer.Option(help="Write objects' shares of pixels to this .exr, a cryptomatte.")] = None
    projection: Annotated[Path | None, typer.Option(help="Write the picture of a 2-D camera to this .png.")] = None

    @property
    def single(self) -> dict[str, Path]:
        """Files of single support images, by their name."""
        names = ("depth", "ray_length", "disparity", "normal", "object_id", "shading_normal", "coverage")
        return {name: path for name in names if (path := getattr(self, name)) is not None}

    @property
    def files(self) -> list[Path]:
        """Files of support images, which may share one."""
        return list(dict.fromkeys([*self.single.values(), *([self.support] if self.support else [])]))


@dataclass(frozen=True, kw_only=True)
class Means:
    """Options of where the work is done."""

    workers: Workers = None
    dask: Dask = None

    def check(self) -> None:
        """Raise ValueError for threads of this machine on a cluster."""
        if self.dask and self.workers is not None:
            raise ValueError("--workers is for threads of this machine: leave it out with --dask")


@dataclass(frozen=True, kw_only=True)
class Views:
    """Pixel arrays of a camera, and their poses in the scene."""

    arrays: Sequence[Any]
    poses: Sequence[Any]


@app.command()
@grouped
def render(
    *,
    context: typer.Context,
    output: Annotated[
        Path, typer.Option("-o", "--output", help=".png, .tif (8 or 16 bit) or .exr (linear float); a set's folder.")
    ],
    scene: Annotated[str, typer.Argument(help="A scene's name, or a .toml or mesh file.")] = "",
    set_name: Annotated[
        str, typer.Option("--set", help="Render a set instead: reference, benchmark or benchmark:PROFILE.")
    ] = "",
    camera: Annotated[
        str, typer.Option(help="A camera's name, a .json file, an II-picture, or a folder of maps.")
    ] = "setup1",
    scale: Annotated[int, typer.Option(help="Divides the number of lenses, at the same pixels per lens.")] = 1,
    photograph: Photograph,
    motion: Motion,
    placing: Placing,
    place: Place,
    sampling: Sampling,
    images: Images,
    spread: Annotated[
        str | None,
        typer.Option(help="Spread light by diffraction and defocus: auto, by the depth met, or a folder of maps."),
    ] = None,
    means: Means,
    force: Force = False,
) -> None:
    """Ray trace a scene, or a set of scenes, through a camera.

    The picture of a camera of one lens is upright, and fills z = 0. A camera of several pixel arrays gives numbered
    pictures. Pictures may be larger than memory. The same command continues an interrupted set.

    --frames renders a moving scene into a folder: frame_0000.png and so on, and support images as frame_0000_NAME.
    Unchanged frames are kept.
    """
    if bool(scene) + bool(set_name) + bool(photograph.rgbd) != 1:
        raise ValueError("one of a scene, --set and --rgbd is needed: `raytrace-ii scenes` lists scenes")
    if photograph.rgbd:
        check_unused(context, "a picture with depth", "rotate", "fit", "frames", "clip", "fps")
    else:
        check_unused(context, "a scene", "field_deg", "inverse")
    if set_name.partition(":")[0] == "benchmark":
        from .benchmark_pictures import render_profiles

        allowed = {"set_name", "output", "workers", "force"}
        check_only(context, "the profile of a benchmark defines its pictures", allowed)
        render_profiles(set_name.partition(":")[2], output, force, means.workers)
        return
    one_picture = not (set_name or motion.frames)
    sampling.check(one_picture)
    means.check()
    options = sampling.options()
    arrays = _cameras(camera, scale)
    views = Views(arrays=arrays, poses=[place.pose(array) for array in arrays])
    if spread is not None:
        from .spread import check_spread

        if not one_picture:
            raise ValueError("--spread is of one picture: without --frames and --set")
        check_spread(spread, arrays)
    if motion.frames:
        if set_name or images.projection or len(arrays) > 1:
            raise ValueError("--frames renders one scene through one pixel array, without --set and --projection")
        moving = {"clip": motion.clip or None, "fps": motion.fps, **placing.options()}
        options |= {"dtype": f"uint{sampling.bits}"}
        _render_frames(scene, moving, motion.frames, output, views, images, options, means, force)
    elif motion.clip or motion.fps is not None:
        raise ValueError("--clip and --fps are for moving scenes: --frames is needed")
    elif set_name:
        if images.files or images.projection:
            raise ValueError("a set includes all support images and projections: leave out their options")
        options |= {"bits": sampling.bits}
        check_unused(context, "a set of scenes", "rotate", "fit")
        _render_set(set_name, output, views, options, means, force)
    else:
        dtype = "float32" if output.suffix == ".exr" else f"uint{sampling.bits}"
        _check_files(output, dtype, len(arrays), images, force)
        options |= {"dtype": dtype, "audit": sampling.audit}
        from ..files.load import load_scene

        loaded = photograph.scene() if photograph.rgbd else load_scene(scene, **placing.options())
        _render_scene(loaded, output, views, images, options, means, spread)


def _render_frames(
    scene: str, moving: dict[str, Any], frames: str, folder: Path, views: Views, images: Images,
    options: dict[str, Any], means: Means, force: bool,
) -> None:  # fmt: skip
    """Render frames of a moving scene."""
    from ..rendering.executors import identity
    from .take import render_frames, support_files

    array = views.arrays[0]
    with cluster(means.dask, identity) as executor:
        options = {**options, "pose": views.poses[0], "workers": means.workers, "executor": executor}
        kinds = _all_support(array) if images.support else []
        support = support_files(kinds, images.support, images.single)
        render_frames(scene, moving, frames, folder, array, support, force, options)


def _check_files(output: Path, dtype: str, arrays: int, images: Images, force: bool) -> None:
    """Raise an error unless the files of one picture, or one of each pixel array, can be written."""
    if images.support is not None and images.support.suffix != ".exr":
        raise ValueError(f"{images.support}: only .exr has named channels")
    files = image_file(images.projection, "uint8")
    for i in range(arrays):
        numbered = _numbered(arrays, i)
        files += picture_files(numbered(output), dtype)
        files += [file for path in images.files for file in image_file(numbered(path), "float32")]
    check_outputs(files, force)


def _render_scene(
    scene: Scene, output: Path, views: Views, images: Images, options: dict[str, Any], means: Means,
    spread: str | None,
) -> None:  # fmt: skip
    """Render one scene through every pixel array, and its projection."""
    from ..rendering.executors import identity

    with cluster(means.dask, identity) as executor:
        how = {"workers": means.workers, "executor": executor}
        for i, (array, pose) in enumerate(zip(views.arrays, views.poses, strict=True)):
            numbered = _numbered(len(views.arrays), i)
            files = {name: [numbered(path)] for name, path in images.single.items()}
            for name in _all_support(array) if images.support else ():
                files.setdefault(name, []).append(numbered(images.support))  # type: ignore[arg-type]
            more = {"pose": pose, "upright": array.lenses == (1, 1), "support": files, **options, **how}
            path = numbered(output)
            shoot = partial(_shoot, scene=scene, camera=array)
            if spread is None:
                stats = shoot(path, **more)
            else:
                from .spread import shoot_spread

                stats = shoot_spread(shoot, path, array, i, spread, more)
            say_done(f"{path}: {_told(stats)}")
        if images.projection:
            _save_projection(scene, views.arrays[0], views.poses[0], images.projection, how)


def _all_support(array: Any) -> list[str]:
    from ..rendering.render_sets import support_images

    return support_images(array)


def _samples(samples: str, error: float | None) -> dict[str, Any]:
    """Return the number of samples, their range or edges, and the target error, of those that are given."""
    target = {} if error is None else {"error": error}
    if samples in ("", "edges"):
        return {"samples": samples or None, **target}
    least, dots, most = samples.partition("..")
    try:
        numbers = (int(least), int(most)) if dots else int(least)
    except ValueError:
        raise ValueError(f"samples is {samples!r}: a whole number, two like 4..64, or edges is needed") from None
    return {"samples": numbers, **target}


def _render_set(name: str, folder: Path, views: Views, options: dict[str, Any], means: Means, force: bool) -> None:
    from ..rendering.executors import identity
    from ..rendering.render_sets import SETS, render_set

    with cluster(means.dask, identity) as executor:
        if name not in SETS:
            raise ValueError(f"unknown set {name!r}: known are {', '.join(SETS)}")
        check_outputs([folder / "manifest.json"], True, make_folder=True)
        with progress_bar(f"render {name}") as report:
            manifest = render_set(
                name, folder, views.arrays, poses=views.poses, workers=means.workers, executor=executor, force=force,
                progress=lambda title, done, total: report(done, total, title), **options,
            )  # fmt: skip
    products = [p for entry in manifest["scenes"].values() for p in entry["products"].values()]
    seconds, rays = sum(p["seconds"] for p in products), sum(sum(p["rays"].values()) for p in products)
    about = f"{rays / 1e6:.1f} M rays, all rendered in {seconds:.1f} s"
    say_done(f"{folder}: {len(manifest['scenes'])} scenes, {about}")


def _cameras(name: str, scale: int) -> Sequence[Any]:
    """Return the pixel arrays of a camera by name, which comes first, from a file, or from a folder of maps."""
    from ii_core import camera_names, preset_cameras, read_maps
    from ii_core.camera.presets import ALIASES

    if name in {*camera_names(), *ALIASES} or not Path(name).is_dir():
        return preset_cameras(name, scale=scale)
    if scale != 1:
        raise ValueError(f"scale is {scale}: stored maps have a fixed size, leave --scale out")
    return read_maps(name)


def _floats(name: str, text: str, least: int, most: int) -> list[float]:
    """Return the numbers of a text separated by commas."""
    try:
        numbers = [float(x) for x in text.split(",")]
    except ValueError:
        numbers = []
    if not least <= len(numbers) <= most:
        needed = "three numbers x,y,z are" if least == most else "one to three numbers as in 20,-5 are"
        raise ValueError(f"{name} is {text!r}: {needed} needed")
    return numbers


def _numbered(count: int, i: int) -> Callable[[Path], Path]:
    return lambda path: path if count == 1 else path.with_name(f"{path.stem}_{i}{path.suffix}")


def _shoot(path: Path, scene: Any, camera: Any, **options: Any) -> Stats:
    from ..rendering.render import render_to

    with progress_bar(f"render {path.stem}") as report:
        return render_to(path, scene, camera, progress=lambda done, total: report(done, total, ""), **options)


def _save_projection(scene: Any, camera: Any, pose: Any, path: Path, means: dict[str, Any]) -> None:
    """Write a plain picture without a sidecar."""
    from ii_core import orthoscopic, projection_camera
    from ii_core.base.files import write_image

    from ..rendering.render import render as shot_of

    if camera.model is None:
        raise ValueError("the maps have no camera parameters: a 2-D projection needs them")
    pinhole, before = projection_camera(camera.model, 1024)
    pose = before if pose is None else pose @ before
    with progress_bar(f"render {path.stem}") as report:
        view = shot_of(
            scene, pinhole, samples=4, pose=pose, support=(), progress=lambda done, total: report(done, total, ""),
            **means,
        )  # fmt: skip
    write_image(path, orthoscopic(view.picture).pixels)


def _told(s: Stats) -> str:
    """Return the numbers of rays and the share of Embree in the CPU time, in words."""
    counts = ", ".join(f"{count / 1e6:.2f} M {kind}" for kind, count in s.rays.items() if count)
    spread = f" ({s.mean_samples:.1f} per pixel)" if len(s.samples) > 1 else ""
    weak = sum(s.skipped.values()) / 1e6
    left_out = f", {weak:.2f} M too weak to trace" if weak else ""
    audit = f"; {s.audit.about}" if s.audit else ""
    return f"{counts} rays{spread}{left_out}; {s.embree_seconds:.1f} of {s.cpu_seconds:.1f} CPU s in Embree{audit}"

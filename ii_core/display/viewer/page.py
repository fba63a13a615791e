"""Viewer page of an II-picture or II-video: one self-contained HTML file, or a folder for a web server.

The page holds the mosaic of sub-images (2.13) of each frame, cut into square pages. They become the layers of a
texture; its shader looks through the lenses as `ii_core.view_image` does (4.1), and focuses by shifting and adding.
"""

from __future__ import annotations

import base64
import html
import io
import json
import math
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any, TypedDict, Unpack

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ...base.files import atomic_path
from ...camera.camera import IICamera
from ...picture.assumed import ASSUMED, with_assumed_camera
from ...picture.picture import IIPicture, codes8
from ...picture.view import camera_of, five_viewpoints, lens_array_mm, view_image
from ...video.video import IIVideo, video_of
from ..policy import nonce_of, policy

PAGE_SIDE = 2048  # texture size that every WebGL2 supports
PREVIEW_SIDE = 512
MOST_LAYERS = 256  # number of texture layers that every WebGL2 supports
MAX_EMBEDDED = 256 << 20  # bytes of a page; browsers read no more in reasonable time
CARD_BYTES = 512 << 20  # budget for frames of a take on the graphics card, which holds at least two
JPEG_QUALITY = 95
FARTHEST = 250  # depth of the farthest focus, in gaps
MOST_SHIFT = 4.0  # lenses a pixel: range of focus without a camera, half of that of an array of cameras
SCRIPTS = ("lightfield.js", "take.js", "viewer.js")
TAKE_FILE = "take.pages"  # file in a folder with the pages of all frames of a take; browsers request parts of it
Rows = Sequence[tuple[str, str]]
Shown = IIPicture | IIVideo


class ViewerOptions(TypedDict, total=False):
    """Keywords of `write_viewer` and `write_viewer_folder`.

    Attributes
    ----------
    depth : ndarray, (N, M), optional
        z in mm of every pixel, from `raytrace_ii.render`: clicks focus by it instead of by the picture. Not for an
        II-video.
    title : str
        Title shown.
    quality : int or None
        Quality of JPEG pages (4:4:4), 1 to 100, 95 if not given; None for lossless WebP, four times as large as 95.
    quality_rows : sequence of (str, str)
        Names and values of a table beside the picture, such as ``("Q_global", "31.20 dB")``.
    labels : (str, str)
        Labels of the halves of a split view, such as ``("original", "si-h264, 0.10 bpp, 31.20 dB")``.
    """

    depth: NDArray[Any] | None
    title: str
    quality: int | None
    quality_rows: Rows
    labels: tuple[str, str]


def write_viewer(
    path: str | os.PathLike[str],
    picture: Shown,
    decoded: Shown | None = None,
    *,
    progress: Callable[[int, int], None] | None = None,
    **options: Unpack[ViewerOptions],
) -> int:
    """Write one self-contained HTML file, which opens from disk in a browser with WebGL2.

    Parameters
    ----------
    path : path
        The page; replaced whole.
    picture : IIPicture or IIVideo
        Of a regular structure. 16 bits and floats are shown as 8-bit sRGB. Frames are read one at a time.
    decoded : IIPicture or IIVideo, optional
        Of the same structure and number of frames, to compare it with.
    progress : callable, optional
        Called with the number of pages done and of all pages.
    **options : ViewerOptions
        Depth map, title, quality, table and labels.

    Returns
    -------
    int
        Bytes written.

    Raises
    ------
    ValueError
        If the structures or numbers of frames do not match, the depth map has another size, or the page would be
        larger than `MAX_EMBEDDED`; for a video, the first frame decides this.
    OSError
        If the file cannot be written.
    """
    page = _Page(picture, decoded, **options)
    used = 0
    with atomic_path(path) as temporary, temporary.open("w", encoding="utf-8") as file:
        head, tail = page.html("\x00", served=False).split("\x00")
        file.write(head)
        for kind, where, data in page.parts(progress):
            used += 4 * len(data) // 3
            if used * (1 if where[2:] > (0,) else page.frames) > MAX_EMBEDDED:
                raise ValueError(
                    f"{path} would be larger than {MAX_EMBEDDED >> 20} MB, the most a page can hold: --serve shows "
                    f"{page.what} of {picture.size[0]}×{picture.size[1]} px without one"
                )
            arguments = "".join(f"{n}, " for n in where)
            file.write(
                f'<script nonce="{page.nonce}">ii.{kind}({arguments}"{base64.b64encode(data).decode()}")</script>\n'
            )
        file.write(f'<script nonce="{page.nonce}">ii.done()</script>' + tail)
    return Path(path).stat().st_size


def write_viewer_folder(
    folder: str | os.PathLike[str],
    picture: Shown,
    decoded: Shown | None = None,
    *,
    progress: Callable[[int, int], None] | None = None,
    **options: Unpack[ViewerOptions],
) -> None:
    """Write the page as index.html with its data in files beside it, for a web server; see `write_viewer`.

    All pages of a video are in one file; the browser requests the bytes of one frame at a time. A server without
    range requests sends the whole file each time.
    """
    page = _Page(picture, decoded, **options)
    order: list[list[Any]] = []
    with (Path(folder) / TAKE_FILE).open("wb") if page.frames > 1 else nullcontext() as take:
        for number, (kind, where, data) in enumerate(page.parts(progress)):
            if take is not None and kind == "page":
                order.append([kind, TAKE_FILE, *where, take.tell(), take.tell() + len(data)])
                take.write(data)
                continue
            name = f"{number}.{kind}"
            (Path(folder) / name).write_bytes(data)
            order.append([kind, name, *where])
    text = page.html(f'<script nonce="{page.nonce}">ii.fetch({json.dumps(order)})</script>', served=True)
    with atomic_path(Path(folder) / "index.html") as temporary:
        temporary.write_text(text, encoding="utf-8")


class _Page:
    """Contents of one page, validated."""

    def __init__(
        self,
        shown: Shown,
        decoded: Shown | None,
        depth: NDArray[Any] | None = None,
        title: str = "",
        quality: int | None = JPEG_QUALITY,
        quality_rows: Rows = (),
        labels: tuple[str, str] = ("original", "decoded"),
    ) -> None:
        self.videos = [
            item if isinstance(item, IIVideo) else video_of([item]) for item in (shown, decoded) if item is not None
        ]
        self.frames = self.videos[0].frames
        self.structure = picture = self.videos[0].structure
        self.what = "the picture" if self.frames == 1 else f"the take of {self.frames} frames"
        picture.check_regular()
        for video in self.videos[1:]:
            picture.check_same_structure(video.structure)
            if video.frames != self.frames:
                raise ValueError(f"decoded has {video.frames} frames, {self.what}: the same number is needed")
        if quality is not None and not 1 <= quality <= 100:
            raise ValueError(f"quality is {quality}: a whole number from 1 to 100 is needed")
        if depth is not None and self.frames > 1:
            raise ValueError("depth is the map of one picture: leave it out for a take")
        if depth is not None and depth.shape != picture.pixels.shape[:2]:
            raise ValueError(
                f"depth is {depth.shape}, the picture {picture.pixels.shape[:2]}: the same size is needed"
            )
        self.depth = None if depth is None else depth_view(picture, depth)
        self.title, self.jpeg, self.quality_rows = title or "II-picture", quality, quality_rows
        self.labels = labels
        (k, l), (u, v) = picture.lenses, picture.ei_pixels
        self.side = min(PAGE_SIDE, max(k * u, l * v))
        self.grid = -(-(k * u) // self.side), -(-(l * v) // self.side)
        if math.prod(self.grid) > MOST_LAYERS:
            raise ValueError(
                f"a picture of {k * u}×{l * v} px fills {math.prod(self.grid)} texture layers: "
                f"browsers support {MOST_LAYERS} of {self.side}×{self.side} px at least"
            )

    @property
    def nonce(self) -> str:
        """Value that marks the scripts and styles of this page."""
        return nonce_of(self.title, *self.labels, *(text for row in self.quality_rows for text in row))

    def html(self, data: str, *, served: bool) -> str:
        """Return the page with its data, a text of script elements."""
        folder = files(__package__)
        text = {name: (folder / name).read_text(encoding="utf-8") for name in ("page.html", "style.css")}
        script = "\n".join((folder / name).read_text(encoding="utf-8") for name in SCRIPTS)
        meta = json.dumps(self.meta()).replace("<", "\\u003c")
        compared, plays = len(self.videos) > 1, self.frames > 1
        return Template(text["page.html"]).substitute(
            policy=policy(self.nonce, served=served),
            nonce=self.nonce,
            title=html.escape(self.title),
            about=html.escape(self.about()),
            style=text["style.css"],
            time=TIME if plays else "",
            play=PLAY if plays else "",
            compare=COMPARE if compared else "",
            keys=(", M comparison" if compared else "") + (", space plays, J L frame by frame" if plays else ""),
            quality=self.quality() if self.quality_rows else "",
            script=f"{script}\nii.start({meta});",
            data=data,
        )

    def meta(self) -> dict[str, Any]:
        """Return the parameters of the script."""
        picture = self.structure
        (u, _), camera = picture.ei_pixels, camera_of(with_assumed_camera(picture))
        assumed = camera.name == ASSUMED
        front, left, up = (five_viewpoints(camera)[name] for name in ("front", "left", "up"))
        plane = camera.origin_mm[2] + camera.gap_mm
        return {
            "name": self.title,
            "lenses": list(picture.lenses),
            "ei": list(picture.ei_pixels),
            "sign": -1 if picture.erect else 1,
            "side": self.side,
            "across": self.grid[0],
            "pages": math.prod(self.grid),
            "compared": len(self.videos) > 1,
            "frames": self.frames,
            "fps": self.videos[0].fps,
            "card_bytes": CARD_BYTES,
            "labels": list(self.labels),
            "focus": list(_focus(camera)) if u > 1 else [-1, 1],
            "camera": {
                "origin_mm": camera.origin_mm[2],
                "gap_mm": camera.gap_mm,
                "pixel_pitch_mm": camera.pixel_pitch_mm,
                "lens_pitch_mm": list(camera.lens_pitch_mm),
                "size_mm": list(lens_array_mm(camera)),
                "viewer_mm": camera.viewer_mm,
                "vertical_parallax": camera.vertical_parallax,
                "distance_mm": plane - front[2],
                "phi": math.atan2(camera.origin_mm[0] - left[0], plane - left[2]),
                "theta": math.atan2(up[1] - camera.origin_mm[1], plane - up[2]),
                "assumed": assumed,
            },
        }

    def about(self) -> str:
        """Return one line of text on the picture."""
        picture = self.structure
        (k, l), (u, v) = picture.lenses, picture.ei_pixels
        seen = camera_of(with_assumed_camera(picture))
        camera = f"camera {seen.name}" if seen.name != ASSUMED else f"no camera: {seen.view_angle_deg:.3g}° assumed"
        frames = f", {self.frames} frames, {self.videos[0].fps:g} a second" if self.frames > 1 else ""
        return f"{k} × {l} lenses of {u} × {v} px, {camera}{frames}"

    def quality(self) -> str:
        """Return the table of qualities in HTML; the part of a name's first word after _ is a subscript."""

        def named(name: str) -> str:
            symbol, *rest = name.split(" ", 1)
            base, _, sub = symbol.partition("_")
            low = f"<sub>{html.escape(sub)}</sub>" if sub else ""
            return " ".join([html.escape(base) + low, *map(html.escape, rest)])

        lines = "".join(
            f"<tr><th>{named(name)}</th><td>{html.escape(text)}</td></tr>" for name, text in self.quality_rows
        )
        return f'<table aria-label="Quality of the decoded picture">{lines}</table>'

    def parts(self, progress: Callable[[int, int], None] | None) -> Iterator[tuple[str, tuple[int, ...], bytes]]:
        """Yield kind, place and bytes of each part of the page, in the order in which they become visible.

        The place of a page is its picture (0, or 1 for the decoded one), layer and frame.
        """
        (u, v), (k, l) = self.structure.ei_pixels, self.structure.lenses
        yield "preview", (), self._preview()
        if self.depth is not None:
            yield "depth", (), self.depth.astype("<f4").tobytes()
        across, down = self.grid
        centre = (u // 2 + 0.5) * k / self.side - 0.5, (v // 2 + 0.5) * l / self.side - 0.5
        layers = sorted(
            range(across * down), key=lambda i: math.hypot(i % across - centre[0], i // across - centre[1])
        )
        total, done = self.frames * len(layers) * len(self.videos), 0
        for frame in range(self.frames):
            pictures = [video[frame] for video in self.videos]
            for layer in layers:
                for number, picture in enumerate(pictures):
                    yield "page", (number, layer, frame), self._encoded(self._layer(picture, layer))
                    done += 1
                    if progress:
                        progress(done, total)

    def _layer(self, picture: IIPicture, layer: int) -> NDArray[np.uint8]:
        (k, l), (u, v), side = picture.lenses, picture.ei_pixels, self.side
        x0, y0 = layer % self.grid[0] * side, layer // self.grid[0] * side
        x, y = np.arange(x0, min(x0 + side, k * u)), np.arange(y0, min(y0 + side, l * v))
        rows, columns = y % l * v + y // l, x % k * u + x // k
        return codes8(picture.pixels[rows[:, None], columns])

    def _encoded(self, pixels: NDArray[np.uint8]) -> bytes:
        out = io.BytesIO()
        if self.jpeg is None:
            Image.fromarray(pixels).save(out, "WEBP", lossless=True, quality=20, method=2)
        else:
            Image.fromarray(pixels).save(out, "JPEG", quality=self.jpeg, subsampling=0)
        return out.getvalue()

    def _preview(self) -> bytes:
        """Return the view from the front, with which the page starts."""
        picture = with_assumed_camera(self.videos[0][0])
        view, _ = view_image(picture, five_viewpoints(camera_of(picture))["front"])
        step = max(1, -(-max(picture.lenses) // PREVIEW_SIDE))
        out = io.BytesIO()
        small = np.ascontiguousarray(view[::step, ::step])
        Image.fromarray(codes8(small)).save(out, "JPEG", quality=90, subsampling=0)
        return out.getvalue()


TIME = """<label>Time <input type="range" data-state="t"><output></output></label>"""
PLAY = """<button id="play" type="button" aria-pressed="false">Play</button>"""
COMPARE = """<label>Show <select data-state="mode">
        <option>original<option>decoded<option>split<option>difference</select></label>
      <label>Split at <input type="range" data-state="split"><output></output></label>
      <label>Gain <input type="range" data-state="gain"><output></output></label>"""


def depth_view(picture: IIPicture, depth: NDArray[Any]) -> NDArray[np.float32]:
    """Return the depth map of the sub-image in the middle, (L, K)."""
    u, v = picture.ei_pixels
    return np.asarray(depth[v // 2 :: v, u // 2 :: u], np.float32)


def _focus(camera: IICamera) -> tuple[float, float]:
    """Return the range of focus, lenses a pixel: negative before the lens plane."""
    if camera.name == ASSUMED:
        return -MOST_SHIFT, MOST_SHIFT
    per_mm = camera.pixel_pitch_mm / (camera.gap_mm * camera.lens_pitch_mm[0])
    if camera.start_mm and camera.viewer_mm is not None:  # cameras, whose views may agree at any distance
        return -2 * MOST_SHIFT, min(2 * MOST_SHIFT, 0.999 * per_mm * camera.viewer_mm)
    far = (FARTHEST - 1) * per_mm * camera.gap_mm
    return -far / 4, far

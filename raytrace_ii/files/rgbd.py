"""A picture with depth as a scene: of phones, depth cameras, and programs that estimate depth from one picture.

Each pixel of the depth map is a place on a surface; neighbours are joined unless one is much farther than the other.
There the surface is cut between the pixels, and what is farther goes on behind what is nearer: its depth and colours
spread from the cut inwards, so that views from the side do not look through. Seen from the camera's own place, the
scene is the picture. It shines by itself, and needs no light.
"""

from __future__ import annotations

import math
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ii_core.base import checks
from ii_core.base.files import read_depth, read_image

from ..scene.scene import Body, Material, Scene
from ..scene.textures import Image, image_texture

Floats = NDArray[np.float64]
NEAREST_MM = 20.0  # z of the nearest place, where scenes of one mesh begin
HALF_MM, CONE = (25.0, 14.0), 0.267  # half the lenses of setup1, across and down, and how fast their sight widens
MOST_PLACES = 2_000_000  # of the depth map: four triangles each at most
NEAREST_SHARE = 0.001  # of all places, which stray towards the camera and are put with the rest
SKY = 4.0  # depth of an infinite place over the greatest finite one
BEHIND = 0.25  # of the width, how far what is hidden is known
CUT = 0.1


@checks.checked(
    picture=checks.array, depth=checks.array, field_deg=checks.number, inverse=checks.number, cut=checks.number
)
def rgbd_scene(
    picture: NDArray[Any],
    depth: NDArray[Any],
    *,
    field_deg: float = 60.0,
    inverse: float | None = None,
    cut: float = CUT,
) -> Scene:
    """Return the scene of a picture and its depth.

    Its nearest place has z = 20 mm, and the picture fills what `setup1` sees at its median depth, all to scale.

    Parameters
    ----------
    picture : ndarray, (N, M, 3)
        uint8 or uint16 sRGB, or linear float.
    depth : ndarray, (N', M')
        Along the camera's axis, in any unit, of the same shape of frame. 0 and NaN are unknown and take the depth of
        the nearest known place; infinity is four times as far as all else. Large maps are thinned to two million
        places.
    field_deg : float
        The camera's horizontal angle of view, 1 to 170°.
    inverse : float, optional
        The map is 1/z, brighter is nearer, without a scale, as programs estimate it from one picture: its least value
        is this many times as far away as its greatest. More than 1.
    cut : float
        Neighbours are cut apart if one is farther than the other by more than this share.

    Raises
    ------
    ValueError
        If a shape or value is wrong, or no depth is known.
    """
    if picture.ndim != 3 or picture.shape[2] not in (3, 4):
        raise ValueError(f"picture has the shape {picture.shape}: (N, M, 3) is needed")
    checks.within("field_deg", field_deg, 1, 170)
    checks.within("cut", cut, 0.001, 10)
    z = thinned(_depths(depth, inverse))
    (rows, columns), (n, m) = z.shape, picture.shape[:2]
    if abs(columns * n / (rows * m) - 1) > 0.02:
        raise ValueError(f"depth has {depth.shape[1]}×{depth.shape[0]} pixels, the picture {m}×{n}: not one frame")
    slope = math.tan(math.radians(field_deg / 2))
    z *= unit_mm(z, (slope, slope * n / m))
    back = NEAREST_MM - z.min()
    texture = image_texture(picture[..., :3])
    bodies = [_body("picture", surface(z, np.ones(z.shape, bool), cut), slope, back, texture)]
    far, hidden, beside, colours = behind(z, _resized(texture.pixels, z.shape), cut)
    if hidden.any():
        mesh = surface(far, hidden | beside, cut, hidden)
        bodies.append(_body("behind", mesh, slope, back, Image(np.ascontiguousarray(colours, np.float32))))
    return Scene(bodies=bodies)


def read_rgbd(picture: str | os.PathLike[str], depth: str | os.PathLike[str], **options: Any) -> Scene:
    """Return the scene of a picture and a depth map as files; errors name them, options are those of `rgbd_scene`."""
    colours, z = read_image(picture), read_depth(depth)
    try:
        return rgbd_scene(colours if colours.shape[2] > 2 else colours[..., [0, 0, 0]], z, **options)
    except ValueError as error:
        raise ValueError(f"{Path(picture)}, {Path(depth)}: {error}") from None


def _depths(depth: NDArray[Any], inverse: float | None) -> Floats:
    """Return depths of which all are known and finite, the nearest few as far as the next."""
    from scipy.ndimage import distance_transform_edt

    if depth.ndim != 2 or min(depth.shape) < 2:
        raise ValueError(f"depth has the shape {depth.shape}: (N, M) of at least 2×2 is needed")
    z = depth.astype(np.float64)
    if inverse is not None:
        if not 1 < inverse < math.inf:
            raise ValueError(f"inverse is {inverse}: a finite number above 1 is needed")
        known = np.isfinite(z)
        if not known.any() or np.ptp(z[known]) == 0:
            raise ValueError("depth holds one value: as 1/z, with inverse, at least two are needed")
        low, high = z[known].min(), z[known].max()
        z = 1 / (1 / inverse + (1 - 1 / inverse) * (z - low) / (high - low))
    known = z > 0
    if (z < 0).any() or not (known & (z < np.inf)).any():
        raise ValueError("depth is negative somewhere, or known nowhere: positive numbers are needed")
    z[z == np.inf] = SKY * z[known & (z < np.inf)].max()
    if not known.all():
        z = z[tuple(distance_transform_edt(~known, return_distances=False, return_indices=True))]
    return np.maximum(z, np.quantile(z, NEAREST_SHARE, method="higher"))


def unit_mm(depth: Floats, slopes: tuple[float, float]) -> float:
    """Return the mm of a unit of depth: at the median depth, or the nearest if that is more, the picture fills sight.

    ``slopes`` are the tangents of half the angle of view across and down.
    """
    near, middle = depth.min(), float(np.median(depth))
    seen = [half + CONE * NEAREST_MM for half in HALF_MM]
    return max(
        size / max(middle * slope - CONE * (middle - near), near * slope)
        for size, slope in zip(seen, slopes, strict=True)
    )


def thinned(depth: Floats) -> Floats:
    """Return every n-th row and column of a map of more than `MOST_PLACES`."""
    step = math.ceil(math.sqrt(depth.size / MOST_PLACES))
    return depth[step // 2 :: step, step // 2 :: step].copy()


def _resized(pixels: NDArray[Any], shape: tuple[int, int]) -> NDArray[np.float32]:
    """Return the pixels of a picture at the centres of a grid."""
    n, m = (
        ((np.arange(count) + 0.5) * size / count).astype(int)
        for count, size in zip(shape, pixels.shape[:2], strict=True)
    )
    return np.asarray(pixels[n[:, None], m], np.float32)


def behind(
    depth: Floats, pixels: NDArray[np.float32], cut: float
) -> tuple[Floats, NDArray[np.bool_], NDArray[np.bool_], NDArray[np.float32]]:
    """Return depth, pixels and colours of what lies behind nearer things, and the pixels in sight that it begins at.

    From every cut the farther side spreads below the nearer one, a pixel a step, as long as that is nearer.
    """
    height, width = depth.shape
    found, beside = np.zeros(depth.size, bool), np.zeros(depth.size, bool)
    colours = pixels.reshape(-1, 3).copy()
    z, sources = depth.ravel(), np.arange(depth.size)
    far = z.copy()
    for _ in range(math.ceil(BEHIND * width)):
        y, x = np.divmod(sources, width)
        to, of = [], []
        for dy, dx in ((0, 1), (0, -1), (1, 0), (-1, 0)):
            inside = (0 <= y + dy) & (y + dy < height) & (0 <= x + dx) & (x + dx < width)
            to.append((sources + dy * width + dx)[inside])
            of.append(sources[inside])
        target, source = np.concatenate(to), np.concatenate(of)
        under = ~found[target] & (z[target] * (1 + cut) < far[source])
        target, source = target[under], source[under]
        if not target.size:
            break
        farthest = np.zeros(depth.size)
        np.maximum.at(farthest, target, far[source])
        alike = far[source] * (1 + cut) >= farthest[target]
        target, source = target[alike], source[alike]
        beside[source] |= ~found[source]
        counts = np.bincount(target, minlength=depth.size)
        sources = np.flatnonzero(counts)
        sums = np.bincount(target, 1 / far[source], depth.size)
        far[sources], found[sources] = counts[sources] / sums[sources], True
        for c in range(3):
            sums = np.bincount(target, colours[source, c], depth.size)
            colours[sources, c] = sums[sources] / counts[sources]
    shape = depth.shape
    return far.reshape(shape), found.reshape(shape), beside.reshape(shape), colours.reshape(pixels.shape)


def surface(
    depth: Floats, there: NDArray[np.bool_], cut: float, whole: NDArray[np.bool_] | None = None
) -> tuple[Floats, NDArray[np.int64]]:
    """Return vertices (u, v, z, s, t) and faces of the pixels that are there, cut where depth leaps.

    u and v, of places, and s and t, of colours, are from 0 to 1, from the left and from the bottom. A cut runs along
    the borders of pixels, up to which each side has the colour of its own. Pixels of ``whole`` are never cut from
    their neighbours.
    """
    z, there = np.pad(depth, 1, "edge"), np.pad(there, 1, "edge")
    never = np.zeros_like(there) if whole is None else np.pad(whole, 1, "edge")
    height, width = z.shape
    x = np.concatenate([[0], np.arange(width - 2) + 0.5, [width - 2]]) / (width - 2)
    y = np.concatenate([[0], np.arange(height - 2) + 0.5, [height - 2]]) / (height - 2)
    corners = _ring(np.arange(z.size).reshape(z.shape)).reshape(-1, 4)
    q, on, kept = 1 / z.ravel()[corners], there.ravel()[corners], never.ravel()[corners]
    beside = np.roll(q, -1, axis=1)
    close = np.maximum(q, beside) <= (1 + cut) * np.minimum(q, beside)
    agree = on & np.roll(on, -1, axis=1) & (close | kept | np.roll(kept, -1, axis=1))  # along each side
    joined = agree.all(axis=1)
    a, b, c, d = corners[joined].T
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    split = ~joined & on.any(axis=1)
    uv = np.stack([np.tile(x, height), np.repeat(y, width)], axis=1)
    vertices = np.column_stack([uv, z.ravel(), uv])
    if split.any():
        more, new = _quarters(uv[corners[split]], q[split], on[split], agree[split])
        faces = np.concatenate([faces, new + len(vertices)])
        vertices = np.concatenate([vertices, more])
    vertices[:, [1, 4]] = 1 - vertices[:, [1, 4]]
    used, numbers = np.unique(faces, return_inverse=True)
    return vertices[used], numbers.reshape(-1, 3)


def _ring(grid: NDArray[Any]) -> NDArray[Any]:
    """Return the four corners of every quad (…, 4), around it."""
    return np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=-1)


def _quarters(
    uv: Floats, q: Floats, on: NDArray[np.bool_], agree: NDArray[np.bool_]
) -> tuple[Floats, NDArray[np.int64]]:
    """Return vertices and faces of the quarters of quads that are not whole, those of the same surface joined.

    Parameters are by quad and corner, around it: (Q, 4, 2) places, (Q, 4) inverse depth, whether the pixel is there,
    and whether it goes on to the next corner. The middle of a side and of a quad has the mean inverse depth of its
    surface: a straight line there, seen in perspective.
    """
    one = np.eye(4, dtype=bool) | np.zeros((len(q), 1, 1), bool)  # by quad: which corners are of one surface
    for i in range(4):
        one[:, i, (i + 1) % 4] = one[:, (i + 1) % 4, i] = agree[:, i]
    for _ in range(2):
        one = np.any(one[:, :, :, None] & one[:, None, :, :], axis=2)
    middle = (one * q[:, None, :]).sum(axis=2) / one.sum(axis=2)
    parts, centre = [], uv.mean(axis=1)
    for i in range(4):
        after, before, own = (i + 1) % 4, (i - 1) % 4, uv[:, i]
        sides, colour = [], own.copy()
        for other, joined in ((after, agree[:, i]), (before, agree[:, before])):
            depth = np.where(joined, (q[:, i] + q[:, other]) / 2, q[:, i])
            half = (uv[:, other] - own) / 2
            colour += half * joined[:, None]
            sides.append(np.column_stack([own + half, 1 / depth, own + half * joined[:, None]]))
        alone = agree[:, i] & agree[:, before] & ~one[:, i, (i + 2) % 4]  # the middle has colour of the corner beyond
        colour[alone] = own[alone]
        corner = np.column_stack([own, 1 / q[:, i], own])
        inner = np.column_stack([centre, 1 / middle[:, i], colour])
        parts.append(np.stack([corner, sides[0], inner, sides[1]], axis=1)[on[:, i]])
    vertices = np.concatenate(parts)
    numbers = np.arange(4 * len(vertices)).reshape(-1, 4)
    return vertices.reshape(-1, 5), np.concatenate([numbers[:, [0, 1, 2]], numbers[:, [0, 2, 3]]])


def _body(name: str, mesh: tuple[Floats, NDArray[np.int64]], slope: float, back: float, texture: Image) -> Body:
    """Return the shining body of a surface: its camera stands at z = ``back``."""
    (u, v, z, s, t), faces = mesh[0].T, mesh[1]
    n, m = texture.pixels.shape[:2]
    x, y = (2 * u - 1) * slope * z, (2 * v - 1) * slope * z * n / m
    material = Material(colour=(0, 0, 0), emission=(1, 1, 1), emission_map=_clamped(texture))
    places = np.column_stack([s, t, np.zeros_like(s)])
    vertices = np.column_stack([x, y, z + back])
    return Body(name=name, vertices=vertices, faces=faces, material=material, texture_coordinates=places)


def _clamped(texture: Image) -> Image:
    """Return a texture whose border continues: at a repeated one the opposite side would show."""
    return replace(texture, wrap=("clamp", "clamp"))

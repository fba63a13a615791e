"""Confidence of disparity: its weights fitted to fields in closed form.

    python -m benchmarks run depth_confidence

Spheres, slanted walls and bars of any texture, or none, under a light that casts soft shadows and highlights: 24
fields of 9×9 views of 160² px, 24 of 3×3 to 9×9 views of 112² px, 16 of 9×9 views of 288² px, noise of 0 to 4 codes.
No field of these is used to measure the method; only `AROUND` was chosen by *cuboid*, among windows that do as well
here. Printed are `JUDGES` and `CROWD` of `ii_core.depth.estimate`, and their errors: weights of every
second field tried on the others.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from unittest.mock import patch

import numpy as np
from scipy.optimize import minimize

from ii_core import IIPicture, estimate_depth
from ii_core.base.colour import srgb
from ii_core.depth import estimate
from ii_core.depth.highlights import highlights

SURE, BORDER, EVERY = 0.9, 8, 5  # of the pixels, every fifth is fitted
SIGNS = (-1, -1, 1), (-1, -1, 1, -1)  # of the terms of `agreement` and `rivalry`
# seeds, px, views a side
SETS = ((range(24), 160, (9,)), (range(100, 124), 112, (5, 5, 3, 9)), (range(200, 216), 288, (9,)))
Array = np.ndarray[Any, Any]
Body = tuple[str, Array, Array | float]  # plane: normal, point; ball: centre, radius; bar: centre, half its width


def main() -> None:
    """Fit and print."""
    fields = [terms(*field(seed, side, views[seed % len(views)])) for seeds, side, views in SETS for seed in seeds]
    judges, crowd = fitted(fields)
    print("JUDGES =", [np.round(weights, 2).tolist() for weights in judges], "CROWD =", np.round(crowd, 2).tolist())
    weights = fitted(fields[::2])
    sure = [confidence(each, *weights) >= SURE for each in fields[1::2]]
    bad = [~each[2][held] for each, held in zip(fields[1::2], sure, strict=True)]
    print(f"sure {100 * np.concatenate(sure).mean():.1f} %, of these bad {100 * np.concatenate(bad).mean():.1f} %")


def field(seed: int, side: int, views: int) -> tuple[IIPicture, Array]:
    """Return a field and the disparity of its middle view: z = 1 is `span` px a step before infinity."""
    draw = np.random.default_rng(seed)
    focal, span, half = 1.5 * side, draw.choice([1.5, 4.0, 8.0]), views // 2
    draw.uniform()  # of no use, but the weights in the code are those of the fields that follow it
    infinity, base = draw.uniform(-span * 0.5, 0.0) - span * 0.2, 1.5 * span / focal
    shade = scene(draw)
    y, x = np.mgrid[:side, :side].astype(float)

    def way(right: float, down: float) -> Array:
        middle = (side - 1) / 2
        return np.stack([(x + right - middle) / focal, (y + down - middle) / focal, np.ones_like(x)], axis=-1)

    light = np.zeros((side, views, side, views, 3))
    for j, i in np.ndindex(views, views):
        at = np.array([(i - half) * base, (j - half) * base, 0.0])
        for down, right in ((-0.25, -0.25), (-0.25, 0.25), (0.25, -0.25), (0.25, 0.25)):
            light[:, j, :, i] += shade(at, way(right + (i - half) * infinity, down + (j - half) * infinity))[0] / 4
    z = shade(np.zeros(3), way(0, 0))[1]
    sigma = draw.choice([0, 0.5, 1, 1, 2, 4])
    noisy = 255 * srgb(np.clip(light, 0, 1)) + (sigma * draw.normal(size=light.shape) if sigma else 0)
    codes = np.clip(np.rint(noisy), 0, 255).astype(np.uint8).reshape(side * views, side * views, 3)
    true = np.where(np.isfinite(z), focal * base / z + infinity, np.nan)
    return IIPicture(codes, (side, side), (views, views)), true


def scene(draw: np.random.Generator) -> Callable[[Array, Array], tuple[Array, Array]]:
    """Return a function from the place of a camera and ways with z = 1 to linear light and z."""
    far = draw.uniform(2.5, 5)
    normal = np.array([draw.uniform(-0.8, 0.8), draw.uniform(-0.8, 0.8), -1.0])
    bodies: list[Body] = [("plane", normal / np.linalg.norm(normal), np.array([0, 0, far]))]
    if draw.random() < 0.6:
        floor = np.array([0, -1.0, draw.uniform(-0.2, 0.0)])
        bodies.append(("plane", floor / np.linalg.norm(floor), np.array([0, draw.uniform(0.3, 0.6), 1.5])))
    for _ in range(draw.integers(1, 5)):
        z = draw.uniform(1.1, far * 0.9)
        centre = np.array([draw.uniform(-0.35, 0.35) * z, draw.uniform(-0.35, 0.35) * z, z])
        bodies.append(("ball", centre, draw.uniform(0.06, 0.22) * z))
    for _ in range(draw.integers(0, 3)):
        z = draw.uniform(1.1, far * 0.9)
        bodies.append(("bar", np.array([draw.uniform(-0.3, 0.3) * z, 0, z]), draw.uniform(0.003, 0.05) * z))
    sun = np.array([draw.uniform(-1, 1), -1.0, -draw.uniform(0.2, 1.0)])
    sun /= np.linalg.norm(sun)
    skins = [skin(draw) for _ in bodies]
    ambient, sky = draw.uniform(0.2, 0.5), draw.uniform(0, 0.8, 3)

    def shade(at: Array, way: Array) -> tuple[Array, Array]:
        hits = np.stack([met(body, at, way) for body in bodies])
        z, light = hits.min(axis=0), np.broadcast_to(sky, way.shape).copy()
        for n, body in enumerate(bodies):
            here = (hits.argmin(axis=0) == n) & np.isfinite(z)
            point = at + way[here] * z[here][:, None]
            if body[0] == "ball":
                up = (point - body[1]) / body[2]
            else:
                up = np.broadcast_to(body[1] if body[0] == "plane" else np.array([0, 0, -1.0]), point.shape)
            lit = np.clip(up @ sun, 0, 1)
            for other in bodies:
                if other[0] == "ball" and other is not body:
                    lit = lit * open_to(sun, point, other)
            colour, gloss, sharpness = skins[n](point)
            light[here] = colour * (ambient + 0.8 * lit)[:, None]
            if gloss:
                back = sun - way[here] / np.linalg.norm(way[here], axis=-1, keepdims=True)
                back /= np.linalg.norm(back, axis=-1, keepdims=True)
                shine = np.clip((back * up).sum(axis=-1), 0, 1) ** sharpness
                light[here] += gloss * (shine * (lit > 0))[:, None]
        return light, z

    return shade


def met(body: Body, at: Array, way: Array) -> Array:
    """Return z of the nearest point of a body on each way; infinite without one."""
    kind, first, second = body
    with np.errstate(all="ignore"):
        if kind == "plane":
            z = ((second - at) @ first) / (way @ first)
            return np.where(z > 0.3, z, np.inf)
        if kind == "ball":
            off, square = at - first, (way * way).sum(axis=-1)
            half = way @ off
            root = half * half - square * (off @ off - second**2)
            return np.where(root > 0, (-half - np.sqrt(root)) / square, np.inf)
    z = first[2] - at[2]
    return np.where(np.abs(at[0] + way[..., 0] * z - first[0]) < second, z, np.inf)


def open_to(sun: Array, point: Array, ball: Body) -> Array:
    """Return the share of the sun that a ball leaves to points, by the distance of its centre from their line."""
    off = ball[1] - point
    along = off @ sun
    away = np.sqrt(np.maximum((off * off).sum(axis=-1) - along * along, 0))
    return np.where(along > 0, np.clip((away / ball[2] - 0.9) / 0.2, 0, 1), 1)


def skin(draw: np.random.Generator) -> Callable[[Array], tuple[Array, float, float]]:
    """Return a function from points to colour, gloss and its sharpness: waves of random size, one in four plain."""
    size, contrast = 10 ** draw.uniform(-1.6, 0.2), 10 ** draw.uniform(-3.2, -0.6)
    if draw.random() < 0.25:
        contrast = 0.0
    octaves = int(draw.integers(1, 4))
    waves, turns = draw.normal(0, 1, (12 * octaves, 3)) / size, draw.uniform(0, 6.28, 12 * octaves)
    colours = draw.normal(0, 1, (12 * octaves, 3)) / np.sqrt(6 * octaves)
    waves *= np.repeat(2.0 ** np.arange(octaves), 12)[:, None]
    colours *= contrast / np.repeat(1.6 ** np.arange(octaves), 12)[:, None]
    ground, gloss, sharpness = (
        draw.uniform(0.1, 0.8, 3),
        draw.choice([0, 0, 0.2, 0.5]),
        draw.choice([10, 40, 100, 300]),
    )
    return lambda point: (np.clip(ground + np.sin(point @ waves.T + turns) @ colours, 0, 1), gloss, sharpness)


Terms = tuple[tuple[Array, Array], Array, Array, Array]


def terms(picture: IIPicture, true: Array) -> Terms:
    """Return the terms of both judges (H, W, n) and the pixels that count; of these, which are within 0.07 px, and
    the factor of highlights.
    """
    kept: list[Any] = []

    def judged(disparity: Array, ratio: Array, margin: Array, other: Any, noise: float, mean: Array) -> Array:
        known = np.nan_to_num(disparity)
        both = estimate.agreement(other, noise), estimate.rivalry(known, ratio, margin, other, noise)
        kept.extend(np.stack([np.ones_like(known), *found], axis=-1) for found in both)
        kept.append(np.where(highlights(mean), estimate.SHINY, 1))
        return np.zeros_like(known)

    with patch.object(estimate, "judged", judged):
        disparity = estimate_depth(picture).disparity
    inner = np.isfinite(true) & np.isfinite(disparity)
    inner[:BORDER], inner[-BORDER:], inner[:, :BORDER], inner[:, -BORDER:] = False, False, False, False
    return (kept[0], kept[1]), inner, (np.abs(disparity - true) <= 0.07)[inner], kept[2][inner]


def fitted(fields: list[Terms]) -> tuple[list[Array], Array]:
    """Return the weights of both judges, of most likelihood, and of the crowd around."""
    parts = [np.concatenate([each[0][n][each[1]][::EVERY] for each in fields]) for n in (0, 1)]
    good = np.concatenate([each[2][::EVERY] for each in fields]).astype(float)
    scale = [np.append(1.0, part[:, 1:].std(axis=0)) for part in parts]
    parts = [part / size for part, size in zip(parts, scale, strict=True)]
    cut = parts[0].shape[1]

    def loss(weights: Array) -> tuple[float, Array]:
        shares = [_logistic(part @ w) for part, w in zip(parts, (weights[:cut], weights[cut:]), strict=True)]
        right = np.clip(shares[0] * shares[1], 1e-6, 1 - 1e-6)
        slope = -(good - (1 - good) * right / (1 - right)) / good.size
        slopes = [part.T @ (slope * (1 - share)) for part, share in zip(parts, shares, strict=True)]
        return -(good * np.log(right) + (1 - good) * np.log(1 - right)).mean(), np.concatenate(slopes)

    signs = np.concatenate([(0, *SIGNS[0]), (0, *SIGNS[1])])
    bounds = [(None if s <= 0 else 0, None if s >= 0 else 0) for s in signs]
    found = minimize(loss, np.where(signs == 0, 1.0, 0.5 * signs), jac=True, method="L-BFGS-B", bounds=bounds).x
    judges = [found[:cut] / scale[0], found[cut:] / scale[1]]
    around = np.concatenate([_crowd(each, judges)[each[1]] for each in fields])
    right, crowd = np.concatenate([each[2] for each in fields]).astype(float), np.zeros(3)
    for _ in range(20):  # Newton's steps
        share = _logistic(around @ crowd)
        bend = (around * (share * (1 - share))[:, None]).T @ around
        crowd = crowd + np.linalg.solve(bend, around.T @ (right - share))
    return judges, crowd


def confidence(each: Terms, judges: list[Array], crowd: Array) -> Array:
    """Return the confidence of the pixels that count."""
    return np.asarray(_logistic(_crowd(each, judges)[each[1]] @ crowd) * each[3])


def _crowd(each: Terms, judges: list[Array]) -> Array:
    both = _logistic(each[0][0] @ judges[0]) * _logistic(each[0][1] @ judges[1])
    return np.stack([np.ones_like(both), *estimate.crowd(both)], axis=-1)


def _logistic(values: Array) -> Array:
    return 1 / (1 + np.exp(-np.clip(values, -30, 30)))


if __name__ == "__main__":
    main()

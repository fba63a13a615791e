"""Limits of depth from focus: low contrast against noise, two depths along one line, moving highlights."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.accuracy import depth_truth
from benchmarks.stability.geometry import Row
from ii_core import IIPicture, add_sensor_noise, estimate_depth, preset
from ii_core.depth.focus import METHODS
from metrics import FocusDepth, depth_from_focus, linear_layers
from raytrace_ii import Body, Light, Material, Scene, render
from raytrace_ii.scene.textures import Image, linear

CAMERA = preset("setup1", scale=8)
LAYER, BEHIND = 20, 60  # of 250 layers: that of the wall, and that of the scene seen in or through it
SHARES = (0.0, 0.1, 0.25, 0.4, 0.5, 0.6, 0.75, 0.9, 1.0)
KINDS = ("textured", "flat", "edge", "mirror", "clear")


def wall(layer: float, steps: float, seed: int = 0, facing: float = 1.0, **material: Any) -> Body:
    """Return a wall of random grey patches on one layer, before the camera or, for ``facing`` −1, behind it.

    The darkest and the brightest patch differ by ``steps`` of 8-bit sRGB around middle grey.
    That is a whole code: between two, rounding would draw a texture.
    """
    z = layer * CAMERA.gap_mm
    half = 2 * z  # larger than the field of view
    corners = np.array(
        [[-half, -half, facing * z], [half, -half, facing * z], [half, half, facing * z], [-half, half, facing * z]]
    )
    cells = round(2 * half / (2 * z * CAMERA.pixel_pitch_mm / CAMERA.gap_mm))  # two pixels under a lens per patch
    codes = 128 + steps * (np.random.default_rng(seed).random((cells, cells, 1)) - 0.5)
    texture = Image(np.repeat(linear(codes / 255), 3, axis=2).astype(np.float32))
    return Body(
        name="wall", vertices=corners, faces=np.array([[0, 2, 1], [0, 3, 2]]),
        texture_coordinates=np.column_stack([(corners[:, :2] + half) / (2 * half), np.zeros(4)]),
        material=Material(colour=(1.0, 1.0, 1.0), texture=texture, **material),
    )  # fmt: skip


def seen(*bodies: Body, lights: tuple[Light, ...] = (), ambient: float = 1.0) -> IIPicture:
    scene = Scene(bodies=list(bodies), lights=lights, ambient=(ambient,) * 3)
    return render(scene, CAMERA, samples=4, support=()).picture


def depth_contrast(sizes: tuple[float, ...] = (0, 1, 2, 4, 8, 16, 32, 64, 128)) -> list[Row]:
    """Return the share of pixels within a tenth of a wall's depth, over falling contrast and rising noise."""
    rows = []
    for steps in sizes:
        sharp = seen(wall(LAYER, steps))
        row: Row = {"contrast, steps": steps}
        for method in METHODS:
            for sigma in (0, 1, 4):
                found = estimated(add_sensor_noise(sharp, sigma, seed=1), method)
                row[f"{method}, σ {sigma}"] = near(found, LAYER)
                if sigma == 1:
                    row[f"{method}, σ 1, sure"] = float((found.confidence > 0.5).mean())
        rows.append(row)
    return rows


def estimated(picture: IIPicture, method: str) -> FocusDepth:
    """Return depth from focus on the dissertation's layers, in which these experiments count."""
    return depth_from_focus(picture, method=method, layers_mm=linear_layers(CAMERA))


def near(found: FocusDepth, layer: int) -> float:
    """Return the share of pixels within a tenth of a layer's depth."""
    z = layer * CAMERA.gap_mm
    with np.errstate(invalid="ignore"):
        return float((np.abs(found.depth_mm - z) < 0.1 * z).mean())


def depth_two_layers(shares: tuple[float, ...] = SHARES) -> list[Row]:
    """Return the share of pixels at the depth of a wall, and of the scene seen in or through it, over its strength.

    The mirror shows a wall behind the camera at its mirrored distance; the clear wall does not refract. Both walls
    have the same contrast.
    """
    rows = []
    for share in shares:
        row: Row = {"of the light from behind": share}
        kinds = {
            "mirror": (wall(LAYER, 128, mirror=(share,) * 3), mirrored()),
            "clear": (wall(LAYER, 128, transmission=(share,) * 3, ior=1.0), wall(BEHIND, 128, seed=1)),
        }
        for kind, bodies in kinds.items():
            picture = seen(*bodies)
            for method in METHODS:
                found = estimated(picture, method)
                row[f"{kind}, {method}: wall"] = near(found, LAYER)
                row[f"{kind}, {method}: behind"] = near(found, BEHIND)
        rows.append(row)
    return rows


def mirrored() -> Body:
    """Return the wall behind the camera that a mirror on LAYER shows on the layer BEHIND."""
    return wall(BEHIND - 2 * LAYER, 128, seed=1, facing=-1.0)


def depth_highlight() -> list[Row]:
    """Return shares for a wall of low contrast under a rising highlight, whose place differs from lens to lens."""
    lamp = Light(kind="point", vector=(6.0, 4.0, -20.0), colour=(1.0, 1.0, 1.0))
    rows = []
    plain = wall(LAYER, 16)
    for strength in (0.0, 0.125, 0.25, 0.5, 1.0, 2.0):
        shiny = replace(plain, material=replace(plain.material, specular=strength, shininess=400.0))
        picture = seen(shiny, lights=(lamp,), ambient=0.2)
        without = seen(plain, lights=(lamp,), ambient=0.2)
        row: Row = {
            "strength": strength,
            "pixels brighter": float((picture.pixels != without.pixels).any(axis=2).mean()),
        }
        for method in METHODS:
            row[method] = near(estimated(picture, method), LAYER)
        rows.append(row)
    return rows


def depth_kinds() -> list[Row]:
    """Return the share of pixels within a tenth of their depth, by kind, over all scenes, from `depth_truth`."""
    rows = [row for row in _kept() if row["scale"] == 8]
    out = []
    for kind in KINDS:
        for noise in sorted({row["noise"] for row in rows}):
            cells = {}
            for method in METHODS:
                held = [
                    row for row in rows if (row["noise"], row["method"]) == (noise, method) and row[f"pixels_{kind}"]
                ]
                pixels = sum(row[f"pixels_{kind}"] for row in held)
                cells[method] = sum(row[f"pixels_{kind}"] * row[f"within_10_%_{kind}"] for row in held) / pixels
            out.append({"seen": kind, "pixels": pixels, "noise, steps": noise, **cells})
    return out


# Share of a mirrored wall; width of a bar in px; noise and contrast in 8-bit codes.
SWEEPS: dict[str, tuple[float, ...]] = {
    "mirror": (0.1, 0.25, 0.5, 0.9), "thin": (1, 3, 5), "noise": (0, 8, 24), "contrast": (0, 2, 8),
}  # fmt: skip
WALL, BAR, MIRRORED, INNER = 0.8, 2.6, -1.2, 6


def depth_of_views(sweeps: dict[str, tuple[float, ...]] = SWEEPS) -> list[Row]:
    """Return how `estimate_depth` does on walls in closed form: 5×5 views of 48×40 px, inside the border."""
    rows = []
    for kind, amounts in sweeps.items():
        for amount in amounts:
            picture, truth = closed_form(kind, amount)
            found = estimate_depth(picture, low=-4, high=4)
            inner = slice(INNER, -INNER), slice(INNER, -INNER)
            good = (np.abs(found.disparity - truth) <= 0.07)[inner]
            sure, bar = (found.confidence >= 0.9)[inner], (truth == BAR)[inner]
            rows.append({
                "kind": kind, "amount": amount, "within 0.07 px": float(good.mean()), "sure": float(sure.mean()),
                "bad where sure": float(1 - good[sure].mean()) if sure.any() else None,
                "on the bar": float(good[bar].mean()) if bar.any() else None,
            })  # fmt: skip
    return rows


def closed_form(kind: str, amount: float) -> tuple[IIPicture, np.ndarray]:
    """Return a field of a wall of known texture, and its disparity: light is known between pixels."""
    size, views, draw = (48, 40), (5, 5), np.random.default_rng(3)
    waves, phases, sizes = draw.uniform(-0.9, 0.9, (24, 2)), draw.uniform(0, 6.3, (24, 3)), draw.uniform(0.3, 1, 24)

    def light(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        turns = x[..., None] * waves[:, 0] + y[..., None] * waves[:, 1]
        return np.clip(0.5 + (np.sin(turns[..., None] + phases) * sizes[:, None]).sum(axis=-2) / 16, 0, 1)

    y, x = np.mgrid[: size[1], : size[0]].astype(float)
    out = np.empty((size[1], views[1], size[0], views[0], 3))
    for j, i in np.ndindex(views[1], views[0]):
        down, right = j - 2, i - 2
        seen = light(x + right * WALL, y + down * WALL)
        if kind == "mirror":
            seen = (1 - amount) * seen + amount * light(x + right * MIRRORED + 31, y + down * MIRRORED + 17)
        elif kind == "thin":
            on = np.abs(x + right * BAR - 24) < amount / 2
            seen = np.where(on[..., None], light(x + right * BAR + 50, y + down * BAR) / 2, seen)
        elif kind == "noise":
            seen = seen + draw.normal(0, amount / 255, seen.shape)
        else:
            seen = 0.5 + (seen - 0.5) * amount / 255
        out[:, j, :, i] = seen
    truth = np.full(x.shape, WALL)
    if kind == "thin":
        truth[np.abs(x - 24) < amount / 2] = BAR
    codes = np.clip(np.rint(255 * out), 0, 255).astype(np.uint8)
    return IIPicture(codes.reshape(size[1] * views[1], size[0] * views[0], 3), size, views), truth


def _kept() -> list[dict[str, Any]]:
    return list(depth_truth.data()["rows"])

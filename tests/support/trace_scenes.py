"""Small scenes and rays for the tests of the tracer."""

import math
from types import SimpleNamespace

import numpy as np

from raytrace_ii import Background, Body, Light, Material, Scene
from raytrace_ii.scene.textures import Checker, Image, Noise
from raytrace_ii.shapes.primitives import Box, Mesh, Plane, Sphere, rotation
from raytrace_ii.tracing.kernels import lanes
from raytrace_ii.tracing.kernels.images import read_images
from raytrace_ii.tracing.kernels.lanes import BLOCK, work
from raytrace_ii.tracing.kernels.noise import fractal_lanes
from raytrace_ii.tracing.kernels.textures import alpha, noise_colour, pattern_colour
from raytrace_ii.tracing.texture_table import TextureTable

WHITE, BLACK = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
UNIFORM = Background(horizon=WHITE, zenith=WHITE, nadir=WHITE)


def body(mesh, *, name="body", at=(0, 0, 0), turn=(0, 0, 0), scale=1.0, flat=False, coordinates=None, **material):
    """Return a body of a mesh; material parameters go to `Material`."""
    matrix = rotation(turn)
    return Body(
        name=name,
        vertices=(mesh.vertices * scale) @ matrix.T + np.asarray(at),
        faces=mesh.faces,
        normals=None if flat or mesh.normals is None else mesh.normals @ matrix.T,
        texture_coordinates=coordinates,
        material=Material(**material),
    )


def sphere(radius=1.0, segments=96):
    return Sphere(shape="sphere", radius_mm=radius, segments=segments).mesh()


def box(*size):
    return Box(shape="box", size_mm=size).mesh()


def floor(x=100.0, z=None):
    """A rectangle in y = 0 that faces up."""
    return Plane(shape="plane", size_mm=(x, x if z is None else z)).mesh()


def wall(z, half=50.0):
    """A square at one z that faces the camera."""
    corners = np.array([[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]], float)
    return Mesh(corners, np.array([[0, 2, 1], [0, 3, 2]]), None, (corners[:, :2] + half) / (2 * half))


def ramp(mesh, half, **more):
    """A wall whose red grows with x and green with y: 0 at −half, 1 at +half; blue is 1 everywhere.

    Two texels make it: a bilinear texture is exactly straight between their centres, u = ¼ and ¾.
    """
    texels = np.array([[[0, 1, 1], [1, 1, 1]], [[0, 0, 1], [1, 0, 1]]], np.float32)
    uv = 0.5 + mesh.vertices[:, :2] / (4 * half)
    coordinates = np.column_stack([uv, np.zeros(len(uv))])
    return body(mesh, coordinates=coordinates, colour=WHITE, texture=Image(texels), name="ramp", **more)


def sun(towards, colour=WHITE):
    """A directional light that stands in the direction ``towards``."""
    return Light(kind="directional", vector=tuple(-np.asarray(towards, float)), colour=colour)


def lamp(position, colour=WHITE):
    return Light(kind="point", vector=tuple(position), colour=colour)


def spread(generator, n):
    """Unit vectors all around."""
    out = generator.normal(size=(n, 3))
    return out / np.linalg.norm(out, axis=1, keepdims=True)


def hall(max_depth=5):
    """Mirrors, clear and coloured glass, textures, a highlight, three lights and a sky before a coding setup."""
    ground = floor(400, 400)
    ball = sphere(4, 48)
    return Scene(
        name="hall",
        bodies=[
            body(
                ground, name="floor", at=(0, -9, 150), coordinates=ground.vertices,
                texture=Checker(((0.9, 0.8, 0.6), (0.1, 0.2, 0.3)), (7, 7, 7)), colour=WHITE,
            ),
            body(box(14, 12, 2), name="mirror", at=(-11, 0, 70), turn=(0, -25, 0), mirror=(0.8, 0.8, 0.7)),
            body(sphere(5, 48), name="glass", at=(2, -3, 35), transmission=(0.95,) * 3, ior=1.5),
            body(
                box(6, 9, 3), name="filter", at=(14, -2, 45), turn=(0, 20, 5),
                transmission=(0.9, 0.4, 0.2), absorption_per_mm=(0.01, 0.1, 0.2), ior=1.33,
            ),
            body(
                ball, name="stone", at=(8, 2, 60), coordinates=ball.vertices, specular=0.6, shininess=30,
                texture=Noise(((0.7, 0.1, 0.1), (0.9, 0.9, 0.5)), (2, 2, 2), octaves=3), mirror=(0.1,) * 3,
            ),
        ],
        lights=[
            sun((0.4, 1.0, -0.5), (0.6, 0.6, 0.5)),
            lamp((-15, 20, 20), (0.3, 0.2, 0.2)),
            lamp((10, 12, 100), (0.1, 0.2, 0.4)),
        ],
        background=Background(horizon=(0.7, 0.8, 0.9), zenith=(0.1, 0.3, 0.7), nadir=(0.3, 0.3, 0.3), spread_deg=40),
        ambient=(0.2, 0.2, 0.25),
        max_depth=max_depth,
    )  # fmt: skip


def texture_at(texture, points):
    """Linear colours, (n, 3), of a texture at (n, 3) texture coordinates."""
    packed = TextureTable([texture])
    table, points = packed.table, np.asarray(points, float)
    if isinstance(texture, Image):
        return np.concatenate([filtered(packed, 0, some[:, 0], some[:, 1]) for some in blocks(points)])
    if isinstance(texture, Noise):
        sums = octaves(points / texture.size, texture.octaves, texture.seed)
        return np.array([noise_colour(table, 0, total) for total in sums])
    return np.array([pattern_colour(table, 0, *p) for p in points])


def alpha_at(image, points):
    """Alpha, (n,), of an image at (n, 3) texture coordinates."""
    packed = TextureTable([image])
    alphas = packed.alphas.astype(np.float64)  # else Python would reckon in float32, compiled code does not
    return np.array([alpha(packed.table, 0, alphas, u, v) for u, v, _ in np.asarray(points, np.float64)])


def blocks(points):
    return np.split(points, range(BLOCK, len(points), BLOCK))


def filtered(packed, row, u, v, au=0.0, av=0.0, bu=0.0, bv=0.0):
    """Linear colours, (n, 3), of an image of a texture table at up to 16 places, over ellipses of two diameters."""
    rooms, n = work(), len(np.atleast_1d(u))
    rooms.whole[lanes.IMAGE : lanes.IMAGE + BLOCK] = -1
    rooms.whole[lanes.IMAGE : lanes.IMAGE + n] = row
    rooms.double[lanes.SU : lanes.SU + n], rooms.double[lanes.SV : lanes.SV + n] = u, v
    for first, value in ((lanes.AU, au), (lanes.AV, av), (lanes.BU, bu), (lanes.BV, bv)):
        rooms.single[first : first + n] = value
    read_images(SimpleNamespace(levels=packed.levels, texels=packed.texels), rooms)
    return np.stack([rooms.single[first : first + n] for first in (lanes.Q0, lanes.Q1, lanes.Q2)], axis=1)


def octaves(points, many, seed):
    """Sums of octaves of gradient noise at (n, 3) places, (n,)."""
    found = []
    for some in blocks(points):
        rooms = work()
        for first, values in ((lanes.SX, some[:, 0]), (lanes.SY, some[:, 1]), (lanes.SZ, some[:, 2])):
            rooms.double[first : first + len(some)] = values
        rooms.whole[lanes.OCTAVES : lanes.OCTAVES + len(some)] = many
        rooms.whole[lanes.SEED : lanes.SEED + len(some)] = seed
        fractal_lanes(len(some), rooms.whole, rooms.double)
        found.append(rooms.double[lanes.TOTAL : lanes.TOTAL + len(some)])
    return np.concatenate(found)


def reflectance(cosine, ior):
    """Unpolarised Fresnel reflectance from air, by angles: sines and tangents of their sum and difference."""
    incident = math.acos(cosine)
    if incident == 0:
        return ((ior - 1) / (ior + 1)) ** 2
    refracted = math.asin(math.sin(incident) / ior)
    s = math.sin(incident - refracted) / math.sin(incident + refracted)
    p = math.tan(incident - refracted) / math.tan(incident + refracted)
    return (s * s + p * p) / 2


def on_planes(starts, ways, corners):
    """Where rays meet the planes of faces (F, 3, 3), in float64 by Cramer's rule, as (rays, F).

    Distances in lengths of a ray, how far inside the face (share of a side, below 0 outside), and the volume
    that ray and two sides span: 0 for a face seen edge-on.
    """
    p = np.asarray(corners, np.float32).astype(np.float64)
    a, b = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        across = np.cross(ways[:, None], b)
        size = (across * a).sum(-1)
        off = starts[:, None] - p[:, 0]
        u = (off * across).sum(-1) / size
        turned = np.cross(off, a)
        v, t = (turned * ways[:, None]).sum(-1) / size, (turned * b).sum(-1) / size
        return t, np.minimum(np.minimum(u, v), 1 - u - v), size

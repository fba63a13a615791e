"""Named tuples of the arrays that kernels read and write."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .lanes import Work
from .packets import Tools

Single = NDArray[np.float32]
Double = NDArray[np.float64]
Whole = NDArray[np.int32]


class Hits(NamedTuple):
    """Nearest hit of each ray: row of the face, −1 on a miss; u, v; distance in lengths of the direction."""

    faces: Whole
    u: Single
    v: Single
    distances: Single


class Rays(NamedTuple):
    """One generation of rays.

    ``inside`` (n, nested) lists the transmissive bodies that a ray runs in, −1 after the last. ``keys`` are places in
    the lobes of rough mirrors, as `glossy.lobe_keys` gives them, of no rows where nothing is rough; ``widths`` at
    the origins, mm, of no rows for camera rays, or where images are not filtered.
    """

    origins: Single
    directions: Single
    weights: Single
    pixels: Whole
    inside: Whole
    keys: NDArray[np.uint64]
    widths: Single


class Start(NamedTuple):
    """Camera rays by columns and rows of pixels: the tables of `start.fill_start_tables`, in one dimension.

    ``rows`` and ``columns`` are those of the pixels in the order of their rays, from ``top`` and ``left`` on; of no
    rows if the rays come from elsewhere. ``within`` are the rays' places in their pixels, from 0 to 1 right and down,
    in one dimension; of no rows if rays pass the centres. ``steps`` is how a ray grows from pixel to pixel, right and
    down, 8 numbers each as a row of the tables has.
    """

    column_rays: Double
    row_rays: Double
    rows: Whole
    columns: Whole
    top: int
    left: int
    within: Double
    steps: Double


class ShadowRays(NamedTuple):
    """Rays to lights, with the light that they would let through; as many rows for each light as rays are shaded."""

    origins: Single
    directions: Single
    reach: Single
    colours: Single
    pixels: Whole
    inside: Whole


class Maps(NamedTuple):
    """Whether bodies of a scene have any images, maps of a kind, or parts that are seen through."""

    any: bool
    normal: bool
    emission: bool
    gloss: bool
    blend: bool


class Surfaces(NamedTuple):
    """Faces, materials and textures of a scene, as `packing.PackedScene` describes them.

    ``rows`` is the table of faces in one dimension, of so many ``columns``, ``faces`` its columns from the normal on,
    ``looks`` the first columns of ``materials``, ``levels`` those of ``textures``, both in one dimension.
    """

    rows: Single
    columns: int
    smooth: bool
    corners: Single
    faces: Single
    coordinates: Single
    object_of_face: Whole
    materials: Double
    looks: Single
    maps: Maps
    textures: Double
    levels: Single
    texels: tuple[Single, NDArray[np.uint8]]
    alphas: Single


class Onward(NamedTuple):
    """Rays that go on behind a face, packed to the front, and their rows in the table of hits."""

    origins: Single
    directions: Single
    rows: Whole


class Surroundings(NamedTuple):
    """Lights, sky, fog (colour and density, of no length if there is none) and ambient light."""

    lights: Double
    background: Double
    fog: Double
    ambient: Double


class Passage(NamedTuple):
    """How one generation is shaded.

    ``least`` is the least weight of a spawned ray. Up to ``lobe_rays`` rays go over the lobe of a rough mirror, whose
    places stand ``lobe_stride`` apart. A ray is ``first_width`` wide where it starts, if it has no width of its own,
    and grows by ``spread`` a mm, from a negative width through 0: images are filtered over its width, not at all if
    both are 0. Hits that are not ``placed`` stand where Embree put them. Shadow rays are written for ``later`` if
    they may pass through clear bodies, or if Embree cannot be called from the kernel. Rays over mirrors are written
    from row ``mirrored`` on.
    """

    least: float
    lobe_rays: int
    lobe_stride: int
    first_width: float
    spread: float
    placed: bool
    later: bool
    mirrored: int


class Recorded(NamedTuple):
    """Support images by pixel, of no rows where not wanted; depth is from ``eye`` along the camera's ``axis``."""

    depth: Single
    normal: Single
    object_id: Whole
    ray_length: Single
    shading_normal: Single
    eye: Double
    axis: Double


class Stages(NamedTuple):
    """Addresses of the stages that not every scene needs, 0 where this one does not."""

    footprints: int
    attenuate: int
    look_closely: int
    sky_image: int
    record: int
    spawn: int


class Columns(NamedTuple):
    """Columns along the light of lamps, see `kernels.columns`.

    ``turns`` has `NUMBERS` numbers a lamp, ``known`` ``size`` rows of ``size`` heights a lamp; of no size if there
    are none. If faces are not ``solid``, what lies below a sheet is not known to be in shadow.
    """

    turns: Single
    known: Single
    size: int
    solid: bool


class Generation(NamedTuple):
    """One generation of rays with everything that its shading reads and fills.

    ``hits`` are of no rows if the kernel finds them, by ``tools``; of coincident faces the ``first_of_same`` counts,
    of no rows if there are none. Origins, directions and weights of ``rays`` are of no rows if they ``start`` within
    the kernel. Shadow rays that ``columns`` do not tell take n rows for each light, of which ``lit`` are filled;
    ``counts`` are those of `tables`.
    """

    hits: Hits
    tools: Tools
    first_of_same: Whole
    start: Start
    rays: Rays
    surfaces: Surfaces
    surroundings: Surroundings
    passage: Passage
    recorded: Recorded
    radiance: Single
    shadows: ShadowRays
    following: Rays
    counts: NDArray[np.int64]
    lit: NDArray[np.int64]
    work: Work
    columns: Columns

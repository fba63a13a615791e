"""II-camera: location map L and direction map D, the start and direction of each pixel's ray.

Coordinates: left-handed, x right, y up, z into the scene, millimetres. The pixel array lies in z = 0,
centred on the origin; the lens plane is z = gap. A pixel (m, n) is column m from the left, row n from the top.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.checks import (
    MOST_MM,
    Pair,
    block,
    check_fields,
    checked,
    flag,
    length,
    number,
    numbers,
    one_of,
    place,
    sequence,
    text,
    whole_pair,
    within,
)
from .elements import Bundle, Element, FrontElement, LensModel, Under
from .lattice import DRIFT_TERMS, LATTICES, STEEPEST, Drift, Lattice, axes_of
from .optics import Pinhole, chain, unit_disk

ASSUMED = "nominal"  # name of a camera that was assumed, also in files
LEAST_PITCH = 1e-6  # pixels from lens to lens: shorter ones are rounded to nothing
MOST_TURN, MOST_SHEAR = 60.0, 0.25  # degrees; beyond, rows and columns should change their names
MOST_ALONG, MOST_PIXELS = 1 << 20, 1 << 34  # of a camera; a hundred times the largest picture in use
Floats = NDArray[np.float64]


class Camera(Protocol):
    """Protocol of `IICamera` and `MapCamera`: one pixel array, its lenses and its rays.

    ``erect`` is true for upright elementary images. ``model`` is the camera with parameters; None if only maps exist.
    """

    @property
    def name(self) -> str: ...
    @property
    def pixels(self) -> Pair: ...
    @property
    def lenses(self) -> Pair: ...
    @property
    def ei_pixels(self) -> tuple[Any, Any]: ...
    @property
    def erect(self) -> bool: ...
    @property
    def model(self) -> IICamera | None: ...
    def rays(self, rows: slice = ..., cols: slice = ...) -> tuple[Floats, Floats]:
        """Return L and D, (h, w, 3), of the first sample of a block of pixels."""


@dataclass(frozen=True, kw_only=True)
class IICamera:
    """Array of lenslets in front of an array of pixels.

    The default is a rectangular array of pinholes, each over a whole number of pixels. One lens makes a 2-D camera.

    Parameters
    ----------
    pixels : (M, N)
        Pixels across and down.
    lenses : (K, L)
        Lenslets across and down.
    pixel_pitch_mm : float
        δP, the side of a square pixel.
    gap_mm : float
        Λ, the distance from the pixel array to the lens plane.
    lens_pitch_mm : float or (float, float), optional
        δL across and down; if not given, the pitch with which the elementary images fill the pixel array.
    lattice : {"rectangular", "hexagonal"}
        Odd rows of a hexagonal array are shifted half a pitch to the right.
    optics : sequence of `Element` or their plain values
        The lens model, by default a pinhole, and the elements in front of the array; see `optics`.
    lens_offset_mm : (x, y)
        Shift of the lens array against the pixel array, for moving lenslets.
    lens_turn_deg : float
        Turn of the lens array against the pixel array about the array's own middle, anticlockwise as x is to the
        right and y up; less than 60° either way.
    lens_shear : float
        Lean of the columns of lenses against the rows: how far a row stands further right than the one above, in
        shares of the distance of rows; at most `MOST_SHEAR` either way.
    lens_drift_mm : (7 numbers, 7 numbers), optional
        Smooth shift of the lens centres off their grid, to the right and up, as a main lens shifts the middles of
        micro-images towards the border. The seven are the factors of ξ², ξη, η², ξ³, ξ²η, ξη², η³; ξ and η are the
        place of the lens right and up from the middle of the pixel array, in halves of the array's width.
    origin_mm : (x, y, z)
        Centre of the pixel array, for stacks of sensors and arrays of cameras.
    start_mm : float
        Distance behind the lens plane, on the viewer's side, at which rays start. With 0 they start at the lenses,
        and the scene stands behind the display. With more, the lens plane is a virtual display in the midst of the
        scene: things before it stand before the display.
    viewer_mm : float, optional
        d, distance before the lens plane at which the viewing zones of all lenses meet; parallel if not given.
        The pitch of elementary images is δL·(1 + Λ/d) of erect ones, and of others δL·(1 − Λ/d).
    both_sides : bool
        The array sees the image of a main lens that is not in ``optics``, on both sides of the lens plane; z is that
        of the image. Rays do not depend on it.
    packed : bool
        Elementary images of M/K × N/L pixels lie side by side in the picture, but each stands under the middle of its
        lens, whatever the lens pitch: those of a row of cameras are 9×1 pixels under square lenses.
    name : str
        Name in files and messages.

    Raises
    ------
    ValueError
        If a value is out of range: lengths from 1e-9 to 1e9 mm, coordinates to 1e9 mm.

    References
    ----------
    Olsson 2008, (3.9), (3.15), (3.16), (3.20), with samples on pixel centres instead of corners.
    """

    pixels: Pair
    lenses: Pair
    pixel_pitch_mm: float
    gap_mm: float
    lens_pitch_mm: tuple[float, float] = None  # type: ignore[assignment]  # filled in below
    lattice: str = "rectangular"
    optics: tuple[Element, ...] = ()
    lens_offset_mm: tuple[float, float] = (0.0, 0.0)
    lens_turn_deg: float = 0.0
    lens_shear: float = 0.0
    lens_drift_mm: tuple[tuple[float, ...], tuple[float, ...]] | None = None
    origin_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    start_mm: float = 0.0
    viewer_mm: float | None = None
    both_sides: bool = False
    packed: bool = False
    name: str = ""

    def __post_init__(self) -> None:
        def put(field: str, value: Any) -> None:
            object.__setattr__(self, field, value)

        check_fields(self, optics=sequence, both_sides=flag, packed=flag, name=text)
        for field in ("pixels", "lenses"):
            across, down = whole_pair(field, getattr(self, field))
            if max(across, down) > MOST_ALONG or across * down > MOST_PIXELS:
                raise ValueError(f"{field} are {across}×{down}: at most {MOST_ALONG} a side, {MOST_PIXELS} in all")
            put(field, (across, down))
        for field in ("pixel_pitch_mm", "gap_mm"):
            put(field, length(field, getattr(self, field)))
        model, front = chain(self.optics)
        put("optics", (model, *front))
        self._check_start()
        put("viewer_mm", None if self.viewer_mm is None else length("viewer_mm", self.viewer_mm))
        if not self._ei_per_lens > 0:
            raise ValueError(f"viewer_mm is {self.viewer_mm:g}: more than gap_mm, {self.gap_mm:g}, is needed")
        if self.lens_pitch_mm is None:
            put("lens_pitch_mm", self._shared_pitch_mm)
        given = self.lens_pitch_mm
        both = tuple(given) if isinstance(given, Sequence) and not isinstance(given, str) else (given,) * 2
        if len(both) != 2:
            raise ValueError(f"lens_pitch_mm is {given!r}: one length, or two, across and down, are needed")
        put("lens_pitch_mm", tuple(length("lens_pitch_mm", pitch) for pitch in both))
        if min(self.lens_pitch_mm) < LEAST_PITCH * self.pixel_pitch_mm:
            pitch = min(self.lens_pitch_mm)
            raise ValueError(f"lens_pitch_mm is {pitch:g}: at least {LEAST_PITCH:g} of pixel_pitch_mm is needed")
        one_of(*LATTICES)("lattice", self.lattice)
        for field, count in (("lens_offset_mm", 2), ("origin_mm", 3)):
            put(field, place(field, getattr(self, field), count))
        for field, most in (("lens_turn_deg", MOST_TURN), ("lens_shear", MOST_SHEAR)):
            put(field, number(field, getattr(self, field)))
            if not abs(getattr(self, field)) <= most:
                raise ValueError(f"{field} is {getattr(self, field):g}: at most {most:g} either way is needed")
        if self.lens_drift_mm is not None:
            put("lens_drift_mm", _drift(self.lens_drift_mm, self.size_mm))
        if self.packed:
            self._check_packed()
        if hasattr(model, "thickness"):
            model.thickness(self.lens_pitch_mm)  # raises ValueError if the sphere is too small for its cell
        behind = self.gap_mm
        for element in front:
            if element.z_mm < behind:  # no ray would ever reach it, and the picture be black
                raise ValueError(
                    f"{element.kind}: z_mm is {element.z_mm:g}: what stands behind it is at {behind:g}, "
                    "elements are needed in order, away from the pixels"
                )
            behind = element.end_mm

    def _check_packed(self) -> None:
        if any(m % k for m, k in zip(self.pixels, self.lenses, strict=True)):
            (m, n), (k, l) = self.pixels, self.lenses
            raise ValueError(f"packed pixels are {m}×{n} under {k}×{l} lenses: whole elementary images are needed")
        for field in ("lattice", "lens_offset_mm", "lens_turn_deg", "lens_shear", "lens_drift_mm"):
            if getattr(self, field) != getattr(IICamera, field):
                raise ValueError(f"packed pixels have {field} {getattr(self, field)}: a straight array is needed")

    def _check_start(self) -> None:
        start = within("start_mm", self.start_mm, 0, MOST_MM, "distance", " mm")
        if self.front and start:
            raise ValueError(f"start_mm is {start:g}: rays start at the lenses if a {self.front[0].kind} is in front")
        object.__setattr__(self, "start_mm", start)

    @property
    def _ei_per_lens(self) -> float:
        """Pitch of elementary images over that of lenses: not 1 if viewing zones meet at a viewer."""
        if self.viewer_mm is None:
            return 1.0
        return 1 + (1 if self.erect else -1) * self.gap_mm / self.viewer_mm

    @property
    def ei_pitch_mm(self) -> tuple[float, float]:
        """Pitch of the elementary images on the pixel array, across and down; of packed ones their size."""
        if self.packed:
            u, v = self.ei_pixels
            return u * self.pixel_pitch_mm, v * self.pixel_pitch_mm
        across, down = self.lens_pitch_mm
        return across * self._ei_per_lens, down * self._ei_per_lens

    @property
    def _shared_pitch_mm(self) -> tuple[float, ...]:
        """Lens pitch that divides the pixel array evenly."""
        even = (m * self.pixel_pitch_mm / k for m, k in zip(self.pixels, self.lenses, strict=True))
        return tuple(pitch / self._ei_per_lens for pitch in even)

    @property
    def lens_model(self) -> LensModel:
        """Model of the lenslets."""
        return self.optics[0]  # type: ignore[return-value]

    @property
    def front(self) -> tuple[FrontElement, ...]:
        """Elements in front of the lens array."""
        return self.optics[1:]  # type: ignore[return-value]

    @cached_property
    def lens_lattice(self) -> Lattice:
        """The centres of elementary images, in pixels from the top left corner of the pixel array.

        They lie under the lens centres, but for cameras with a `viewer_mm` and packed ones.
        """
        if self.packed:
            u, v = (m // k for m, k in zip(self.pixels, self.lenses, strict=True))
            return Lattice(self.lenses, (float(u), float(v)), (0.0, 0.0), False, None, None)
        pitch = []
        for pixels, lenses, lens_pitch in zip(self.pixels, self.lenses, self.ei_pitch_mm, strict=True):
            even, given = pixels / lenses, lens_pitch / self.pixel_pitch_mm
            # Quotients of millimetres are whole pixels only within rounding: 1e-9 is the tolerance.
            pitch.append(even if abs(given - even) < 1e-9 * even else round(given, 9))
        shift = [round(offset / self.pixel_pitch_mm, 9) for offset in self.lens_offset_mm]
        shift[1] *= -1  # rows run down
        origin = [(m - k * p) / 2 + s for m, k, p, s in zip(self.pixels, self.lenses, pitch, shift, strict=True)]
        axes = axes_of(self.lens_turn_deg, self.lens_shear)
        return Lattice(
            self.lenses, (pitch[0], pitch[1]), (origin[0], origin[1]), self.lattice == "hexagonal", axes, self._drift
        )

    @property
    def _drift(self) -> Drift | None:
        """``lens_drift_mm`` in pixels, with y down."""
        if self.lens_drift_mm is None:
            return None
        right, up = self.lens_drift_mm
        flips = [(-1) ** j / self.pixel_pitch_mm for _, j in DRIFT_TERMS]
        return Drift(
            middle=(self.pixels[0] / 2, self.pixels[1] / 2),
            reach=self.pixels[0] / 2,
            right=tuple(a * flip for a, flip in zip(right, flips, strict=True)),
            down=tuple(-b * flip for b, flip in zip(up, flips, strict=True)),
        )

    @property
    def regular(self) -> bool:
        """Whether every lens covers its own rectangle of whole pixels, M = K·U and N = L·V."""
        lattice = self.lens_lattice
        whole = all(
            p == round(p) and k * p == m for p, k, m in zip(lattice.pitch, self.lenses, self.pixels, strict=True)
        )
        straight = lattice.axes is None and lattice.drift is None
        return whole and straight and not lattice.hexagonal and lattice.origin == (0.0, 0.0)

    @property
    def ei_pixels(self) -> tuple[Any, Any]:
        """(U, V), pixels across and down in one elementary image; whole numbers if the structure is regular."""
        u, v = self.lens_lattice.pitch
        return (int(u), int(v)) if self.regular else (u, v)

    @property
    def erect(self) -> bool:
        """Whether elementary images are upright."""
        return self.lens_model.erect

    @property
    def vertical_parallax(self) -> bool:
        """Whether views differ down: not under lenticular lenses, nor those of one row of cameras."""
        return self.lens_model.vertical_parallax and not (self.packed and self.ei_pixels[1] == 1)

    @property
    def samples_aperture(self) -> bool:
        """Whether rays of a pixel spread over an aperture."""
        return self.lens_model.samples_aperture

    @property
    def model(self) -> IICamera | None:
        """The camera itself; see `Camera`."""
        return self

    def channel_cameras(self) -> tuple[IICamera, ...]:
        """Return the camera itself; if an element has three wavelengths, those of red, green and blue light."""
        chains = [tuple(element.of_channel(channel) for element in self.optics) for channel in range(3)]
        return (self,) if chains[0] == self.optics else tuple(replace(self, optics=optics) for optics in chains)

    @property
    def size_mm(self) -> tuple[float, float]:
        """Width and height of the pixel array; if it is packed, of the lens array."""
        if self.packed:
            return self.lenses[0] * self.lens_pitch_mm[0], self.lenses[1] * self.lens_pitch_mm[1]
        return self.pixels[0] * self.pixel_pitch_mm, self.pixels[1] * self.pixel_pitch_mm

    @property
    def view_angle_deg(self) -> float:
        """α, the full horizontal angle of view of one lens (2.1)."""
        return math.degrees(2 * math.atan(self.lens_pitch_mm[0] / (2 * self.gap_mm)))

    @checked(rows=block, cols=block, sample=numbers, place=numbers)
    def rays(
        self,
        rows: slice = slice(None),
        cols: slice = slice(None),
        sample: ArrayLike = (0.5, 0.5),
        place: ArrayLike = (0.5, 0.5),
    ) -> tuple[Floats, Floats]:
        """Return location points and direction vectors of a block of pixels.

        Parameters
        ----------
        rows, cols : slice
            The block, as numpy slices. Only this block is computed.
        sample : array_like, (2,) or (h, w, 2)
            Start of the ray in its pixel, right and down from the top left corner, in [0, 1]. The ray passes the lens
            over the pixel's centre.
        place : array_like, (2,) or (h, w, 2)
            Position on the lens's aperture, in [0, 1] along both axes; (½, ½) is its centre.

        Returns
        -------
        L, D : ndarray of float64, (h, w, 3)
            Start of each ray, mm, and its direction, not normalised. For a pinhole these are the lens centre, and the
            lens centre minus the pixel. Blocked rays have direction 0.

        References
        ----------
        Olsson 2008, (3.15), (3.19), (3.20).
        """
        return self.rays_at(*self._block(rows, cols), sample, place)

    @checked(m=numbers, n=numbers, sample=numbers, place=numbers)
    def rays_at(
        self, m: ArrayLike, n: ArrayLike, sample: ArrayLike = (0.5, 0.5), place: ArrayLike = (0.5, 0.5)
    ) -> tuple[Floats, Floats]:
        """Return rays of any pixels; m and n broadcast against each other. See `rays`.

        Raises
        ------
        ValueError
            If ``sample`` or ``place`` is outside [0, 1].
        """
        L, D, weight = self.weighted_rays_at(m, n, sample, place)
        if weight is not None:
            D[weight == 0] = 0
        return L, D

    @checked(rows=block, cols=block, sample=numbers, place=numbers)
    def weighted_rays(
        self,
        rows: slice = slice(None),
        cols: slice = slice(None),
        sample: ArrayLike = (0.5, 0.5),
        place: ArrayLike = (0.5, 0.5),
    ) -> tuple[Floats, Floats, Floats | None]:
        """Return L and D as `rays` does, and the transmitted share of light (h, w); None if all is transmitted."""
        return self.weighted_rays_at(*self._block(rows, cols), sample, place)

    @checked(m=numbers, n=numbers, sample=numbers, place=numbers)
    def weighted_rays_at(
        self, m: ArrayLike, n: ArrayLike, sample: ArrayLike = (0.5, 0.5), place: ArrayLike = (0.5, 0.5)
    ) -> tuple[Floats, Floats, Floats | None]:
        """Return rays of any pixels, as `weighted_rays` does."""
        sample, place = _inside("sample", sample), _inside("place", place)
        m, n = np.asarray(m), np.asarray(n)
        shape = np.broadcast_shapes(m.shape, n.shape, sample.shape[:-1], place.shape[:-1])
        rays = self._bundle(m, n, sample, place)
        L, D = np.empty((*shape, 3)), np.empty((*shape, 3))
        for axis, (place_mm, towards) in enumerate(zip(rays[:3], rays[3:6], strict=True)):
            L[..., axis] = place_mm + self.origin_mm[axis]
            D[..., axis] = towards
        return L, D, None if rays.weight is None else np.broadcast_to(rays.weight, shape).copy()

    @checked(rows=block, cols=block)
    def separable_rays(self, rows: slice = slice(None), cols: slice = slice(None)) -> tuple[Floats, ...] | None:
        """Return rays of pixel centres as coordinates; None unless x depends on the column and y on the row alone.

        Returns
        -------
        x, y, z : ndarray, (w, 2), (h, 2), (2,)
            Coordinates of L and of D, bitwise equal to those of `rays`.
        """
        centre = np.full(2, 0.5)
        m, n = self._block(rows, cols)
        rays = self._bundle(m, n, centre, centre)
        shapes = ((1, m.size), (n.size, 1), ())
        coordinates = []
        for axis, (place_mm, towards) in enumerate(zip(rays[:3], rays[3:6], strict=True)):
            pair = np.empty((*shapes[axis], 2))
            if any(np.broadcast_shapes(np.shape(a), shapes[axis]) != shapes[axis] for a in (place_mm, towards)):
                return None
            pair[..., 0], pair[..., 1] = place_mm + self.origin_mm[axis], towards
            coordinates.append(pair.reshape(-1, 2))
        return None if rays.weight is not None else (coordinates[0], coordinates[1], coordinates[2][0])

    def _block(self, rows: slice, cols: slice) -> tuple[NDArray[Any], NDArray[Any]]:
        return np.arange(self.pixels[0])[None, cols], np.arange(self.pixels[1])[rows, None]

    def _bundle(self, m: NDArray[Any], n: NDArray[Any], sample: Floats, place: Floats) -> Bundle:
        lattice = self.lens_lattice
        k, l = lattice.nearest(m, n)
        places = self._packed_places if self.packed else self._places
        px, py, cx, cy = places(m + sample[..., 0], n + sample[..., 1], k, l)
        ax, ay = unit_disk(place) if self.lens_model.samples_aperture else (np.float64(0), np.float64(0))
        under = Under(
            px=px, py=py, cx=cx, cy=cy, k=k, l=l, ax=ax, ay=ay, gap=self.gap_mm, cell=self.lens_pitch_mm,
            hexagonal=lattice.hexagonal, axes=lattice.axes,
        )  # fmt: skip
        rays = self.lens_model.leave(under)
        if self.start_mm:
            rays = _started(rays, self.gap_mm - self.start_mm)
        for front in self.front:
            rays = front.pass_on(rays)
        return rays

    def _places(self, m: Any, n: Any, k: Any, l: Any) -> tuple[Any, Any, Any, Any]:
        """Return x and y of places on the pixel array, and of the centres of lenses."""
        pitch, (width, height) = self.pixel_pitch_mm, self.size_mm
        x, y = self.lens_lattice.centres(k, l)
        cx, cy = x * pitch - width / 2, height / 2 - y * pitch
        if self.viewer_mm is not None:  # lenses stand closer, or wider, than their elementary images
            (sx, sy), ratio = self.lens_offset_mm, self._ei_per_lens
            cx, cy = sx + (cx - sx) / ratio, sy + (cy - sy) / ratio
        return m * pitch - width / 2, height / 2 - n * pitch, cx, cy

    def _packed_places(self, m: Any, n: Any, k: Any, l: Any) -> tuple[Any, Any, Any, Any]:
        """Return what `_places` does if elementary images stand apart."""
        pitch, ratio = self.pixel_pitch_mm, self._ei_per_lens
        (across, down), (u, v) = self.lens_pitch_mm, self.ei_pixels
        cx, cy = (k - (self.lenses[0] - 1) / 2) * across, ((self.lenses[1] - 1) / 2 - l) * down
        return cx * ratio + (m - (k + 0.5) * u) * pitch, cy * ratio - (n - (l + 0.5) * v) * pitch, cx, cy

    def to_json(self) -> dict[str, Any]:
        """Return plain values for `from_json`; values equal to their default are left out."""
        data: dict[str, Any] = {
            "kind": "lenslet-array",
            "name": self.name,
            "pixels": list(self.pixels),
            "lenses": list(self.lenses),
            "pixel_pitch_mm": self.pixel_pitch_mm,
            "gap_mm": self.gap_mm,
        }
        optional = ("lens_pitch_mm", "lattice", "lens_offset_mm", "lens_turn_deg", "lens_shear", "origin_mm")
        for field in (*optional, "start_mm", "viewer_mm", "both_sides", "packed"):
            value = getattr(self, field)
            if value != (self._shared_pitch_mm if field == "lens_pitch_mm" else getattr(IICamera, field)):
                data[field] = list(value) if isinstance(value, tuple) else value
        if self.lens_drift_mm is not None:
            data["lens_drift_mm"] = [list(factors) for factors in self.lens_drift_mm]
        if self.optics != (Pinhole(),):
            data["optics"] = [e.to_json() for e in self.optics]
        return data

    @classmethod
    def from_json(cls, data: Any) -> IICamera:
        """Return the camera of the values of `to_json`.

        Raises
        ------
        ValueError
            If a value is missing, unknown or out of range.
        """
        needed = {"pixels", "lenses", "pixel_pitch_mm", "gap_mm"}
        known = needed | {
            "kind",
            "name",
            "lens_pitch_mm",
            "lattice",
            "optics",
            "lens_offset_mm",
            "lens_turn_deg",
            "lens_shear",
            "lens_drift_mm",
            "origin_mm",
            "start_mm",
            "viewer_mm",
            "both_sides",
            "packed",
            "about",
            "notes",
        }
        if not isinstance(data, Mapping) or data.get("kind", "lenslet-array") != "lenslet-array":
            raise ValueError('no camera: needs "kind": "lenslet-array"')
        if missing := needed - set(data):
            raise ValueError(f"camera: {', '.join(sorted(missing))} missing")
        if unknown := set(data) - known:
            raise ValueError(
                f"camera: no such key {', '.join(sorted(unknown))}: known are {', '.join(sorted(known))}"
            )
        parameters = {key: value for key, value in data.items() if key not in ("kind", "about", "notes")}
        if not isinstance(parameters.get("optics", ()), Sequence) or isinstance(parameters.get("optics"), str):
            raise ValueError(f"camera: optics are {parameters['optics']!r}: a list of elements is needed")
        try:
            made = cls(**{**parameters, "name": str(parameters.get("name", ""))})
        except TypeError as error:
            raise ValueError(f"camera has a value of the wrong type: {error}") from None
        if made.name == ASSUMED and made.regular and "lens_pitch_mm" not in data:  # before pixels could be packed
            pitch = made.lens_pitch_mm[0]
            return replace(made, lens_pitch_mm=(pitch, pitch), packed=made.ei_pixels[0] != made.ei_pixels[1])
        return made


def _started(rays: Bundle, z_mm: float) -> Bundle:
    """The same lines of sight, from a plane behind the lenses on."""
    lx, ly, lz, dx, dy, dz, weight = rays
    back = (z_mm - lz) / np.where(dz > 0, dz, 1.0)  # blocked rays may go anywhere
    return Bundle(lx + dx * back, ly + dy * back, np.float64(z_mm), dx, dy, dz, weight)


def _drift(value: Any, size_mm: tuple[float, float]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return a drift as tuples of floats; ValueError if it has another form or grows too fast anywhere."""
    name, count = "lens_drift_mm", len(DRIFT_TERMS)
    sequence(name, value)
    for factors in value:
        sequence(name, factors)
    if [len(factors) for factors in value] != [count, count]:
        raise ValueError(f"{name} is {value!r}: two lists of {count} numbers, to the right and up, are needed")
    right, up = (
        tuple(within(name, factor, -MOST_MM, MOST_MM, unit=" mm") for factor in factors) for factors in value
    )
    half, tall = size_mm[0] / 2, max(1.0, size_mm[1] / size_mm[0])
    for factors in (right, up):
        slope = sum(abs(a) * (i + j) * tall ** (i + j - 1) for a, (i, j) in zip(factors, DRIFT_TERMS, strict=True))
        if slope > STEEPEST * half:
            raise ValueError(
                f"{name} may grow by {slope / half:.3g} mm within 1 mm: at most {STEEPEST:g} keeps lenses in order"
            )
    return right, up


def _inside(name: str, value: ArrayLike) -> Floats:
    place = np.asarray(value, dtype=np.float64)
    if place.shape[-1:] != (2,) or not ((place >= 0) & (place <= 1)).all():
        raise ValueError(f"{name} must hold positions (right, down), each in [0, 1]")
    return place

"""II-picture: pixels, structure of lenses, and camera."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base import checks
from ..base.colour import srgb
from ..base.files import (
    RowWriter,
    atomic_paths,
    check_form,
    check_type,
    image_header,
    image_rows,
    image_types,
    json_text,
    one_line,
    pixel_digest,
    read_image,
    read_json,
)
from ..camera.camera import IICamera, Pair, whole_pair

DTYPES = ("uint8", "uint16", "float32")
BINDING = "pixels_blake2b"  # key of the sidecar: hash of its picture's pixels
SAME_PITCH = 1e-7  # relative tolerance of the pitch: 0.001 pitches over 10 000 lenses


@dataclass(frozen=True, eq=False, repr=False)
class IIPicture:
    """Integral-imaging picture.

    Parameters
    ----------
    pixels : ndarray, (N, M, 3), of uint8, uint16 (sRGB) or float32 (linear light)
        Row 0 is the top. Not copied.
    lenses : (K, L)
        Lenslets across and down.
    ei_pixels : (U, V)
        Pixels across and down under each lenslet; M = K·U and N = L·V. Fractional for cameras with a hexagonal array
        or a non-integer lens pitch.
    camera : IICamera, optional
        Camera of the picture; view images need it.
    erect : bool
        True if every elementary image is upright, rotated by 180° against the image of a plain lens.

    Raises
    ------
    ValueError
        If the pixels are of another shape or type, or the structure does not fit them.
    """

    pixels: NDArray[Any]
    lenses: Pair
    ei_pixels: tuple[Any, Any]
    camera: IICamera | None = None
    erect: bool = False

    def __post_init__(self) -> None:
        pixels, camera = self.pixels, self.camera
        if camera is not None:
            checks.instance(IICamera)("camera", camera)
        if not isinstance(pixels, np.ndarray) or pixels.ndim != 3 or pixels.shape[2] != 3:
            shape = getattr(pixels, "shape", type(pixels).__name__)
            raise ValueError(f"pixels are {shape}: an array of shape (N, M, 3) is needed")
        if pixels.dtype.name not in DTYPES:
            raise ValueError(f"pixels are {pixels.dtype.name}: one of {', '.join(DTYPES)} is needed")
        object.__setattr__(self, "lenses", whole_pair("lenses", self.lenses))
        if camera is not None and not camera.regular:
            self._check_irregular(camera)
        else:
            object.__setattr__(self, "ei_pixels", whole_pair("ei_pixels", self.ei_pixels))
            self._check_regular(camera)

    @property
    def about(self) -> str:
        """Structure, pixel type and camera in one line."""
        (k, l), (u, v) = self.lenses, self.ei_pixels
        camera = "no camera" if self.camera is None else f"camera {self.camera.name or 'without a name'}"
        return f"{k}×{l} lenses of {u:.4g}×{v:.4g} px, {self.pixels.dtype.name}, {camera}"

    def __repr__(self) -> str:
        return f"IIPicture({self.about})"

    def _check_regular(self, camera: IICamera | None) -> None:
        (k, l), (u, v), (width, height) = self.lenses, self.ei_pixels, self.size
        for across, size, lens_count, side in ((u, width, k, "width"), (v, height, l, "height")):
            if size % across:
                raise ValueError(f"elementary image {u}×{v} px does not divide picture {side} {size}")
            if size != lens_count * across:
                raise ValueError(
                    f"{k}×{l} lenses of {u}×{v} px need a picture of {k * u}×{l * v} px, "
                    f"this one has {width}×{height}"
                )
        if camera is not None and (camera.lenses, camera.ei_pixels) != (self.lenses, self.ei_pixels):
            raise ValueError(
                f"the camera has {camera.lenses} lenses of {camera.ei_pixels} px, "
                f"the picture {self.lenses} of {self.ei_pixels}"
            )

    def _check_irregular(self, camera: IICamera) -> None:
        u, v = self.ei_pixels
        given, kept = (float(u), float(v)), camera.ei_pixels
        # A camera keeps nine digits of its pitch in pixels: more of them in a file mean the same.
        same = all(abs(a - b) <= SAME_PITCH * b for a, b in zip(given, kept, strict=True))
        object.__setattr__(self, "ei_pixels", kept if same else given)
        if camera.pixels != self.size or (camera.lenses, camera.ei_pixels) != (self.lenses, self.ei_pixels):
            raise ValueError(
                f"the camera has {camera.pixels[0]}×{camera.pixels[1]} px and {camera.lenses} lenses of "
                f"{camera.ei_pixels} px, "
                f"the picture {self.size[0]}×{self.size[1]} and {self.lenses} of {self.ei_pixels}"
            )

    @property
    def regular(self) -> bool:
        """Whether every lens covers its own rectangle of whole pixels; only then are there component images."""
        return self.camera is None or self.camera.regular

    def check_regular(self) -> None:
        """Raise ValueError unless the structure is regular."""
        if self.camera is not None and not self.camera.regular:
            (u, v), (x, y) = self.ei_pixels, self.camera.lens_lattice.origin
            beginning = f" that begin at {x:.5g}, {y:.5g} px" if (x, y) != (0, 0) else ""
            raise ValueError(
                f"the structure is not regular, elementary images of {u:.5g}×{v:.5g} px{beginning}: "
                "run `raytrace-ii regular`, or ii_core.resampled"
            )

    @property
    def size(self) -> Pair:
        """(M, N), pixels across and down."""
        return self.pixels.shape[1], self.pixels.shape[0]

    @property
    def light_field(self) -> NDArray[Any]:
        """Pixels ``[l, k, v, u]`` by lens and position under it, (L, K, V, U, 3).

        A view, or a copy if the pixels are not contiguous.

        Raises
        ------
        ValueError
            If the structure is not regular.
        """
        self.check_regular()
        return picture_order(self.pixels, self.lenses, self.ei_pixels).transpose(0, 2, 1, 3, 4)

    def with_pixels(self, pixels: NDArray[Any]) -> IIPicture:
        """Return a picture of other pixels with the same structure and camera."""
        return replace(self, pixels=pixels)

    @checks.checked(other=lambda name, value: checks.instance(IIPicture)(name, value))
    def check_same_structure(self, other: IIPicture) -> None:
        """Raise ValueError unless the other picture has the same lenses, elementary images and pixel type."""
        for what in ("lenses", "ei_pixels", "erect"):
            mine, theirs = getattr(self, what), getattr(other, what)
            if mine != theirs:
                raise ValueError(f"pictures of different structure: {what} {mine} against {theirs}")
        if self.pixels.dtype != other.pixels.dtype:
            raise ValueError(f"pictures of different type: {self.pixels.dtype} against {other.pixels.dtype}")

    @checks.checked(path=checks.path)
    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the picture and, beside it, ``<path>.json`` with its structure and camera.

        PNG holds 8 and 16 bit, EXR float, TIFF all three. Files of these names are replaced, whole and together: the
        sidecar holds a hash of the pixels, and `load` refuses a sidecar of other pixels.

        Returns
        -------
        Path
            The picture's file.

        Raises
        ------
        ValueError
            If the file type is unknown or cannot hold the pixels' type.
        OSError
            If the files cannot be written.
        """
        check_type(path, self.pixels.dtype.name)
        with (
            atomic_paths([sidecar(path), path]) as (beside, file),
            picture_rows(self, file, beside, named=path) as write,
        ):
            write(self.pixels)
        return Path(path)

    def structure_json(self) -> dict[str, Any]:
        """Return everything but the pixels as plain values."""
        return {
            "format": "ii-picture",
            "version": 1,
            "lenses": list(self.lenses),
            "ei_pixels": list(self.ei_pixels),
            "erect": self.erect,
            "camera": self.camera.to_json() if self.camera else None,
        }

    @classmethod
    def from_structure_json(cls, pixels: NDArray[Any], data: Any) -> IIPicture:
        """Return the picture of pixels and the plain values of `structure_json`.

        Raises
        ------
        ValueError
            If the values are not those of a structure, or do not fit the pixels.
        """
        check_form(data, "no II-picture structure", "ii-picture", 1, ("lenses", "ei_pixels"))
        camera = data.get("camera")
        return cls(
            pixels,
            data["lenses"],
            data["ei_pixels"],
            IICamera.from_json(camera) if camera is not None else None,
            bool(data.get("erect", False)),
        )

    @classmethod
    @checks.checked(path=checks.path)
    def load(
        cls, path: str | os.PathLike[str], *, lenses: Pair | None = None, ei_pixels: Pair | None = None
    ) -> IIPicture:
        """Read a picture and its sidecar, or a bare picture whose structure is given.

        Raises
        ------
        ValueError
            If there is neither sidecar nor structure, or the structure does not fit.
        OSError
            If the picture cannot be read.
        """
        if (lenses is None) != (ei_pixels is None):
            raise ValueError("the structure of a picture needs both lenses and ei_pixels: only one is given")
        image_types(path)
        shape, dtype = image_header(path)
        nothing = np.broadcast_to(np.zeros(1, dtype), shape)  # check the structure before pixels are read
        if lenses is not None and ei_pixels is not None:
            return cls(nothing, lenses, ei_pixels).with_pixels(read_image(path))
        try:
            data = read_json(sidecar(path))
        except FileNotFoundError:
            raise ValueError(
                f"{path} has no sidecar {sidecar(path).name} that gives its structure: give lenses and ei_pixels in "
                "Python, or make it by raytrace-ii import"
            ) from None
        try:
            picture = cls.from_structure_json(nothing, data)
        except (ValueError, TypeError, KeyError, AttributeError, ArithmeticError) as error:
            raise ValueError(f"{sidecar(path)}: {one_line(error)}") from None
        picture = picture.with_pixels(read_image(path))
        if data.get(BINDING) not in (None, pixel_digest(picture.pixels)):
            raise ValueError(
                f"{path} and {sidecar(path).name} do not belong together: the sidecar was written for other pixels. "
                f"Give lenses and ei_pixels, or remove {BINDING!r} from the sidecar if its structure holds"
            )
        return picture


@contextmanager
def picture_rows(
    structure: IIPicture, file: Path, beside: Path, *, named: str | os.PathLike[str]
) -> Iterator[RowWriter]:
    """Write a picture band by band, and its sidecar, into temporary files of `atomic_paths`.

    The sidecar must get its name before the picture: a run that is killed between the two leaves a sidecar that
    `IIPicture.load` refuses, where a new picture beside an old sidecar without a hash would load.

    Parameters
    ----------
    structure : IIPicture
        Picture of the same size and type; its pixels are ignored.
    named : path
        Final name of the picture, for errors.
    """
    # Neighbouring pixels of an elementary image belong to different views. PNG's filters,
    # which predict a pixel from its neighbours, cost time and bytes.
    filtered = (1, 1) in (structure.lenses, structure.ei_pixels)
    dtype = structure.pixels.dtype.name
    with image_rows(file, structure.size, 3, dtype, filtered=filtered, named=named) as write:
        yield write
    beside.write_text(json_text({**structure.structure_json(), BINDING: write.digest}), encoding="utf-8")


def picture_order(pixels: NDArray[Any], lenses: Pair, ei_pixels: Pair) -> NDArray[Any]:
    """Return pixels as ``[l, v, k, u]``, (L, V, K, U, 3), in their order in memory.

    A view, or a copy if they are not contiguous. `IIPicture.light_field` has both lens axes first instead.
    """
    (k, l), (u, v) = lenses, ei_pixels
    return np.ascontiguousarray(pixels).reshape(l, v, k, u, 3)


def sidecar(path: str | os.PathLike[str]) -> Path:
    """Return the path of a picture file's structure: the file's name with ``.json`` appended."""
    return Path(f"{os.fspath(path)}.json")


def peak(dtype: np.dtype[Any]) -> float:
    """Return the largest code value of a pixel type; 1 for linear light."""
    return 1.0 if dtype.kind == "f" else float(np.iinfo(dtype).max)


def codes8(pixels: NDArray[Any]) -> NDArray[np.uint8]:
    """Return 8-bit sRGB of pixels: 16 bits are rounded, linear floats clipped; NaN is black."""
    if pixels.dtype == np.uint8:
        return pixels
    if pixels.dtype == np.uint16:
        return ((pixels.astype(np.uint32) * 255 + 32767) // 65535).astype(np.uint8)
    x = np.clip(np.nan_to_num(pixels), 0, 1)
    return np.rint(255 * srgb(x)).astype(np.uint8)

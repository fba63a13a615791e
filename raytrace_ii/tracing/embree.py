"""Embree by its own functions, from the library that embreex carries: packets of 4, 8 or 16 rays.

embreex binds single rays alone. Its library is used directly if the version is known here and a packet comes back
with the right hits; otherwise `library` returns the reason, and `Intersector` uses embreex's own calls.
"""

from __future__ import annotations

import ctypes
import os
import threading
import weakref
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import embreex.rtcore_scene  # loads the library and what it depends on
import numpy as np
from numpy.typing import NDArray

from .kernels import packets
from .kernels.lanes import PACKET, Work, aligned, work
from .kernels.packets import NO_CALLS, PACKET_ROWS, Calls, Tools, packet_kernels

CONFIGURATION = "RAYTRACE_II_EMBREE"  # environment variable: Embree's device configuration, or "embreex"
# Trees of eight children a node: Embree keeps to four on CPUs that slow down under wide vectors, and takes 5 % longer
# (CPU time of *Car* and *Hairdo*, full setup1, 2026-11-22). The environment variable may say otherwise.
WIDE_TREES = "frequency_level=simd256"
KNOWN_VERSIONS = range(40300, 50000)  # major·10000 + minor·100 + patch; layouts of rtcore_ray.h are those of 4.x
_VERSION, _NATIVE = 0, {16: 34, 8: 33, 4: 32}  # RTCDeviceProperty
_ROBUST, _TRIANGLE, _INDEX, _VERTEX, _UINT3, _FLOAT3 = 1 << 2, 0, 0, 1, 0x5003, 0x9003
_COHERENT = 1 << 16  # RTC_RAY_QUERY_FLAG_COHERENT
_SPARE = 4  # float32 behind a shared buffer's last row: Embree reads 16 bytes at a time
# Largest spread of a coherent packet: wider ones lose to groups of near rays, or to Embree's traversal for rays
# without order (all scenes, scales 1–32 of setup1, 2026-11-22). Sum of the sides of the box around the origins, with
# its growth on the way to the last hit, in median edges of the faces; the same of the directions as a share.
NEAR = {"rtcIntersect": 8.0, "rtcOccluded": 16.0}
NARROW = {"rtcIntersect": 0.25, "rtcOccluded": 0.1}
_SOME_FACES = 10000  # are enough for a median

Floats = NDArray[np.float32]
HitArrays = tuple[NDArray[np.int32], Floats, Floats, Floats]


@dataclass(frozen=True)
class Library:
    """Embree's functions, a device, and the packet width that this CPU runs natively."""

    functions: ctypes.CDLL
    device: int
    version: int
    width: int

    @property
    def about(self) -> str:
        """One line for statistics."""
        major, minor, patch = self.version // 10000, self.version // 100 % 100, self.version % 100
        return f"Embree {major}.{minor}.{patch}, packets of {self.width} rays"


def library() -> Library | str:
    """Embree's library with a device of this process, or the reason why packets cannot be used."""
    with _opening:  # a device does not survive a fork: its threads stay behind
        return _opened(os.environ.get(CONFIGURATION, ""), os.getpid())


_opening = threading.Lock()


@cache
def _opened(configuration: str, process: int) -> Library | str:
    if configuration == "embreex":
        return f"single rays by embreex: {CONFIGURATION} is set to embreex"
    try:
        functions = _declared(ctypes.CDLL(str(_file())))
    except (OSError, AttributeError) as error:
        return f"single rays by embreex: its Embree library cannot be called directly ({error})"
    device = functions.rtcNewDevice(f"{WIDE_TREES},{configuration}".strip(",").encode())
    if not device:
        return f"single rays by embreex: Embree refuses the configuration {configuration!r} of {CONFIGURATION}"
    version = functions.rtcGetDeviceProperty(device, _VERSION)
    if version not in KNOWN_VERSIONS:
        return f"single rays by embreex: Embree's version {version} is not known, 4.3 or a later 4 is needed"
    width = next((w for w, native in _NATIVE.items() if functions.rtcGetDeviceProperty(device, native)), 0)
    if not width:
        return "single rays by embreex: this Embree has no native packets"
    opened = Library(functions, device, version, width)
    if not _layouts_hold(opened):
        return f"single rays by embreex: packets of Embree {version} come back with wrong hits"
    return opened


def _file() -> Path:
    """The library that embreex carries: beside it on Linux and Windows, within it on macOS."""
    package = Path(embreex.rtcore_scene.__file__).parent
    for folder in (package.parent / "embreex.libs", package / ".dylibs", package):
        for file in sorted(folder.glob("*embree4*")):
            return file
    raise OSError(f"no embree4 library beside {package}")


def _declared(functions: ctypes.CDLL) -> ctypes.CDLL:
    """The functions with their types."""
    pointer, size, number, count = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int, ctypes.c_uint
    for name, result, arguments in (
        ("rtcNewDevice", pointer, [ctypes.c_char_p]),
        ("rtcGetDeviceProperty", ctypes.c_ssize_t, [pointer, number]),
        ("rtcGetDeviceError", number, [pointer]),
        ("rtcNewScene", pointer, [pointer]),
        ("rtcSetSceneFlags", None, [pointer, number]),
        ("rtcNewGeometry", pointer, [pointer, number]),
        ("rtcSetSharedGeometryBuffer", None, [pointer, number, count, number, pointer, size, size, size]),
        ("rtcCommitGeometry", None, [pointer]),
        ("rtcAttachGeometry", count, [pointer, pointer]),
        ("rtcReleaseGeometry", None, [pointer]),
        ("rtcCommitScene", None, [pointer]),
        ("rtcReleaseScene", None, [pointer]),
        *((f"{kind}{width}", None, [pointer] * 4) for kind in ("rtcIntersect", "rtcOccluded") for width in _NATIVE),
    ):
        function = getattr(functions, name)
        function.restype, function.argtypes = result, arguments
    return functions


class Tree:
    """An Embree scene of one geometry, whose primitive number is the row of a face in (F, 3, 3) corners.

    Rays go in packets in their order. A packet that spreads more than `NEAR` or `NARROW` is parted: groups of half a
    packet that are four times nearer are traced coherently, the others at once without coherence.

    Raises
    ------
    MemoryError
        If Embree cannot build the tree.
    """

    def __init__(self, library: Library, corners: Floats, robust: bool) -> None:
        self.library = library
        self.corners = with_spare(corners)  # Embree keeps no copy
        self._indices = np.arange(corners.size // 3 + _SPARE, dtype=np.uint32)
        some = self.corners[:: len(corners) // _SOME_FACES + 1]
        edges = np.linalg.norm(some - np.roll(some, 1, axis=1), axis=2)
        self._edge = float(np.median(edges)) if edges.size else 0.0
        f = library.functions
        self._scene = f.rtcNewScene(library.device)
        weakref.finalize(self, f.rtcReleaseScene, self._scene).atexit = False
        f.rtcSetSceneFlags(self._scene, _ROBUST if robust else 0)
        geometry = f.rtcNewGeometry(library.device, _TRIANGLE)
        for kind, layout, array, rows in (
            (_VERTEX, _FLOAT3, self.corners, corners.size // 3),
            (_INDEX, _UINT3, self._indices, len(corners)),
        ):
            f.rtcSetSharedGeometryBuffer(geometry, kind, 0, layout, array.ctypes.data, 0, 12, rows)
        f.rtcCommitGeometry(geometry)
        f.rtcAttachGeometry(self._scene, geometry)
        f.rtcReleaseGeometry(geometry)
        f.rtcCommitScene(self._scene)
        if error := f.rtcGetDeviceError(library.device):
            raise MemoryError(f"Embree cannot build the tree of {len(corners)} faces: error {error}")
        self._arguments = aligned(32).view(np.uint32).reshape(2, 16)
        self._arguments[:, 1] = 0xFFFFFFFF  # every feature
        self._arguments[0, 0] = _COHERENT
        self._rooms = threading.local()

    def nearest(
        self,
        origins: Floats,
        directions: Floats,
        reach: Floats,
        out: HitArrays,
    ) -> None:
        """Fill row of the face (−1 on a miss), u, v and distance of the nearest hit; no ``reach`` is no end."""
        packet_kernels(self.library.width)[0](*self._room(), origins, directions, reach, *out)

    def occluded(self, origins: Floats, directions: Floats, reach: Floats, out: NDArray[np.int32]) -> None:
        """Fill 0 where something is hit within reach, −1 where not."""
        packet_kernels(self.library.width)[1](*self._room(), origins, directions, reach, out)

    def few(self, function: str, origins: Floats, directions: Floats, reach: float) -> HitArrays:
        """As `nearest`, or of ``rtcOccluded`` with distances below 0 where something is hit, without a kernel.

        Neither the few rays that choose a packet's rays nor those of `_layouts_hold` are worth compiling one.
        """
        n, width, (active, _) = len(origins), self.library.width, lane_masks()
        packet = aligned(PACKET_ROWS * width).reshape(-1, width)
        numbers, call = packet.view(np.int32), getattr(self.library.functions, f"{function}{width}")
        faces, (u, v, distances) = np.empty(n, np.int32), np.empty((3, n), np.float32)
        for first in range(0, n, width):
            some = slice(first, min(first + width, n))
            lanes = some.stop - first
            packet[:] = 0
            packet[:3, :lanes], packet[packets.DIRECTION :, :lanes][:3] = origins[some].T, directions[some].T
            packet[packets.FAR] = reach
            numbers[[packets.MASK, packets.GEOMETRY, packets.INSTANCE]] = -1
            active[:width] = np.where(np.arange(width) < lanes, -1, 0)
            call(active.ctypes.data, self._scene, packet.ctypes.data, self._arguments[1].ctypes.data)
            faces[some] = np.where(numbers[packets.GEOMETRY] >= 0, numbers[packets.FACE], -1)[:lanes]
            for out, row in ((u, packets.U), (v, packets.V), (distances, packets.FAR)):
                out[some] = packet[row, :lanes]
        return faces, u, v, distances

    def _room(self) -> tuple[Tools, Work]:
        """Calls and room for rays, which threads must not share: kept for each of them."""
        kept: dict[str, Any] = vars(self._rooms)
        if not kept:
            room, (active, chosen) = work(), lane_masks()
            packet = room.single[PACKET:]
            nearest, stop = (self.calls(name, active, packet) for name in ("rtcIntersect", "rtcOccluded"))
            kept["room"] = Tools(nearest, stop, NO_CALLS, active, chosen), room
        found: tuple[Tools, Work] = kept["room"]
        return found

    def calls(self, function: str, active: NDArray[np.int32], packet: Floats) -> Calls:
        """What a function is called with for packets in memory of the caller, which threads must not share."""
        entry = getattr(self.library.functions, f"{function}{self.library.width}")
        return Calls(
            ctypes.cast(entry, ctypes.c_void_p).value or 0, self._scene, self._arguments[0].ctypes.data,
            self._arguments[1].ctypes.data, active.ctypes.data, packet.ctypes.data,
            np.float32(NEAR[function] * self._edge), np.float32(NARROW[function]),
        )  # fmt: skip


def with_spare(corners: Floats) -> Floats:
    """Return corners (F, 3, 3), copied if no memory that may be read follows behind them."""
    base = corners.base
    if isinstance(base, np.ndarray) and corners.flags.c_contiguous and corners.dtype == np.float32:
        end = corners.ctypes.data + corners.nbytes + _SPARE * corners.itemsize
        if base.flags.c_contiguous and end <= base.ctypes.data + base.nbytes:
            return corners
    room = np.empty(corners.size + _SPARE, np.float32)
    room[: corners.size] = corners.reshape(-1)
    return room[: corners.size].reshape(corners.shape)


def lane_masks() -> NDArray[np.int32]:
    """Two rows of 16 zeros, aligned as Embree needs them: which lanes are traced, and which are left."""
    return aligned(32).view(np.int32).reshape(2, 16)


def _layouts_hold(library: Library) -> bool:
    """Whether a packet with a lane to spare finds the right faces at the right places.

    Two triangles share the hypotenuse of a square at z = 4; every second ray starts beside the square.
    """
    square = np.array([[[0, 0, 4], [8, 0, 4], [0, 8, 4]], [[8, 8, 4], [0, 8, 4], [8, 0, 4]]], np.float32)
    n = library.width - 1
    x = np.linspace(1, 7, n, dtype=np.float32)
    beside = np.arange(n) % 2 == 1
    origins = np.column_stack([x + 100 * beside, np.full(n, 2), np.zeros(n)]).astype(np.float32)
    directions = np.tile(np.array([0, 0, 2], np.float32), (n, 1))
    tree = Tree(library, square, robust=True)
    faces, u, v, distances = tree.few("rtcIntersect", origins, directions, 3)
    blocked = np.where(tree.few("rtcOccluded", origins, directions, 3)[3] < 0, 0, -1)
    second = x > 6
    right_u, right_v = np.where(second, (8 - x) / 8, x / 8), np.where(second, 0.75, 0.25)
    return (
        np.array_equal(faces, np.where(beside, -1, second))
        and np.array_equal(blocked, np.where(beside, -1, 0))
        and all(
            np.allclose(found[~beside], right[~beside], atol=1e-4)
            for found, right in ((u, right_u), (v, right_v), (distances, np.full(n, 2)))
        )
    )

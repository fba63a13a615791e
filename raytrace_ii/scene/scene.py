"""Scene: bodies, materials, lights and surroundings, validated on construction."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ii_core.base import checks

from .textures import Image, Texture, VertexColours

Vector = tuple[float, float, float]


def _numbers(what: str, value: Any, count: int = 3, least: float = -math.inf) -> None:
    """Raise ValueError unless a value is ``count`` finite numbers of at least ``least``."""
    checks.numbers(what, value)
    numbers = np.asarray(value, np.float64) if np.ndim(value) == 1 else np.empty(0)
    if numbers.shape != (count,) or not (np.isfinite(numbers).all() and (numbers >= least).all()):
        floor = f" of at least {least:g}" if least > -math.inf else ""
        raise ValueError(f"{what} is {value}: {count} finite numbers{floor} are needed")


def _number(what: str, value: float, least: float, *, above: bool = False) -> None:
    """Raise ValueError unless a number is finite and at least ``least``; with ``above``, greater."""
    value = checks.number(what, value)
    if not (least < value < math.inf or (value == least and not above)):
        raise ValueError(
            f"{what} is {value}: a finite number {'above' if above else 'of at least'} {least:g} is needed"
        )


def texture_rule(name: str, value: Any) -> None:
    """Rule: a texture."""
    if not hasattr(value, "on_surface"):
        raise checks.refuse(name, value, "a texture")


def unit_rows(vectors: Any) -> NDArray[np.float64]:
    """Return vectors (..., 3) of length 1; zero stays zero."""
    rows = np.asarray(vectors, np.float64)
    length = np.linalg.norm(rows, axis=-1, keepdims=True)
    return np.asarray(np.divide(rows, length, out=np.zeros_like(rows), where=length > 0))


@dataclass(frozen=True, kw_only=True)
class Material:
    """Whitted material of a surface. Colours are linear.

    The matt share is 1 − ``mirror`` − ``transmission``, which conserves energy.

    Parameters
    ----------
    colour : (3,)
        Diffuse and ambient reflectance, multiplied by the texture.
    specular, shininess : float
        Strength and exponent of the Blinn–Phong highlight. With a metallic-roughness map both follow from the map and
        ``specular`` is a factor.
    mirror : (3,)
        Share of light in mirror reflection.
    roughness : float
        Roughness of the reflection, 0 to 1: a GGX lobe of α = roughness² with single scattering; 0 is a sharp mirror.
        Refraction is always sharp.
    metallic : float
        Share of metal in the surface, 0 to 1. Metal reflects ``colour`` times the texture and has no matt share,
        transmission or ``mirror``.
    metallic_roughness_map : Image, optional
        As `texture.metallic_roughness_map` reads it: green multiplies ``roughness``, blue ``metallic``.
    transmission : (3,)
        Share of light at each face that is split into reflection and refraction by the Fresnel equations. A pane has
        two faces.
    ior : float or (3,)
        Index of refraction of the body; three numbers for red, green and blue give dispersion.
    absorption_per_mm : (3,)
        Beer–Lambert coefficient inside the body.
    texture : Texture, optional
    emission : (3,)
        Light emitted on both sides, of any strength. It does not illuminate other surfaces.
    emission_map : Image, optional
        Factor of the emission.
    normal_map : Image, optional
        As `texture.normal_map` reads it. Maps need (u, v); a texture beside them must be one on the surface, too.
    normal_scale : float
        Factor of the map's x and y.
    alpha_cutoff : float
        Surface points whose texture alpha is below it are cut out; 0 for no cut-outs.
    alpha_blend : float
        Coverage of the surface, multiplied by the texture's alpha if any; the rest of the light passes straight. 0
        for no blending.
    priority : int
        In overlapping transmissive bodies the one of higher priority counts (Schmidt and Budge 2002); of equal ones
        the one entered first.

    Raises
    ------
    ValueError
        If a value is out of range, or cut-outs lack a texture with alpha.
    """

    colour: Vector = (0.8, 0.8, 0.8)
    specular: float = 0.0
    shininess: float = 50.0
    mirror: Vector = (0.0, 0.0, 0.0)
    roughness: float = 0.0
    metallic: float = 0.0
    metallic_roughness_map: Image | None = None
    transmission: Vector = (0.0, 0.0, 0.0)
    ior: float | Vector = 1.5
    absorption_per_mm: Vector = (0.0, 0.0, 0.0)
    texture: Texture | None = None
    emission: Vector = (0.0, 0.0, 0.0)
    emission_map: Image | None = None
    normal_map: Image | None = None
    normal_scale: float = 1.0
    alpha_cutoff: float = 0.0
    alpha_blend: float = 0.0
    priority: int = 0

    def __post_init__(self) -> None:
        checks.check_fields(self, texture=texture_rule, ior=checks.numbers)
        for what in ("colour", "mirror", "transmission", "absorption_per_mm", "emission"):
            _numbers(what, getattr(self, what), least=0)
        _number("specular", self.specular, 0)
        _number("shininess", self.shininess, 0, above=True)
        for ior in self.iors:
            _number("ior", ior, 0, above=True)
        if max(self.mirror) + max(self.transmission) > 1 + 1e-9:
            raise ValueError(
                f"mirror {max(self.mirror):g} and transmission {max(self.transmission):g} "
                "are more than all the light: at most 1 together is needed"
            )
        _number("normal_scale", self.normal_scale, 0)
        for what in ("roughness", "metallic", "alpha_cutoff", "alpha_blend"):
            checks.within(what, getattr(self, what), 0, 1)
        if self.metallic > 0 and max(self.colour) > 1:
            raise ValueError(f"colour is {self.colour}: at most 1 is needed of a metal, which mirrors it")
        if self.alpha_cutoff > 0 and (not isinstance(self.texture, Image) or self.texture.alpha is None):
            raise ValueError(f"alpha_cutoff is {self.alpha_cutoff}: an image texture with alpha is needed")
        if not isinstance(self.priority, int | np.integer):
            raise ValueError(f"priority is {self.priority!r}: a whole number is needed")
        shares = self.texture is None or (self.texture.on_surface and not isinstance(self.texture, VertexColours))
        for what, image in self.maps.items():
            if image is not None and not shares:
                raise ValueError(f"{what} needs a texture on the surface or none: they share (u, v)")

    @property
    def iors(self) -> Vector:
        """Index of refraction for red, green and blue."""
        if np.ndim(self.ior) == 0:
            return (self.ior,) * 3  # type: ignore[return-value]
        _numbers("ior", self.ior)
        return self.ior  # type: ignore[return-value]

    @property
    def maps(self) -> dict[str, Image | None]:
        """Maps over (u, v) by field."""
        return {
            "a normal map": self.normal_map,
            "an emission map": self.emission_map,
            "a metallic-roughness map": self.metallic_roughness_map,
        }

    @property
    def textures(self) -> list[Texture]:
        """The texture and the maps that there are."""
        return [image for image in (self.texture, *self.maps.values()) if image is not None]

    @property
    def reflects(self) -> bool:
        return max(self.mirror) > 0 or self.metallic > 0 or self.transmissive

    @property
    def has_holes(self) -> bool:
        """Whether rays may pass the surface unbent."""
        return self.alpha_cutoff > 0 or self.alpha_blend > 0

    @property
    def transmissive(self) -> bool:
        return max(self.transmission) > 0

    @property
    def fills(self) -> bool:
        """Whether light is another within the body, so that its mesh must have an inside."""
        return self.transmissive and (set(self.iors) != {1.0} or max(self.absorption_per_mm) > 0)


LIGHTS = ("point", "directional", "spot")


@dataclass(frozen=True, kw_only=True)
class Light:
    """Light in the scene's frame, mm, without falloff over distance.

    Parameters
    ----------
    kind : {"point", "directional", "spot"}
    vector : (3,)
        Position of a point or spot light, or direction of a directional light.
    colour : (3,)
        Linear.
    direction : (3,)
        Axis of a spot light.
    cone_deg : (inner, outer)
        Half angles of a spot light. It has full strength within the inner cone, none outside the outer cone, and
        ((cos θ − cos outer)/(cos inner − cos outer))² between them, as in glTF's KHR_lights_punctual.

    Raises
    ------
    ValueError
        If the kind is unknown or a value is out of range.
    """

    kind: str
    vector: Vector
    colour: Vector
    direction: Vector = (0.0, 0.0, 1.0)
    cone_deg: tuple[float, float] = (0.0, 45.0)

    def __post_init__(self) -> None:
        if not isinstance(self.kind, str) or self.kind not in LIGHTS:
            raise ValueError(f"kind: unknown light {self.kind!r}: known are {', '.join(LIGHTS)}")
        _numbers(f"vector of a {self.kind} light", self.vector)
        _numbers(f"colour of a {self.kind} light", self.colour, least=0)
        _numbers(f"direction of a {self.kind} light", self.direction)
        if self.kind == "directional" and not math.hypot(*self.vector) > 0:
            raise ValueError("a directional light has the direction zero: a direction is needed")
        if self.kind == "spot" and not math.hypot(*self.direction) > 0:
            raise ValueError("a spot light has the direction zero: a direction is needed")
        _numbers("cone_deg", self.cone_deg, 2, least=0)
        if not self.cone_deg[0] < self.cone_deg[1] <= 90:
            raise ValueError(f"cone_deg is {self.cone_deg}: an inner angle below the outer, at most 90, is needed")


@dataclass(frozen=True, kw_only=True)
class Background:
    """Background: a gradient, or an image of all directions, in linear colours.

    Parameters
    ----------
    horizon, zenith, nadir : (3,)
        Colours of the gradient. It is linear in the sine of the elevation, up to ``spread_deg`` above and below.
    image : Image, optional
        Equirectangular image in place of the gradient. Its centre is at +z, its top row at +y, +x is right of the
        centre, and its left and right edges meet at −z.
    turn_deg : float
        Rotation of the image about y, +z towards +x; 90 turns its centre to +x.
    intensity : float
        Factor of the image.

    Raises
    ------
    ValueError
        If a value is out of range.
    """

    horizon: Vector = (0.0, 0.0, 0.0)
    zenith: Vector = (0.0, 0.0, 0.0)
    nadir: Vector = (0.0, 0.0, 0.0)
    spread_deg: float = 90.0
    image: Image | None = None
    turn_deg: float = 0.0
    intensity: float = 1.0

    def __post_init__(self) -> None:
        for what in ("horizon", "zenith", "nadir"):
            _numbers(f"{what} of the background", getattr(self, what), least=0)
        if not 0 < checks.number("spread_deg", self.spread_deg) <= 90:
            raise ValueError(f"spread_deg of the background is {self.spread_deg}: above 0, at most 90 is needed")
        if not math.isfinite(checks.number("turn_deg", self.turn_deg)):
            raise ValueError(f"turn_deg of the background is {self.turn_deg}: a finite number is needed")
        _number("intensity of the background", self.intensity, 0)


@dataclass(frozen=True, kw_only=True)
class Fog:
    """Fog: light over a distance t has the share exp(−density·t); the rest is ``colour`` (linear).

    It fills all space outside transmissive bodies, for reflected and refracted rays, too. It does not change lights
    and the background. With the colour of the horizon, distant objects fade into it.
    """

    colour: Vector
    density_per_mm: float

    def __post_init__(self) -> None:
        _numbers("colour of the fog", self.colour, least=0)
        if not 0 < checks.number("density_per_mm", self.density_per_mm) < math.inf:
            raise ValueError(f"density_per_mm of the fog is {self.density_per_mm}: more than 0 is needed")


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Body:
    """Object: a triangle mesh in scene coordinates (mm) with its material.

    Parameters
    ----------
    vertices : ndarray, (V, 3)
    faces : ndarray of int, (F, 3)
        Counter-clockwise about the outward normal: (v1 − v0) × (v2 − v0) points outwards.
    normals : ndarray, (V, 3), optional
        Vertex normals for smooth shading, of any length; None for flat shading.
    texture_coordinates : ndarray, (V, 3), optional
        (u, v, 0) for textures on the surface and for maps; positions in the body's frame for solid textures; linear
        colours for vertex colours.

    Raises
    ------
    ValueError
        If there is no geometry, array sizes differ, or the material needs missing coordinates.
    """

    name: str
    vertices: NDArray[Any]
    faces: NDArray[Any]
    material: Material
    normals: NDArray[Any] | None = None
    texture_coordinates: NDArray[Any] | None = None

    def __post_init__(self) -> None:
        numbers, owner = checks.numbers, checks.instance(Material)
        checks.check_fields(
            self, name=checks.text, vertices=numbers, faces=numbers, material=owner, normals=numbers,
            texture_coordinates=numbers,
        )  # fmt: skip
        vertices, faces = np.asarray(self.vertices), np.asarray(self.faces)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3 or not len(faces):
            raise ValueError(f"object {self.name!r} has no geometry: triangles are needed")
        most = np.finfo(np.float32).max
        if len(vertices) and not (-most <= vertices.min() and vertices.max() <= most):  # NaN, too
            bad = ~(np.abs(vertices) <= most).all(axis=1)
            at = int(np.argmax(bad))
            raise ValueError(
                f"object {self.name!r}: vertex {at} is {vertices[at].tolist()}: finite float32 numbers are needed"
            )
        if faces.min() < 0 or faces.max() >= len(vertices):
            raise ValueError(
                f"object {self.name!r}: a face names vertex {faces.max() if faces.min() >= 0 else faces.min()}, "
                f"there are {len(vertices)}"
            )
        for what in ("normals", "texture_coordinates"):
            value = getattr(self, what)
            if value is not None and np.shape(value) != vertices.shape:
                raise ValueError(f"object {self.name!r}: {what} are {np.shape(value)}, vertices {vertices.shape}")
            if value is not None and not np.isfinite(value).all():
                at = int(np.argmin(np.isfinite(value).all(axis=1)))
                raise ValueError(
                    f"object {self.name!r}: {what} of vertex {at} are {np.asarray(value)[at].tolist()}: "
                    "finite numbers are needed"
                )
        for what, image in self.material.maps.items():
            if image is not None and self.texture_coordinates is None:
                raise ValueError(f"object {self.name!r}: {what} needs texture coordinates, there are none")

    def __repr__(self) -> str:
        return f"Body({self.name!r}, {len(self.faces)} triangles)"


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Scene:
    """Bodies, lights and surroundings, in millimetres in the camera's frame (x right, y up, z away).

    Raises
    ------
    ValueError
        If there is no body, ``max_depth`` is negative, or ``ambient`` is not a colour.
    """

    bodies: Sequence[Body]
    lights: Sequence[Light] = ()
    background: Background = field(default_factory=Background)
    fog: Fog | None = None
    ambient: Vector = (0.0, 0.0, 0.0)
    max_depth: int = 6
    name: str = ""

    def __post_init__(self) -> None:
        for what, kind in (("bodies", Body), ("lights", Light)):
            checks.list_of(kind)(what, getattr(self, what))
        checks.check_fields(self, background=checks.instance(Background), fog=checks.instance(Fog), name=checks.text)
        if not self.bodies:
            raise ValueError(f"scene {self.name!r} has no geometry: at least one object is needed")
        if not checks.whole("max_depth", self.max_depth) >= 0:
            raise ValueError(f"max_depth is {self.max_depth}: at least 0 is needed")
        _numbers("ambient", self.ambient, least=0)
        # Order: opaque bodies, bodies with holes, transmissive bodies. Shadow rays are tested against the opaque
        # prefix alone.
        ordered = sorted(self.bodies, key=lambda b: (b.material.transmissive, b.material.has_holes))
        object.__setattr__(self, "bodies", tuple(ordered))

    @property
    def about(self) -> str:
        """Name and numbers of bodies, triangles and lights in one line."""
        triangles = sum(len(body.faces) for body in self.bodies)
        return (
            f"{self.name or 'scene'}: {len(self.bodies)} bodies of {triangles} triangles, {len(self.lights)} lights"
        )

    def __repr__(self) -> str:
        return f"Scene({self.about})"

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{html.escape(body.name)}</td><td>{len(body.faces)}</td><td>{size}</td></tr>"
            for body in self.bodies
            for size in ["×".join(f"{side:.4g}" for side in np.ptp(np.asarray(body.vertices), axis=0))]
        )
        head = "<tr><th>body</th><th>triangles</th><th>size, mm</th></tr>"
        return f"<details><summary>{html.escape(self.about)}</summary><table>{head}{rows}</table></details>"

    def with_depth(self, max_depth: int) -> Scene:
        """Return the scene with another recursion depth."""
        return replace(self, max_depth=max_depth)

    @property
    def bounds_mm(self) -> NDArray[np.float64]:
        """Return the least and greatest corner, (2, 3)."""
        every = np.concatenate([np.asarray(b.vertices, np.float64) for b in self.bodies])
        return np.stack([every.min(axis=0), every.max(axis=0)])

"""Materials of glTF 2.0 as Whitted materials.

With base colour b, metallic m, roughness r, transmission t, index of refraction n and F0 = ((n − 1)/(n + 1))² ·
specular strength and colour:

==========================  ==========================================================================================
``metallic, roughness``     m and r: a GGX lobe of α = r² per texel, single scattering (glTF, appendix B)
``mirror``                  (1 − t)·F0 of the part that is not metal; constant over the angle, no Schlick term
matt share × ``colour``     (1 − m)(1 − t)·b·(1 − F0): light reflected by a dielectric does not reach its pigment
``transmission``            (1 − m)·t·b, which the tracer divides by exact Fresnel
``shininess``               2/r⁴ − 2, r at least 0.05: a lobe as wide as a microfacet lobe of α = r² (Karis 2013); at
                            half height up to 1.3 times as wide as GGX, without its tails
``specular``                mean of m·b + (1 − m)·F0, times (1 − r)(shininess + 2)/8, at most 1: Blinn–Phong,
                            normalised at normal incidence; zero if matt; at most as bright as the light
``absorption_per_mm``       −ln(attenuationColor)/attenuationDistance, per unit of the file over ``scale``
``ior`` of a thin sheet     1, and t(1 − m)·F0 more of mirror: a sheet without an interior does not refract light
``ior``, dispersion         three indices n ± (n − 1)·dispersion/40: 20/dispersion is the Abbe number
==========================  ==========================================================================================
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...scene.scene import Material
from ...scene.textures import Image, VertexColours, image_texture, metallic_roughness_map, normal_map
from ...tracing.kernels.glossy import highlight
from .container import GltfFile
from .tables import PbrMaterial, Sampler, TextureInfo, TextureSource

NEAREST = 9728
READERS: dict[str, Callable[[NDArray[Any]], Image]] = {
    "colour": image_texture,
    "emission_map": image_texture,
    "normal_map": normal_map,
    "metallic_roughness_map": metallic_roughness_map,
}
WRAPS = {10497: "repeat", 33648: "mirror", 33071: "clamp"}
Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Look:
    """A material, and where on a primitive its images lie: set ``uv_set`` of texture coordinates, moved by ``uv``.

    ``uv`` (2, 3) takes glTF's (u, v, 1), v down, to ours, v up.
    """

    material: Material
    uv_set: int | None = None
    uv: Array | None = None


def surface(
    base: Array, metallic: float, roughness: float, reflectance: Array, transmission: float, *,
    thin: bool = False, tint: Array | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Whitted's shares and highlight of a metallic–roughness surface.

    Parameters
    ----------
    base : ndarray, (3,)
        Linear base colour, that a texture may multiply; ``tint`` is the same with the texture's mean, for what a
        texture cannot colour here: glass and the highlight.
    metallic, roughness, transmission : float
    reflectance : ndarray, (3,)
        F0 of the dielectric.
    thin : bool
        A sheet without a body: light goes straight through.

    Returns
    -------
    dict
        Parameters of `Material`. What is not metal has the shares ``mirror``, ``transmission`` and the rest, matt.
    """
    tint = base if tint is None else tint
    mirror, through = (1 - transmission) * reflectance, transmission * tint
    if thin:
        mirror, through = mirror + transmission * reflectance, through * (1 - reflectance)
    matt = (1 - transmission) * base * (1 - reflectance)
    left = 1 - mirror.max() - through.max()  # by which the tracer multiplies the colour
    colour = matt / left if left > 1e-6 else 0 * matt
    f0 = float(np.mean(metallic * tint + (1 - metallic) * reflectance))
    specular, shininess = highlight(f0, roughness)
    return {
        "colour": _vector(base if metallic > 0 else colour),  # of metal it is what is mirrored
        "mirror": _vector(mirror),
        "roughness": roughness,
        "metallic": metallic,
        "transmission": _vector(through),
        "specular": specular,
        "shininess": shininess,
    }


def _vector(values: Array) -> tuple[float, float, float]:
    r, g, b = (float(v) for v in np.clip(values, 0, 1))
    return r, g, b


class Looks:
    """The materials of one file, each made once. ``note`` is told of what is left out."""

    def __init__(self, file: GltfFile, note: Callable[[str], None]) -> None:
        self.file, self.note = file, note
        self._made: dict[tuple[int | None, bool], Look | None] = {}
        self._images: dict[tuple[int, str, tuple[str, str]], Image] = {}

    def look(self, index: int | None, coloured: bool, who: str) -> Look | None:
        """A material by its index, ``coloured`` if the vertices have colours; None if it cannot be seen at all."""
        key = index, coloured
        if key not in self._made:
            stored = PbrMaterial() if index is None else self.file.at("materials", index, who)
            self._made[key] = self._look(stored, coloured, f"materials.{index}")
        return self._made[key]

    def _look(self, stored: PbrMaterial, coloured: bool, where: str) -> Look | None:
        pbr, more = stored.pbrMetallicRoughness, stored.extensions
        base, alpha = np.array(pbr.baseColorFactor[:3]), pbr.baseColorFactor[3]
        picture = self._image(pbr.baseColorTexture, "colour", where)
        if picture is not None and coloured:
            self.note("vertex colours under a texture")
        images, place = self._maps(stored, picture, coloured, where)
        values = self._surface(stored, base, picture, "metallic_roughness_map" in images, where)
        cutoff = blend = 0.0
        has_alpha = picture is not None and picture.alpha is not None and bool(picture.alpha.min() < 1)
        if stored.alphaMode == "MASK":
            if not has_alpha and alpha < stored.alphaCutoff:
                return None
            cutoff = stored.alphaCutoff / alpha if has_alpha and alpha > 0 else 0.0
            if cutoff > 1 or (has_alpha and alpha == 0 < stored.alphaCutoff):
                return None
        elif stored.alphaMode == "BLEND":
            if alpha == 0:
                return None
            blend = alpha if has_alpha or alpha < 1 else 0.0
        if more.KHR_materials_unlit is not None:
            values |= {"mirror": (0.0, 0.0, 0.0), "metallic": 0.0, "specular": 0.0, "colour": (0.0, 0.0, 0.0)}
            images = {"emission_map": picture} if picture is not None else {}
            if picture is None and coloured:
                self.note("KHR_materials_unlit with vertex colours (lit as matt)")
                values["colour"] = _vector(base)
            else:
                values["emission"] = _strength(base)
        elif "emission_map" in images or stored.emissiveTexture is None:
            strength = more.KHR_materials_emissive_strength.emissiveStrength
            values["emission"] = _strength(np.array(stored.emissiveFactor) * strength)
        texture: Any = picture if picture is not None else VertexColours() if coloured else None
        if "normal_map" in images and stored.normalTexture is not None:
            values["normal_scale"] = max(stored.normalTexture.scale, 0.0)
        material = Material(**values, **images, texture=texture, alpha_cutoff=cutoff, alpha_blend=blend)
        return Look(material, *(_placed(place) if place is not None and (images or picture is not None) else ()))

    def _maps(
        self, stored: PbrMaterial, picture: Image | None, coloured: bool, where: str
    ) -> tuple[dict[str, Any], TextureInfo | None]:
        """Images beside the base colour's that lie where the first image does, by the fields that they fill."""
        pbr = stored.pbrMetallicRoughness
        first, place = ("baseColorTexture", pbr.baseColorTexture) if picture is not None else ("", None)
        images: dict[str, Any] = {}
        for key, what, info in (
            ("metallic_roughness_map", "metallicRoughnessTexture", pbr.metallicRoughnessTexture),
            ("emission_map", "emissiveTexture", stored.emissiveTexture if any(stored.emissiveFactor) else None),
            ("normal_map", "normalTexture", stored.normalTexture),
        ):
            if info is None:
                continue
            if coloured and picture is None:
                self.note(f"{what} over vertex colours")
                continue
            if place is not None and not _same_place(place, info):
                self.note(f"{what} on other texture coordinates than {first}")
                continue
            if key == "normal_map" and info.scale < 0:
                self.note("a negative scale of a normalTexture (taken as 0)")
            image = self._image(info, key, where)
            if image is not None:
                images[key] = image
                first, place = (first, place) if place is not None else (what, info)
        return images, place

    def _surface(
        self, stored: PbrMaterial, base: Array, picture: Image | None, mapped: bool, where: str
    ) -> dict[str, Any]:
        """Shares, highlight and body of a material; ``mapped`` if metal and roughness have a map."""
        pbr, more = stored.pbrMetallicRoughness, stored.extensions
        metallic, roughness = pbr.metallicFactor, pbr.roughnessFactor
        if not mapped:
            mean = self._mean(pbr.metallicRoughnessTexture, "metallicRoughnessTexture", where)
            roughness, metallic = float(roughness * mean[1]), float(metallic * mean[2])
        ior = more.KHR_materials_ior.ior
        gloss = more.KHR_materials_specular
        strength = gloss.specularFactor * self._mean(gloss.specularTexture, "specularTexture", where)[3]
        hue = self._mean(gloss.specularColorTexture, "specularColorTexture", where, srgb=True)[:3]
        hue = hue * np.array(gloss.specularColorFactor)
        f0 = ((ior - 1) / (ior + 1)) ** 2 if ior > 0 else 1.0
        clear = more.KHR_materials_transmission
        through = clear.transmissionFactor * self._mean(clear.transmissionTexture, "transmissionTexture", where)[0]
        volume = more.KHR_materials_volume
        self._mean(volume.thicknessTexture, "thicknessTexture", where)  # a body is as thick as it is
        thin = not volume.thicknessFactor > 0
        tint = base * picture.pixels.mean(axis=(0, 1)) if picture is not None else base
        values = surface(base, metallic, roughness, np.minimum(f0 * hue, 1) * strength, through, thin=thin, tint=tint)
        if mapped:
            values["specular"] = 1.0  # a factor of what the map says
        if through > 0:
            spread = (ior - 1) * 0.025 * more.KHR_materials_dispersion.dispersion
            index = max(ior, 1.0)
            values["ior"] = 1.0 if thin else (max(index - spread, 1.0), index, index + spread) if spread else index
            if not thin and volume.attenuationDistance is not None:
                kept = np.maximum(volume.attenuationColor, 1e-6)
                values["absorption_per_mm"] = tuple(float(a) for a in -np.log(kept) / volume.attenuationDistance)
        return values

    def _image(self, info: TextureInfo | None, use: str, where: str) -> Image | None:
        """An image texture for colour or normals, one object for each use and wrapping of an image."""
        source = self._source(info, where)
        if source is None:
            return None
        assert info is not None
        wrap = self._wrap(info, where)
        key = source, use, wrap
        if key not in self._images:
            pixels = self.file.image(source, where)
            make = READERS[use]
            try:
                self._images[key] = replace(make(pixels), wrap=wrap)
            except ValueError as error:
                raise ValueError(f"images.{source}: {error}") from None
        return self._images[key]

    def _source(self, info: TextureInfo | None, where: str) -> int | None:
        """Index of a texture's image."""
        if info is None:
            return None
        texture: TextureSource = self.file.at("textures", info.index, where)
        if texture.source is None:
            self.note("textures without an image that can be read")
        elif why := self.file.missing(texture.source, where):
            self.note(f"images.{texture.source} ({why})")
            return None
        return texture.source

    def _mean(self, info: TextureInfo | None, what: str, where: str, *, srgb: bool = False) -> Array:
        """Mean RGBA, linear, of a texture that has no place here; 1 where there is none."""
        source = self._source(info, where)
        if source is None:
            return np.ones(4)
        self.note(f"{what} (its mean is used)")
        pixels = self.file.image(source, where)
        channels = pixels.shape[2]
        peak = np.iinfo(pixels.dtype).max if pixels.dtype.kind == "u" else 1
        values = pixels.reshape(-1, channels).mean(axis=0) / peak
        colour = values[:3] if channels >= 3 else values[[0, 0, 0]]
        if srgb:
            colour = image_texture(pixels).pixels.mean(axis=(0, 1))
        return np.append(colour, values[-1] if channels in (2, 4) else 1.0)

    def _wrap(self, info: TextureInfo, where: str) -> tuple[str, str]:
        """Wrap mode of a texture along u and v."""
        texture: TextureSource = self.file.at("textures", info.index, where)
        if texture.sampler is None:
            return "repeat", "repeat"
        sampler: Sampler = self.file.at("samplers", texture.sampler, where)
        if sampler.magFilter == NEAREST:
            self.note("samplers.magFilter NEAREST (read bilinear)")
        if unknown := [code for code in (sampler.wrapS, sampler.wrapT) if code not in WRAPS]:
            known = ", ".join(map(str, WRAPS))
            raise ValueError(f"samplers.{texture.sampler}: unknown wrapping {unknown[0]}: known are {known}")
        return WRAPS[sampler.wrapS], WRAPS[sampler.wrapT]


def _strength(values: Array) -> tuple[float, ...]:
    return tuple(float(v) for v in values)


def _placed(info: TextureInfo) -> tuple[int, Array]:
    """Set of texture coordinates, and how they are moved (KHR_texture_transform), v turned up."""
    t = info.extensions.KHR_texture_transform
    c, s = np.cos(t.rotation), np.sin(t.rotation)
    turn = np.array([[c, s], [-s, c]]) @ np.diag(t.scale)
    move = np.column_stack([turn, t.offset])
    up = np.array([[1.0, 0, 0], [0, -1, 1]])
    return t.texCoord if t.texCoord is not None else info.texCoord, up @ np.vstack([move, [0, 0, 1]])


def _same_place(a: TextureInfo, b: TextureInfo) -> bool:
    (set_a, uv_a), (set_b, uv_b) = _placed(a), _placed(b)
    return set_a == set_b and np.allclose(uv_a, uv_b)

"""Materials of glTF 2.0 in Whitted's terms. docs/scenes.md gives the mapping and its reasons."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...scene.scene import Material
from ...scene.textures import Image, VertexColours, image_texture, normal_map
from .container import GltfFile
from .tables import PbrMaterial, Sampler, TextureInfo, TextureSource

NEAREST = 9728
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
        texture cannot colour here: mirror and glass.
    metallic, roughness, transmission : float
    reflectance : ndarray, (3,)
        F0 of the dielectric.
    thin : bool
        A sheet without a body: light goes straight through.

    Returns
    -------
    dict
        Parameters of `Material`.
    """
    tint = base if tint is None else tint
    sharp = max(0.0, 1 - 2 * roughness) ** 2  # the share of the reflection that shows a picture
    clear = (1 - metallic) * transmission  # what glass has of the surface
    matt = (1 - metallic) * (1 - transmission)
    mirror = sharp * (metallic * tint + matt * reflectance)
    through = clear * tint
    if thin:
        mirror, through = mirror + clear * reflectance, through * (1 - reflectance)
    diffuse = matt * base * (1 - reflectance) + metallic * base * (1 - sharp)
    left = 1 - mirror.max() - through.max()  # by which the tracer multiplies the colour
    f0 = float(np.mean(metallic * tint + (1 - metallic) * reflectance))
    # Blinn–Phong of the same width (Karis 2013), as strong as normalised D/4 seen head on, none on a matt surface
    shininess = max(2 / max(roughness, 0.05) ** 4 - 2, 1.0)
    specular = min(float(f0 * (1 - roughness) * (shininess + 2) / 8), 1.0)
    return {
        "colour": _vector(diffuse / left if left > 1e-6 else 0 * diffuse),
        "mirror": _vector(mirror),
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
        values = self._surface(stored, base, picture, where)
        cutoff = 0.0
        has_alpha = picture is not None and picture.alpha is not None and bool(picture.alpha.min() < 1)
        if stored.alphaMode == "MASK":
            if not has_alpha and alpha < stored.alphaCutoff:
                return None
            cutoff = stored.alphaCutoff / alpha if has_alpha and alpha > 0 else 0.0
            if cutoff > 1 or (has_alpha and alpha == 0 < stored.alphaCutoff):
                return None
        elif stored.alphaMode == "BLEND":
            if has_alpha:
                self.note("alphaMode BLEND of a texture (cut out at 0.5)")
                cutoff = 0.5
            values = _blended(values, alpha)
        if more.KHR_materials_unlit is not None:
            if picture is None and not coloured:
                values |= {"emission": _strength(base), "colour": (0.0, 0.0, 0.0), "specular": 0.0}
                values |= {"mirror": (0.0, 0.0, 0.0)}
            else:
                self.note("KHR_materials_unlit with a texture (lit as matt)")
                values |= {"mirror": (0.0, 0.0, 0.0), "specular": 0.0, "colour": _vector(base)}
        else:
            values["emission"] = self._emission(stored, where)
        texture: Any = picture if picture is not None else VertexColours() if coloured else None
        bumps = self._bumps(stored, coloured and picture is None, where)
        info = pbr.baseColorTexture if picture is not None else stored.normalTexture
        material = Material(
            **values, texture=texture, alpha_cutoff=cutoff, normal_map=bumps,
            normal_scale=max(stored.normalTexture.scale, 0.0) if bumps is not None and stored.normalTexture else 1.0,
        )  # fmt: skip
        if info is None or (picture is None and bumps is None):
            return Look(material)
        return Look(material, *_placed(info))

    def _surface(self, stored: PbrMaterial, base: Array, picture: Image | None, where: str) -> dict[str, Any]:
        """Shares, highlight and body of a material."""
        pbr, more = stored.pbrMetallicRoughness, stored.extensions
        metallic, roughness = pbr.metallicFactor, pbr.roughnessFactor
        mean = self._mean(pbr.metallicRoughnessTexture, "metallicRoughnessTexture", where)
        roughness, metallic = roughness * mean[1], metallic * mean[2]
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
        if through > 0:
            spread = (ior - 1) * 0.025 * more.KHR_materials_dispersion.dispersion
            index = max(ior, 1.0)
            values["ior"] = 1.0 if thin else (max(index - spread, 1.0), index, index + spread) if spread else index
            if not thin and volume.attenuationDistance is not None:
                kept = np.maximum(volume.attenuationColor, 1e-6)
                values["absorption_per_mm"] = tuple(float(a) for a in -np.log(kept) / volume.attenuationDistance)
        return values

    def _emission(self, stored: PbrMaterial, where: str) -> tuple[float, ...]:
        strength = stored.extensions.KHR_materials_emissive_strength.emissiveStrength
        if not any(stored.emissiveFactor):
            return (0.0, 0.0, 0.0)
        mean = self._mean(stored.emissiveTexture, "emissiveTexture", where, srgb=True)[:3]
        return _strength(np.array(stored.emissiveFactor) * strength * mean)

    def _bumps(self, stored: PbrMaterial, coloured: bool, where: str) -> Image | None:
        info, base = stored.normalTexture, stored.pbrMetallicRoughness.baseColorTexture
        if info is None:
            return None
        if coloured:
            self.note("normalTexture over vertex colours")
            return None
        if base is not None and not _same_place(base, info):
            self.note("normalTexture on other texture coordinates than baseColorTexture")
            return None
        if stored.normalTexture is not None and stored.normalTexture.scale < 0:
            self.note("a negative scale of a normalTexture (taken as 0)")
        return self._image(info, "normal", where)

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
            make = image_texture if use == "colour" else normal_map
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
        """How a texture goes on beyond its border, along u and v."""
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


def _blended(values: dict[str, Any], alpha: float) -> dict[str, Any]:
    """A surface of which the share ``alpha`` is there and the rest is seen through, unbent."""
    if alpha >= 1:
        return values
    mirror, through = (np.array(values[k]) * alpha for k in ("mirror", "transmission"))
    left = alpha * (1 - max(values["mirror"]) - max(values["transmission"]))  # keeps its share of the light
    through = through + (1 - alpha)
    colour = np.array(values["colour"]) * left / max(1 - mirror.max() - through.max(), 1e-6)
    more = {"colour": _vector(colour), "mirror": _vector(mirror), "transmission": _vector(through)}
    return {**values, **more, "specular": values["specular"] * alpha, "ior": 1.0}


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

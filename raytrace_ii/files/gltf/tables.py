"""JSON tables of glTF 2.0 files, checked by pydantic.

What else stands in a file is kept by pydantic as an extra, from which `left_out` tells it: nothing is dropped
without a word.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from ..mesh_model import share

Index = Annotated[int, Field(ge=0)]


def _clamped(value: Any) -> Any:
    return share(value) if isinstance(value, float) else value


Share = Annotated[float, Field(ge=0, le=1), BeforeValidator(_clamped)]
NotNegative = Annotated[float, Field(ge=0)]
Positive = Annotated[float, Field(gt=0)]
Vector2 = tuple[float, float]
Vector3 = tuple[float, float, float]
Vector4 = tuple[float, float, float, float]
Shares3 = tuple[Share, Share, Share]
NotNegative3 = tuple[NotNegative, NotNegative, NotNegative]


class _Table(BaseModel):
    """A JSON object. ``name`` and ``extras`` mean nothing to a picture."""

    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False)
    name: str = ""
    extras: Any = None


class Nothing(_Table):
    """An object of which nothing is read."""


class TextureTransform(_Table):
    """KHR_texture_transform."""

    offset: Vector2 = (0.0, 0.0)
    rotation: float = 0.0
    scale: Vector2 = (1.0, 1.0)
    texCoord: Index | None = None


class TextureInfoExtensions(_Table):
    KHR_texture_transform: TextureTransform = TextureTransform()


class TextureInfo(_Table):
    """Which texture, over which set of coordinates; ``scale`` is a normal map's."""

    index: Index
    texCoord: Index = 0
    scale: float = 1.0
    strength: Share = 1.0
    extensions: TextureInfoExtensions = TextureInfoExtensions()


class Transmission(_Table):
    """KHR_materials_transmission."""

    transmissionFactor: Share = 0.0
    transmissionTexture: TextureInfo | None = None


class Volume(_Table):
    """KHR_materials_volume."""

    thicknessFactor: NotNegative = 0.0
    thicknessTexture: TextureInfo | None = None
    attenuationDistance: Positive | None = None
    attenuationColor: Shares3 = (1.0, 1.0, 1.0)


class Ior(_Table):
    """KHR_materials_ior; 0 stands for a reflectance of 1."""

    ior: NotNegative = 1.5


class Dispersion(_Table):
    """KHR_materials_dispersion: 20 over Abbe's number."""

    dispersion: NotNegative = 0.0


class Specular(_Table):
    """KHR_materials_specular."""

    specularFactor: Share = 1.0
    specularTexture: TextureInfo | None = None
    specularColorFactor: NotNegative3 = (1.0, 1.0, 1.0)
    specularColorTexture: TextureInfo | None = None


class EmissiveStrength(_Table):
    """KHR_materials_emissive_strength."""

    emissiveStrength: NotNegative = 1.0


class MaterialExtensions(_Table):
    KHR_materials_transmission: Transmission = Transmission()
    KHR_materials_volume: Volume = Volume()
    KHR_materials_ior: Ior = Ior()
    KHR_materials_dispersion: Dispersion = Dispersion()
    KHR_materials_specular: Specular = Specular()
    KHR_materials_emissive_strength: EmissiveStrength = EmissiveStrength()
    KHR_materials_unlit: Nothing | None = None


class MetallicRoughness(_Table):
    baseColorFactor: tuple[Share, Share, Share, Share] = (1.0, 1.0, 1.0, 1.0)
    baseColorTexture: TextureInfo | None = None
    metallicFactor: Share = 1.0
    roughnessFactor: Share = 1.0
    metallicRoughnessTexture: TextureInfo | None = None


class PbrMaterial(_Table):
    """A material. Both sides of a face are always drawn, whatever ``doubleSided`` says."""

    pbrMetallicRoughness: MetallicRoughness = MetallicRoughness()
    normalTexture: TextureInfo | None = None
    emissiveFactor: Shares3 = (0.0, 0.0, 0.0)
    emissiveTexture: TextureInfo | None = None
    alphaMode: Literal["OPAQUE", "MASK", "BLEND"] = "OPAQUE"
    alphaCutoff: NotNegative = 0.5
    doubleSided: bool = False
    extensions: MaterialExtensions = MaterialExtensions()


class Primitive(_Table):
    """Triangles of one material. Tangents are made from the texture coordinates, those of the file are not needed."""

    attributes: dict[str, Index]
    indices: Index | None = None
    material: Index | None = None
    mode: Annotated[int, Field(ge=0, le=6)] = 4
    targets: list[dict[str, Index]] = []


class GltfMesh(_Table):
    """Primitives, and the weights of their morph targets unless a node or an animation has others."""

    primitives: list[Primitive]
    weights: list[float] = []


class LightReference(_Table):
    light: Index


class NodeExtensions(_Table):
    KHR_lights_punctual: LightReference | None = None


class Node(_Table):
    children: list[Index] = []
    mesh: Index | None = None
    skin: Index | None = None
    weights: list[float] = []
    matrix: Annotated[list[float], Field(min_length=16, max_length=16)] | None = None
    translation: Vector3 = (0.0, 0.0, 0.0)
    rotation: Vector4 = (0.0, 0.0, 0.0, 1.0)
    scale: Vector3 = (1.0, 1.0, 1.0)
    extensions: NodeExtensions = NodeExtensions()


class Skin(_Table):
    """Joints, which are nodes, and matrices from the mesh's frame at rest to theirs. ``skeleton`` is only a hint."""

    joints: Annotated[list[Index], Field(min_length=1)]
    inverseBindMatrices: Index | None = None
    skeleton: Any = None


class ChannelTarget(_Table):
    node: Index | None = None
    path: str


class Channel(_Table):
    """Which key of which node a sampler sets."""

    sampler: Index
    target: ChannelTarget


class KeyframeSampler(_Table):
    """Accessors of times in seconds and of values."""

    input: Index
    output: Index
    interpolation: Literal["LINEAR", "STEP", "CUBICSPLINE"] = "LINEAR"


class Animation(_Table):
    """A clip."""

    channels: list[Channel] = []
    samplers: list[KeyframeSampler] = []


class NodeList(_Table):
    nodes: list[Index] = []


class SpotCone(_Table):
    innerConeAngle: NotNegative = 0.0
    outerConeAngle: Annotated[float, Field(gt=0, le=np.pi / 2)] = np.pi / 4


class PunctualLight(_Table):
    """KHR_lights_punctual."""

    type: Literal["point", "directional", "spot"]
    color: NotNegative3 = (1.0, 1.0, 1.0)
    intensity: NotNegative = 1.0
    spot: SpotCone = SpotCone()


class PunctualLights(_Table):
    lights: list[PunctualLight] = []


class FileExtensions(_Table):
    KHR_lights_punctual: PunctualLights = PunctualLights()


class Buffer(_Table):
    byteLength: Index
    uri: str | None = None


class BufferView(_Table):
    buffer: Index
    byteOffset: Index = 0
    byteLength: Index
    byteStride: Index | None = None
    target: Any = None


class SparseIndices(_Table):
    bufferView: Index
    byteOffset: Index = 0
    componentType: int


class SparseValues(_Table):
    bufferView: Index
    byteOffset: Index = 0


class Sparse(_Table):
    count: Index
    indices: SparseIndices
    values: SparseValues


class Accessor(_Table):
    bufferView: Index | None = None
    byteOffset: Index = 0
    componentType: int
    normalized: bool = False
    count: Annotated[int, Field(ge=1)]
    type: str
    min: Any = None
    max: Any = None
    sparse: Sparse | None = None


class ImageSource(_Table):
    uri: str | None = None
    mimeType: str = ""
    bufferView: Index | None = None


class Sampler(_Table):
    """Wrap modes of a texture. Filter modes are ignored: textures are read bilinear and filtered by the tracer."""

    magFilter: int | None = None
    minFilter: Any = None
    wrapS: int = 10497
    wrapT: int = 10497


class TextureSource(_Table):
    sampler: Index | None = None
    source: Index | None = None


class Gltf(_Table):
    """A whole file."""

    asset: Any = None
    extensionsUsed: list[str] = []
    extensionsRequired: list[str] = []
    scene: Index | None = None
    scenes: list[NodeList] = []
    nodes: list[Node] = []
    meshes: list[GltfMesh] = []
    materials: list[PbrMaterial] = []
    textures: list[TextureSource] = []
    samplers: list[Sampler] = []
    images: list[ImageSource] = []
    accessors: list[Accessor] = []
    bufferViews: list[BufferView] = []
    buffers: list[Buffer] = []
    skins: list[Skin] = []
    animations: list[Animation] = []
    extensions: FileExtensions = FileExtensions()


KNOWN_EXTENSIONS = {
    "KHR_mesh_quantization",  # integers in place of floats, which any accessor may hold here
    *TextureInfoExtensions.model_fields,
    *MaterialExtensions.model_fields,
    *FileExtensions.model_fields,
} - set(_Table.model_fields)


def left_out(model: BaseModel, place: str = "") -> Iterator[str]:
    """Names, in the file's own terms, of everything that stands in the file and is not read."""
    for key, value in (model.model_extra or {}).items():
        if key == "extensions" and isinstance(value, dict):
            yield from value
        elif place.endswith("extensions"):
            yield key
        elif value not in ([], {}):
            yield f"{place}.{key}".lstrip(".")
    for key in type(model).model_fields:
        value = getattr(model, key)
        for item in value if isinstance(value, list) else [value]:
            if isinstance(item, BaseModel):
                yield from left_out(item, f"{place}.{key}".lstrip("."))

"""PBR materials as Whitted materials: limits, energy, equal scenes in TOML and glTF."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ii_core import preset
from ii_core.base.files import write_image
from raytrace_ii import load_scene, render, trace
from raytrace_ii.files.gltf.materials import surface
from raytrace_ii.files.load import read_model
from raytrace_ii.scene.textures import Image, VertexColours, linear
from raytrace_ii.shapes.primitives import Box, Plane, Sphere
from tests.raytrace_ii.files.test_gltf import look, scene_of
from tests.support.gltf_files import SQUARE, SQUARE_FACES, SQUARE_UV, Gltf

share = st.floats(0, 1)
three = st.tuples(share, share, share).map(np.array)


@given(three, share, share, three, share, st.booleans())
def test_surfaces_conserve_energy(base, metallic, roughness, f0, transmission, thin):
    """Matt, mirrored and transmitted shares sum to at most 1 in every channel, and none is negative."""
    s = surface(base, metallic, roughness, f0, transmission, thin=thin)
    colour, mirror, through = (np.array(s[k]) for k in ("colour", "mirror", "transmission"))
    left = max(0.0, 1 - mirror.max() - through.max())
    assert (colour >= 0).all() and (colour <= 1).all(), "a metal mirrors its colour"
    assert (left * colour + mirror + through <= 1 + 1e-9).all()
    assert 0 <= s["specular"] <= 1 and s["shininess"] >= 1


def test_known_limits():
    base, glass = np.array([0.8, 0.5, 0.2]), np.full(3, 0.04)
    chalk = surface(base, 0.0, 1.0, 0 * glass, 0.0)
    assert (chalk["colour"], chalk["mirror"], chalk["specular"]) == (tuple(base), (0, 0, 0), 0)
    for roughness in (0.0, 1.0):
        metal = surface(base, 1.0, roughness, glass, 0.0)  # it mirrors its colour, in a lobe
        assert (metal["metallic"], metal["colour"], metal["roughness"]) == (1.0, tuple(base), roughness)
    assert metal["specular"] == 0
    lacquer = surface(base, 0.0, 0.0, glass, 0.0)
    np.testing.assert_allclose(lacquer["mirror"], 0.04)
    np.testing.assert_allclose(np.array(lacquer["colour"]) * 0.96, base * 0.96)  # the rest
    clear = surface(np.ones(3), 0.0, 0.0, glass, 1.0)
    assert (clear["transmission"], clear["mirror"]) == ((1, 1, 1), (0, 0, 0))  # Fresnel is the tracer's own
    sheet = surface(np.ones(3), 0.0, 0.0, glass, 1.0, thin=True)
    np.testing.assert_allclose([sheet["transmission"], sheet["mirror"]], [[0.96] * 3, [0.04] * 3])


def test_the_highlight_has_the_width_of_the_roughness():
    """Blinn–Phong's exponent against GGX, whose tails it lacks: at half height it is up to 1.3 times as wide."""
    for roughness in (0.3, 0.5, 0.7):
        alpha = roughness**2
        exponent = surface(np.ones(3), 0.0, roughness, np.full(3, 0.04), 0.0)["shininess"]
        phong = math.acos(0.5 ** (1 / exponent))
        # GGX: D ∝ 1/((cos²(α² − 1) + 1)²) is half where cos²(1 − α²) = 1 − √2 α²
        ggx = math.acos(math.sqrt((1 - math.sqrt(2) * alpha**2) / (1 - alpha**2)))
        assert 1.2 < phong / ggx < 1.35, (roughness, phong, ggx)


def material_of(tmp_path, gltf, index, **attributes):
    """Return our material of a glTF material on a square."""
    gltf.node(mesh=gltf.mesh(SQUARE, SQUARE_FACES, material=index, TEXCOORD_0=SQUARE_UV, **attributes))
    model = read_model(gltf.save(tmp_path / "m.glb"))
    return model.parts[0].material, model.left_out


MATT = {"metallicFactor": 0, "roughnessFactor": 1}


def test_glass_with_a_body(tmp_path):
    gltf = Gltf()
    index = gltf.material(
        {
            "KHR_materials_transmission": {"transmissionFactor": 0.9},
            "KHR_materials_volume": {
                "thicknessFactor": 0.1, "attenuationDistance": 2, "attenuationColor": [0.5, 0.25, 1]
            },
            "KHR_materials_ior": {"ior": 1.7},
        },
        pbr={"baseColorFactor": [1, 0.5, 1, 1], "metallicFactor": 0, "roughnessFactor": 0},
    )  # fmt: skip
    material, notes = material_of(tmp_path, gltf, index)
    assert not notes
    np.testing.assert_allclose(material.transmission, [0.9, 0.45, 0.9])
    assert material.ior == 1.7
    np.testing.assert_allclose(material.absorption_per_mm, [math.log(2) / 2, math.log(4) / 2, 0])
    with pytest.warns(UserWarning, match="glass without an inside"):  # the body is a square
        scene = scene_of(tmp_path, gltf, "scale = 4")  # per mm, when a unit of the file is 4 mm
    np.testing.assert_allclose(scene.bodies[0].material.absorption_per_mm, [math.log(2) / 8, math.log(4) / 8, 0])


def test_dispersion_spreads_the_index_by_abbes_number(tmp_path):
    """V = (n_d − 1)/(n_F − n_C) = 20/dispersion: red and blue half of that apart from green."""
    gltf = Gltf()
    index = gltf.material(
        {
            "KHR_materials_transmission": {"transmissionFactor": 1},
            "KHR_materials_volume": {"thicknessFactor": 1},
            "KHR_materials_ior": {"ior": 1.6},
            "KHR_materials_dispersion": {"dispersion": 0.5},
        },
        pbr=MATT,
    )
    material, _ = material_of(tmp_path, gltf, index)
    red, green, blue = material.ior
    assert green == 1.6 and (green - 1) / (blue - red) == pytest.approx(20 / 0.5)


def test_a_thin_sheet_does_not_bend_light(tmp_path):
    gltf = Gltf()
    index = gltf.material(
        {"KHR_materials_transmission": {"transmissionFactor": 1}}, pbr={"roughnessFactor": 0, "metallicFactor": 0}
    )
    material, _ = material_of(tmp_path, gltf, index)
    assert material.ior == 1.0 and material.transmission[0] == pytest.approx(0.96)


def test_specular_strength_and_colour(tmp_path):
    gltf = Gltf()
    index = gltf.material(
        {"KHR_materials_specular": {"specularFactor": 0.5, "specularColorFactor": [1, 0.5, 0]}},
        pbr={"metallicFactor": 0, "roughnessFactor": 0},
    )
    material, _ = material_of(tmp_path, gltf, index)
    np.testing.assert_allclose(material.mirror, [0.02, 0.01, 0])


def test_light_given_off(tmp_path):
    gltf = Gltf()
    index = gltf.material(
        {"KHR_materials_emissive_strength": {"emissiveStrength": 5}}, emissiveFactor=[1, 0.5, 0], pbr=MATT
    )
    assert material_of(tmp_path, gltf, index)[0].emission == (5, 2.5, 0)
    gltf = Gltf()
    picture = gltf.texture(np.full((2, 2, 3), (255, 0, 188)))
    index = gltf.material(emissiveFactor=[1, 1, 1], emissiveTexture={"index": picture})
    material, notes = material_of(tmp_path, gltf, index)
    assert material.emission == (1, 1, 1) and not notes
    np.testing.assert_allclose(material.emission_map.pixels[0, 0], linear([1, 0, 188 / 255]), rtol=1e-6)


def test_unlit_gives_off_its_colour(tmp_path):
    gltf = Gltf()
    pbr = {"baseColorFactor": [0.2, 0.4, 0.6, 1]}
    material, notes = material_of(tmp_path, gltf, gltf.material({"KHR_materials_unlit": {}}, pbr=pbr))
    assert material.emission == (0.2, 0.4, 0.6) and material.colour == (0, 0, 0) and not notes
    assert material.specular == 0


def test_metal_and_roughness_of_a_texture(tmp_path):
    """A map if it has the base colour's coordinates, else its mean."""
    gltf = Gltf()
    picture = gltf.texture(np.full((2, 2, 3), (0, 51, 255)))  # roughness 0.2, all metal
    pbr = {"baseColorFactor": [0.5, 0.5, 0.5, 1], "metallicRoughnessTexture": {"index": picture}}
    pbr["roughnessFactor"] = 0.5
    material, notes = material_of(tmp_path, gltf, gltf.material(pbr=pbr))
    assert (material.roughness, material.metallic, material.colour) == (0.5, 1, (0.5,) * 3) and not notes
    np.testing.assert_allclose(material.metallic_roughness_map.pixels[0, 0], [0, 0.2, 1], rtol=1e-6)
    gltf = Gltf()
    index = gltf.texture(np.full((2, 2, 3), (0, 51, 255)))
    pbr |= {"baseColorTexture": {"index": index}, "metallicRoughnessTexture": {"index": index, "texCoord": 1}}
    material, notes = material_of(tmp_path, gltf, gltf.material(pbr=pbr), TEXCOORD_1=SQUARE_UV)
    assert material.metallic_roughness_map is None and (material.roughness, material.metallic) == (0.1, 1)
    assert notes == [
        "metallicRoughnessTexture on other texture coordinates than baseColorTexture",
        "metallicRoughnessTexture (its mean is used)",
    ]


def test_light_of_a_texture_elsewhere_is_left_out(tmp_path):
    """Mean emission differs more from Cycles than no emission."""
    gltf = Gltf()
    picture = gltf.texture(np.full((2, 2, 3), 128))
    index = gltf.material(
        pbr={"baseColorTexture": {"index": picture}},
        emissiveFactor=[1, 1, 1],
        emissiveTexture={"index": picture, "texCoord": 1},
    )
    material, notes = material_of(tmp_path, gltf, index, TEXCOORD_1=SQUARE_UV)
    assert material.emission == (0, 0, 0) and material.emission_map is None
    assert notes == ["emissiveTexture on other texture coordinates than baseColorTexture"]


@pytest.mark.parametrize("mode", ["emission", "unlit"])
def test_a_square_that_glows_shows_its_texels(tmp_path, mode):
    """Radiance through the middle of every texel of a file's texture, as linear light."""
    pixels = np.random.default_rng(5).integers(0, 256, (4, 6, 3))
    gltf = Gltf()
    picture = {"index": gltf.texture(pixels)}
    black = {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0}
    if mode == "emission":
        strength = {"KHR_materials_emissive_strength": {"emissiveStrength": 2}}
        index = gltf.material(strength, pbr=black, emissiveFactor=[0.5, 0.5, 0.5], emissiveTexture=picture)
    else:
        index = gltf.material({"KHR_materials_unlit": {}}, pbr={"baseColorTexture": picture})
    gltf.node(mesh=gltf.mesh(SQUARE, SQUARE_FACES, material=index, TEXCOORD_0=SQUARE_UV))
    scene = scene_of(tmp_path, gltf).with_depth(0)
    y, x = np.mgrid[:4, :6]
    start = np.stack([(x + 0.5) / 3 - 1, 1 - (y + 0.5) / 2, np.full(x.shape, -5.0)], axis=-1)
    seen = trace(scene, start, np.broadcast_to([0, 0, 1.0], start.shape)).radiance
    np.testing.assert_allclose(seen, linear(pixels.reshape(-1, 3) / 255), rtol=1e-4, atol=2e-6)


def test_cut_outs(tmp_path):
    pixels = np.full((2, 2, 4), 255)
    pixels[0, :, 3] = 0
    gltf = Gltf()
    pbr = {"baseColorTexture": {"index": gltf.texture(pixels)}, "baseColorFactor": [1, 1, 1, 0.8], **MATT}
    material, notes = material_of(tmp_path, gltf, gltf.material(pbr=pbr, alphaMode="MASK", alphaCutoff=0.4))
    assert material.alpha_cutoff == 0.5 and not notes, "0.4 of 0.8"
    np.testing.assert_array_equal(material.texture.alpha, [[0, 0], [1, 1]])
    gltf = Gltf()
    pbr = {"baseColorTexture": {"index": gltf.texture(pixels)}, **MATT}
    assert material_of(tmp_path, gltf, gltf.material(pbr=pbr))[0].alpha_cutoff == 0, "OPAQUE ignores alpha"
    material, notes = material_of(tmp_path, gltf, gltf.material(pbr=pbr, alphaMode="BLEND"))
    gltf = Gltf()
    gone = gltf.material(pbr={"baseColorFactor": [1, 1, 1, 0.1]}, alphaMode="MASK")
    gltf.node(mesh=gltf.mesh(SQUARE, SQUARE_FACES, material=gone))
    gltf.node(mesh=gltf.mesh(SQUARE, SQUARE_FACES), name="there")
    assert [part.name for part in read_model(gltf.save(tmp_path / "m.glb")).parts] == ["there"]


def test_a_blended_surface_lets_its_share_through(tmp_path):
    gltf = Gltf()
    pbr = {"baseColorFactor": [0.8, 0.4, 0, 0.25], **MATT}
    index = gltf.material({"KHR_materials_specular": {"specularFactor": 0}}, pbr=pbr, alphaMode="BLEND")
    material, _ = material_of(tmp_path, gltf, index)
    assert material.alpha_blend == 0.25 and material.transmission == (0, 0, 0)
    np.testing.assert_allclose(material.colour, [0.8, 0.4, 0])


def test_blending_by_texels(tmp_path):
    pixels = np.random.default_rng(6).integers(0, 256, (4, 6, 4))
    gltf = Gltf()
    pbr = {"baseColorTexture": {"index": gltf.texture(pixels)}, "baseColorFactor": [1, 1, 1, 0.8], **MATT}
    material, notes = material_of(tmp_path, gltf, gltf.material(pbr=pbr, alphaMode="BLEND"))
    assert (material.alpha_blend, material.alpha_cutoff) == (0.8, 0) and not notes
    np.testing.assert_allclose(material.texture.alpha, pixels[..., 3] / 255, rtol=1e-6)
    gltf = Gltf()
    gone = gltf.material(pbr={"baseColorFactor": [1, 1, 1, 0]}, alphaMode="BLEND")
    gltf.node(mesh=gltf.mesh(SQUARE, SQUARE_FACES, material=gone))
    gltf.node(mesh=gltf.mesh(SQUARE, SQUARE_FACES), name="there")
    assert [part.name for part in read_model(gltf.save(tmp_path / "m.glb")).parts] == ["there"]


def test_normal_maps(tmp_path):
    gltf = Gltf()
    bumps = gltf.texture(np.full((2, 2, 3), (255, 128, 128)))
    index = gltf.material(normalTexture={"index": bumps, "scale": 0.5})
    material, notes = material_of(tmp_path, gltf, index)
    assert isinstance(material.normal_map, Image) and material.normal_scale == 0.5 and not notes
    np.testing.assert_allclose(material.normal_map.pixels[0, 0], [1, 128 / 255, 128 / 255], rtol=1e-6)
    gltf = Gltf()
    bumps, picture = gltf.texture(np.full((2, 2, 3), 128)), gltf.texture(np.full((2, 2, 3), 128))
    index = gltf.material(pbr={"baseColorTexture": {"index": picture}}, normalTexture={"index": bumps, "texCoord": 1})
    material, notes = material_of(tmp_path, gltf, index, TEXCOORD_1=SQUARE_UV)
    assert material.normal_map is None
    assert notes == ["normalTexture on other texture coordinates than baseColorTexture"]


def test_vertex_colours_under_a_texture_are_named(tmp_path):
    gltf = Gltf()
    picture = gltf.texture(np.full((2, 2, 3), 128))
    index = gltf.material(pbr={"baseColorTexture": {"index": picture}})
    material, notes = material_of(tmp_path, gltf, index, COLOR_0=np.ones((4, 3), np.float32))
    assert isinstance(material.texture, Image) and notes == ["vertex colours under a texture"]
    material, notes = material_of(tmp_path, Gltf(), None, COLOR_0=np.ones((4, 3), np.float32))
    assert isinstance(material.texture, VertexColours) and not notes


# The same scene twice

TOML = """
ambient = 0.2
[background]
horizon = "#c0d0e0"
[[light]]
kind = "point"
position_mm = [0, 40, 60]
intensity = 0.3
[[light]]
kind = "directional"
direction = [1, -1, 1]
colour = "#ff8000"
intensity = 0.2
[[light]]
kind = "spot"
position_mm = [30, 40, 60]
direction = [-3, -4, 0]
cone_deg = [5, 20]
intensity = 0.5
[texture.t]
kind = "image"
file = "t.png"
[material.floor]
texture = "t"
[material.red]
colour = "#c02010"
[material.mirror]
colour = "#000000"
mirror = "#e0c080"
specular = 1
shininess = 319998
[material.glass]
transmission = 1
ior = 1.5
specular = 1
shininess = 319998
absorption_per_mm = [0.02, 0.1, 0.05]
[material.lamp]
colour = "#000000"
emission = "#ff8000"
emission_strength = 0.7
[[object]]
shape = "plane"
size_mm = [80, 80]
position_mm = [0, -10, 60]
material = "floor"
[[object]]
shape = "box"
size_mm = [10, 20, 10]
position_mm = [15, 0, 70]
material = "red"
[[object]]
shape = "sphere"
radius_mm = 7
segments = 48
position_mm = [-1, -3, 70]
material = "mirror"
[[object]]
shape = "sphere"
radius_mm = 6
segments = 48
position_mm = [-12, -4, 45]
material = "glass"
[[object]]
shape = "sphere"
radius_mm = 2
segments = 48
position_mm = [4, -8, 40]
material = "lamp"
"""


def stored(gltf, mesh, material):
    """Return one of our meshes as stored in a file: right-handed, v down."""
    flip = np.array([1, 1, -1])
    more = {} if mesh.normals is None else {"NORMAL": (mesh.normals * flip).astype(np.float32)}
    uv = np.column_stack([mesh.uv[:, 0], 1 - mesh.uv[:, 1]]).astype(np.float32)
    return gltf.mesh(mesh.vertices * flip, mesh.faces[:, ::-1], material=material, TEXCOORD_0=uv, **more)


def test_the_same_scene_in_toml_and_in_gltf(tmp_path):
    """Equal within an 8-bit step, except single pixels: positions are stored in float32."""
    pixels = np.random.default_rng(3).integers(0, 256, (8, 8, 3)).astype(np.uint8)
    write_image(tmp_path / "t.png", pixels)
    (tmp_path / "a.toml").write_text(TOML)
    gltf = Gltf()
    flat = {"KHR_materials_specular": {"specularFactor": 0}}
    floor = gltf.material(flat, pbr={"baseColorTexture": {"index": gltf.texture(pixels)}, **MATT})
    red = gltf.matt(linear([0xC0 / 255, 0x20 / 255, 0x10 / 255]).tolist())
    silver = linear([0xE0 / 255, 0xC0 / 255, 0x80 / 255])
    mirror = gltf.material(pbr={"baseColorFactor": [*silver, 1], "roughnessFactor": 0})
    attenuation = np.exp([-0.2, -1, -0.5]).tolist()  # over a centimetre, the file's unit here
    glass = gltf.material(
        {
            "KHR_materials_transmission": {"transmissionFactor": 1},
            "KHR_materials_volume": {
                "thicknessFactor": 1, "attenuationDistance": 1, "attenuationColor": attenuation
            },
        },
        pbr={"metallicFactor": 0, "roughnessFactor": 0},
    )  # fmt: skip
    orange = linear([1, 0x80 / 255, 0]).tolist()
    strength = {"KHR_materials_emissive_strength": {"emissiveStrength": 0.7}}
    lamp = gltf.material({**flat, **strength}, emissiveFactor=orange, pbr={**MATT, "baseColorFactor": [0, 0, 0, 1]})
    for mesh, material, place in (
        (Plane(shape="plane", size_mm=(8, 8)), floor, [0, -1, 0]),
        (Box(shape="box", size_mm=(1, 2, 1)), red, [1.5, 0, -1]),
        (Sphere(shape="sphere", radius_mm=0.7, segments=48), mirror, [-0.1, -0.3, -1]),
        (Sphere(shape="sphere", radius_mm=0.6, segments=48), glass, [-1.2, -0.4, 1.5]),
        (Sphere(shape="sphere", radius_mm=0.2, segments=48), lamp, [0.4, -0.8, 2]),
    ):
        gltf.node(mesh=stored(gltf, mesh.mesh(), material), translation=place)
    # The box about all is centred on the origin, where these give 3, 2 and 5 lx.
    gltf.node(extensions=gltf.light(type="point", intensity=48), translation=[0, 4, 0])
    gltf.node(
        extensions=gltf.light(type="directional", intensity=2, color=orange), matrix=look([0, 0, 0], [1, -1, -1])
    )
    cone = {"innerConeAngle": math.radians(5), "outerConeAngle": math.radians(20)}
    gltf.node(extensions=gltf.light(type="spot", intensity=125, spot=cone), matrix=look([3, 4, 0], [-3, -4, 0]))
    gltf.save(tmp_path / "m.glb")
    (tmp_path / "b.toml").write_text(
        TOML[: TOML.index("[[light]]")] + '[[object]]\nmesh = "m.glb"\nscale = 10\nposition_mm = [0, 0, 60]\n'
    )
    camera = preset("setup1", scale=16)
    a, b = (
        render(load_scene(tmp_path / f), camera, support=()).picture.pixels.astype(int) for f in ("a.toml", "b.toml")
    )
    assert len(np.unique(a.reshape(-1, 3), axis=0)) > 1000, "there is something to see"
    apart = np.abs(a - b).max(axis=2)
    assert (apart > 1).mean() < 1e-3, (apart > 1).mean()

"""Numba kernels of the Whitted tracer: they read flat arrays, fill what they are given and check nothing.

Rays are float32 rows, as Embree wants them; sums inside a kernel are float64.
"""

from __future__ import annotations

import math

import numpy as np

from ii_core.colour import LINEAR
from ii_core.jit import inline_kernel, inner_kernel
from ii_core.jit import lean_kernel as kernel

# A weight this small cannot move a colour by half a step of 8 bits, not even on sRGB's steep foot, of light up to 1.
LEAST_WEIGHT = 0.5 / 255 / 12.92
# What is counted.
REFLECTION, REFRACTION, WEAK_SHADOW, WEAK_REFLECTION, WEAK_REFRACTION, PASSED = 0, 1, 2, 3, 4, 5
IMAGE, CHECKER, NOISE, VERTEX, STRIPES = 0, 1, 2, 3, 4  # kinds of texture
REPEAT, MIRROR, CLAMP = 0, 1, 2  # how an image goes on beyond its border
POINT, DIRECTIONAL, SPOT = 0, 1, 2  # kinds of light
# Odd multipliers of the noise lattice's hash.
_PX, _PY, _PZ, _SEED, _GOLDEN = 73856093, 19349663, 83492791, 2654435761, 0x1E3779B97F4A7C15
# Steps of the R2 sequence, 1/g and 1/g² of g³ = g + 1, as fractions of 2³².
_LOW, _R2_ACROSS, _R2_AROUND = np.uint64(0xFFFFFFFF), np.uint64(3242174889), np.uint64(2447445414)
# Perlin's sixteen: towards the twelve edges of a cube, four of them twice. A table, for branches would be guesses.
_GRADIENTS = np.array(
    [[x, y, 0] for y in (1, -1) for x in (1, -1)]
    + [[x, 0, z] for z in (1, -1) for x in (1, -1)]
    + [[0, y, z] for z in (1, -1) for y in (1, -1)]
    + [[1, 1, 0], [-1, 1, 0], [0, -1, 1], [0, -1, -1]],
    dtype=np.float64,
)

# Columns of the material table and of the light table, as in packing.py.
_MIRROR, _TRANSMISSION, _ABSORPTION, _SPECULAR, _SHININESS, _PRIORITY, _LOCAL = 3, 6, 9, 12, 13, 14, 15
_TEXTURE, _LEAST_HALF, _EMISSION, _IOR, _CUTOFF, _NORMAL_MAP, _NORMAL_SCALE = 16, 17, 18, 21, 24, 25, 26
_ROUGHNESS, _METALLIC, _GLOSS_MAP, _EMISSION_MAP, _ALPHA_BLEND, _IMAGES = 27, 28, 29, 30, 31, 32
_LIGHT_COLOUR, _CONE_AXIS, _CONE_SCALE, _CONE_OFFSET = 4, 7, 10, 11
_SKY_IMAGE, _SKY_TURN, _SKY_INTENSITY = 10, 11, 12
_LEVELS = 8  # of an image: how many coarser levels follow it in the table
MOST_TAPS = 8  # along the longer axis of a filtered ellipse
SHARPER = 0.5  # levels finer than the filter's width: bilinear reading of a level widens it again
_LEAST, _MOST = 1e-150, 1e150  # between them squares and their sums neither vanish nor overflow


@kernel
def start_rays(
    locations, directions, shares, order, rotation, shift,
    out_origins, out_directions, out_weights, out_pixels, out_inside,
):  # fmt: skip
    """Place and normalise the camera rays that carry light, packed to the front.

    ``shares`` is the share of light of every ray, empty if all carry all; ``order`` names the rays in the order in
    which they are to stand, empty if as they come.

    Returns
    -------
    count, bad : int
        How many rays there are, and the index of the first unusable one, or −1.
    """
    count, bad = 0, -1
    for row in range(locations.shape[0]):
        i = order[row] if order.shape[0] > 0 else row
        share = shares[i] if shares.shape[0] > 0 else 1.0
        if share == 0.0:
            continue
        dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        if not (0.0 < length < math.inf and 0.0 < share < math.inf) and bad < 0:
            bad = i
        inverse = 1.0 / length if length > 0.0 else 0.0
        x, y, z = locations[i, 0], locations[i, 1], locations[i, 2]
        for c in range(3):
            r0, r1, r2 = rotation[c, 0], rotation[c, 1], rotation[c, 2]
            place = r0 * x + r1 * y + r2 * z + shift[c]
            if not math.isfinite(place) and bad < 0:
                bad = i
            out_origins[count, c] = place
            out_directions[count, c] = (r0 * dx + r1 * dy + r2 * dz) * inverse
            out_weights[count, c] = share
        out_pixels[count] = row
        for k in range(out_inside.shape[1]):
            out_inside[count, k] = -1
        count += 1
    return count, bad


@kernel
def start_separable_rays(x, y, z, rows, columns, rotation, shift, out_origins, out_directions):
    """As `start_rays` for a block of pixels whose rays all carry all light, from `IICamera.separable_rays`.

    ``rows`` and ``columns`` name the pixels in the order in which their rays are to stand.

    Returns
    -------
    bool
        Whether all rays are usable for sure: told of rows and columns, not of rays.
    """
    r00, r01, r02 = rotation[0, 0], rotation[0, 1], rotation[0, 2]
    r10, r11, r12 = rotation[1, 0], rotation[1, 1], rotation[1, 2]
    r20, r21, r22 = rotation[2, 0], rotation[2, 1], rotation[2, 2]
    s0, s1, s2 = shift[0], shift[1], shift[2]
    lz, dz = z[0], z[1]
    sure = (_LEAST < abs(dz) < _MOST) & (abs(lz) < _MOST)
    for rays in (x, y):
        for i in range(rays.shape[0]):
            sure &= (abs(rays[i, 0]) < _MOST) & (abs(rays[i, 1]) < _MOST)
    for i in range(rows.shape[0]):
        lx, dx = x[columns[i], 0], x[columns[i], 1]
        ly, dy = y[rows[i], 0], y[rows[i], 1]
        inverse = 1.0 / math.sqrt(dx * dx + dy * dy + dz * dz)
        out_origins[i, 0] = r00 * lx + r01 * ly + r02 * lz + s0
        out_origins[i, 1] = r10 * lx + r11 * ly + r12 * lz + s1
        out_origins[i, 2] = r20 * lx + r21 * ly + r22 * lz + s2
        out_directions[i, 0] = (r00 * dx + r01 * dy + r02 * dz) * inverse
        out_directions[i, 1] = (r10 * dx + r11 * dy + r12 * dz) * inverse
        out_directions[i, 2] = (r20 * dx + r21 * dy + r22 * dz) * inverse
    return sure


@kernel
def shade(
    primitives, u, v, distances, origins, directions, weights, pixels, inside, keys,
    widths, corners, faces, normals, coordinates, object_of_face, materials, textures, texels, alphas, lights,
    background, fog, ambient, least, lobe_rays, lobe_stride, first_width, spread, radiance,
    shadow_origins, shadow_directions, shadow_reach, shadow_colours, shadow_pixels, shadow_inside,
    next_origins, next_directions, next_weights, next_pixels, next_inside, next_keys, next_widths, counts, lit,
    spawn,
    eye, axis, depth, normal, object_id, ray_length, shading_normal,
):  # fmt: skip
    """Shade one generation of rays.

    Adds background, emitted and ambient light to ``radiance``; writes shadow rays with the light they would let
    through, n rows for each light, and, if ``spawn``, reflected and refracted rays; none weaker than ``least``.
    ``inside`` lists the transmissive bodies that a ray runs in, −1 after the last. ``fog`` is its colour and density,
    of no length if there is none; it lies outside bodies, and before the sky not at all.

    ``keys`` are places in the lobes of rough mirrors, as `sampling.lobe_keys` gives them, of no length if there are
    none; up to ``lobe_rays`` rays go over a lobe, whose places stand ``lobe_stride`` apart.

    A ray is ``widths`` wide where it starts, ``first_width`` if they are of no length, and grows by ``spread`` a mm,
    from a negative width through 0: images are filtered over its width, not at all if both are 0.

    Of each ray are noted, where there is room, the depth from ``eye`` along the camera's ``axis``, the face's normal,
    the object, the ray's length and the normal of shading.

    Returns
    -------
    spawned : int
        How many rows of the ``next_`` arrays were filled; ``lit`` is how many of each light's ``shadow_`` rows.
    """
    spawned = 0
    for i in range(primitives.shape[0]):
        pixel = pixels[i]
        dx, dy, dz = float(directions[i, 0]), float(directions[i, 1]), float(directions[i, 2])
        w0, w1, w2 = float(weights[i, 0]), float(weights[i, 1]), float(weights[i, 2])
        f = primitives[i]
        if ray_length.shape[0] > 0:
            ray_length[pixel] = distances[i] if f >= 0 else math.nan
        if object_id.shape[0] > 0:
            object_id[pixel] = object_of_face[f] if f >= 0 else -1
        if normal.shape[0] > 0:
            for c in range(3):
                normal[pixel, c] = faces[f, c] if f >= 0 else 0.0
        if f < 0:
            if shading_normal.shape[0] > 0:
                _put(shading_normal, pixel, 0.0, 0.0, 0.0)
            if depth.shape[0] > 0:
                depth[pixel] = math.nan
            b0, b1, b2 = _sky(background, textures, texels, dx, dy, dz, spread)
            radiance[pixel, 0] += w0 * b0
            radiance[pixel, 1] += w1 * b1
            radiance[pixel, 2] += w2 * b2
            continue
        px, py, pz = _start_point(corners, faces, f, u[i], v[i])
        if depth.shape[0] > 0:
            hx, hy, hz = _hit_point(corners, f, u[i], v[i])
            depth[pixel] = (hx - eye[0]) * axis[0] + (hy - eye[1]) * axis[1] + (hz - eye[2]) * axis[2]
        body = object_of_face[f]
        gx, gy, gz, lift = float(faces[f, 0]), float(faces[f, 1]), float(faces[f, 2]), float(faces[f, 3])
        entering = gx * dx + gy * dy + gz * dz < 0.0
        clear = max(
            materials[body, _TRANSMISSION], materials[body, _TRANSMISSION + 1], materials[body, _TRANSMISSION + 2]
        )
        medium = -1
        if inside.shape[1] > 0:
            if clear > 0.0 and not entering:  # an open body's back: the way to it ran inside
                _enter(inside, i, body)
            medium = _medium(inside, i, materials, -1)
        if medium >= 0:  # Beer–Lambert along the way through a body
            t = float(distances[i])
            w0 *= math.exp(-materials[medium, _ABSORPTION] * t)
            w1 *= math.exp(-materials[medium, _ABSORPTION + 1] * t)
            w2 *= math.exp(-materials[medium, _ABSORPTION + 2] * t)
        elif fog.shape[0] > 0:
            through = math.exp(-fog[3] * float(distances[i]))
            radiance[pixel, 0] += w0 * (1.0 - through) * fog[0]
            radiance[pixel, 1] += w1 * (1.0 - through) * fog[1]
            radiance[pixel, 2] += w2 * (1.0 - through) * fog[2]
            w0, w1, w2 = w0 * through, w1 * through, w2 * through
        width = abs((widths[i] if widths.shape[0] > 0 else first_width) + spread * float(distances[i]))
        au, av, bu, bv = 0.0, 0.0, 0.0, 0.0
        if width > 0.0 and materials[body, _IMAGES] > 0.0:
            au, av, bu, bv = _footprint(corners, coordinates, f, width, dx, dy, dz, gx, gy, gz)
        if spawn and materials[body, _ALPHA_BLEND] > 0.0:
            # seen through to the share that is not there; the last generation takes it as there
            there = _there(coordinates, textures, alphas, materials, body, f, u[i], v[i], au, av, bu, bv)
            w = (1.0 - there) * max(w0, w1, w2)
            if w >= least:
                _put_behind(next_origins, spawned, corners, faces, f, u[i], v[i], entering)
                _put(next_directions, spawned, dx, dy, dz)
                _put(next_weights, spawned, (1.0 - there) * w0, (1.0 - there) * w1, (1.0 - there) * w2)
                _hand_on(next_pixels, next_inside, next_keys, next_widths, spawned, pixel, inside, keys, width, i)
                counts[PASSED] += 1
                spawned += 1
            w0, w1, w2 = there * w0, there * w1, there * w2
        if not entering:
            gx, gy, gz = -gx, -gy, -gz
        nx, ny, nz = gx, gy, gz
        if normals.shape[0] > 0:
            nx, ny, nz = _shading_normal(normals, f, u[i], v[i], gx, gy, gz, dx, dy, dz)
        if materials[body, _NORMAL_MAP] >= 0:
            nx, ny, nz = _mapped_normal(
                corners, coordinates, textures, texels, f, u[i], v[i], int(materials[body, _NORMAL_MAP]),
                materials[body, _NORMAL_SCALE], entering, nx, ny, nz, dx, dy, dz, au, av, bu, bv,
            )  # fmt: skip
        if shading_normal.shape[0] > 0:
            side = 1.0 if entering else -1.0
            _put(shading_normal, pixel, side * nx, side * ny, side * nz)
        ox, oy, oz = px + lift * gx, py + lift * gy, pz + lift * gz
        smooth = normals.shape[0] > 0 and (
            normals[f, 0, 0] != 0.0 or normals[f, 0, 1] != 0.0 or normals[f, 0, 2] != 0.0
        )

        own0 = w0 * materials[body, _EMISSION]
        own1 = w1 * materials[body, _EMISSION + 1]
        own2 = w2 * materials[body, _EMISSION + 2]
        if materials[body, _EMISSION_MAP] >= 0:
            s0, s1, s2 = _interpolate(coordinates, f, u[i], v[i])
            t0, t1, t2 = _filtered(textures, int(materials[body, _EMISSION_MAP]), texels, s0, s1, au, av, bu, bv)
            own0, own1, own2 = own0 * t0, own1 * t1, own2 * t2
        local, metallic, rough = materials[body, _LOCAL], materials[body, _METALLIC], materials[body, _ROUGHNESS]
        specular, shininess, least_half = (
            materials[body, _SPECULAR],
            materials[body, _SHININESS],
            materials[body, _LEAST_HALF],
        )
        t0, t1, t2 = 1.0, 1.0, 1.0
        if materials[body, _TEXTURE] >= 0 and (local > 0.0 or metallic > 0.0):
            s0, s1, s2 = _interpolate(coordinates, f, u[i], v[i])
            row = int(materials[body, _TEXTURE])
            if width > 0.0 and textures[row, 0] == IMAGE:
                t0, t1, t2 = _filtered(textures, row, texels, s0, s1, au, av, bu, bv)
            else:
                t0, t1, t2 = texture_colour(textures, row, texels, s0, s1, s2)
        k0, k1, k2 = materials[body, _MIRROR], materials[body, _MIRROR + 1], materials[body, _MIRROR + 2]
        if metallic > 0.0 or materials[body, _GLOSS_MAP] >= 0:
            if materials[body, _GLOSS_MAP] >= 0:
                s0, s1, s2 = _interpolate(coordinates, f, u[i], v[i])
                row = int(materials[body, _GLOSS_MAP])
                _, s1, s2 = _filtered(textures, row, texels, s0, s1, au, av, bu, bv)
                rough, metallic = rough * s1, metallic * s2
            local, clear = (1.0 - metallic) * local, (1.0 - metallic) * clear
            k0 = (1.0 - metallic) * k0 + metallic * materials[body, 0] * t0
            k1 = (1.0 - metallic) * k1 + metallic * materials[body, 1] * t1
            k2 = (1.0 - metallic) * k2 + metallic * materials[body, 2] * t2
            if specular > 0.0 and materials[body, _GLOSS_MAP] >= 0:
                strength, shininess = highlight((k0 + k1 + k2) / 3.0, rough)
                specular, least_half = specular * strength, 0.0
        if local > 0.0 or specular > 0.0:
            r, g, b = local * materials[body, 0], local * materials[body, 1], local * materials[body, 2]
            r, g, b = r * t0, g * t1, b * t2
            r, g, b = w0 * r, w1 * g, w2 * b
            own0, own1, own2 = own0 + r * ambient[0], own1 + g * ambient[1], own2 + b * ambient[2]
            for k in range(lights.shape[0]):
                lx, ly, lz, reach = _towards_light(lights, k, ox, oy, oz)
                norm = 1.0 if reach == FAR else 1.0 / math.sqrt(lx * lx + ly * ly + lz * lz)
                cosine = (nx * lx + ny * ly + nz * lz) * norm
                if cosine <= 0.0 or (not smooth and gx * lx + gy * ly + gz * lz <= 0.0):
                    continue
                shine = 0.0
                if specular > 0.0:
                    hx, hy, hz = lx * norm - dx, ly * norm - dy, lz * norm - dz
                    half, square = nx * hx + ny * hy + nz * hz, hx * hx + hy * hy + hz * hz
                    # too weak to see, as nearly everywhere: told without a root or a power
                    if half > 0.0 and half * half > least_half**2 * square:
                        shine = specular * (half / math.sqrt(square)) ** shininess
                cone = _cone(lights, k, lx, ly, lz, norm) if lights[k, 0] == SPOT else 1.0
                c0 = (r * cosine + w0 * shine) * cone * lights[k, _LIGHT_COLOUR]
                c1 = (g * cosine + w1 * shine) * cone * lights[k, _LIGHT_COLOUR + 1]
                c2 = (b * cosine + w2 * shine) * cone * lights[k, _LIGHT_COLOUR + 2]
                if max(c0, c1, c2) < LEAST_WEIGHT:
                    counts[WEAK_SHADOW] += 1
                    continue
                sx, sy, sz = ox, oy, oz
                if smooth:
                    ax, ay, az = _up_to_smooth(corners, normals, f, u[i], v[i], px, py, pz, gx, gy, gz)
                    sx, sy, sz = ox + ax, oy + ay, oz + az
                    if reach != FAR:
                        lx, ly, lz = lx - ax, ly - ay, lz - az
                shadows = k * primitives.shape[0] + lit[k]
                _put(shadow_origins, shadows, sx, sy, sz)
                _put(shadow_directions, shadows, lx, ly, lz)
                _put(shadow_colours, shadows, c0, c1, c2)
                shadow_reach[shadows] = reach
                shadow_pixels[shadows] = pixel
                for j in range(inside.shape[1]):
                    shadow_inside[shadows, j] = inside[i, j]
                lit[k] += 1
        radiance[pixel, 0] += own0
        radiance[pixel, 1] += own1
        radiance[pixel, 2] += own2
        if not spawn:
            continue

        # Shares of the light that goes on: by the mirror, and by glass through Fresnel's formulas.
        m0, m1, m2 = w0 * k0, w1 * k1, w2 * k2
        if clear > 0.0:
            before, after = _media(inside, i, materials, body, entering)
            ex, ey, ez = np.float64(dx), np.float64(dy), np.float64(dz)
            cosine = -(ex * nx + ey * ny + ez * nz)
            for c in range(3 if _disperses(materials, before) or _disperses(materials, after) else 1):
                t0 = w0 * materials[body, _TRANSMISSION]
                t1 = w1 * materials[body, _TRANSMISSION + 1]
                t2 = w2 * materials[body, _TRANSMISSION + 2]
                if metallic > 0.0:
                    t0, t1, t2 = (1.0 - metallic) * t0, (1.0 - metallic) * t1, (1.0 - metallic) * t2
                if c > 0 or _disperses(materials, before) or _disperses(materials, after):  # one channel alone
                    t0, t1, t2 = t0 if c == 0 else 0.0, t1 if c == 1 else 0.0, t2 if c == 2 else 0.0
                ratio = _index(materials, before, c) / _index(materials, after, c)
                reflected, cosine_t = fresnel(cosine, ratio)
                m0, m1, m2 = m0 + reflected * t0, m1 + reflected * t1, m2 + reflected * t2
                t0, t1, t2 = (1 - reflected) * t0, (1 - reflected) * t1, (1 - reflected) * t2
                if max(t0, t1, t2) < least:
                    counts[WEAK_REFRACTION] += max(t0, t1, t2) > 0.0
                    continue
                along = ratio * cosine - cosine_t
                tx, ty, tz = ratio * ex + along * nx, ratio * ey + along * ny, ratio * ez + along * nz
                if tx * gx + ty * gy + tz * gz < 0.0:  # a bent normal must not send it back out
                    _put(next_origins, spawned, px - lift * gx, py - lift * gy, pz - lift * gz)
                    _put(next_directions, spawned, tx, ty, tz)
                    _put(next_weights, spawned, t0, t1, t2)
                    _hand_on(next_pixels, next_inside, next_keys, next_widths, spawned, pixel, inside, keys, width, i)
                    _cross(next_inside, spawned, body, entering)
                    counts[REFRACTION] += 1
                    spawned += 1
        if rough > 0.0 and max(m0, m1, m2) >= least:
            rays = min(max(math.ceil(lobe_rays * max(m0, m1, m2)), 1), lobe_rays)
            for j in range(rays):
                across, around = _in_lobe(keys[i], j * lobe_stride)
                rx, ry, rz, share = glossy_direction(rough * rough, across, around, dx, dy, dz, nx, ny, nz)
                share /= rays
                if share * max(m0, m1, m2) * rays < least:
                    counts[WEAK_REFLECTION] += 1
                    continue
                along = rx * gx + ry * gy + rz * gz
                if along <= 0.0:  # out of the face that it would go into
                    rx, ry, rz = rx - 2.0 * along * gx, ry - 2.0 * along * gy, rz - 2.0 * along * gz
                _put(next_origins, spawned, ox, oy, oz)
                _put(next_directions, spawned, rx, ry, rz)
                _put(next_weights, spawned, share * m0, share * m1, share * m2)
                _hand_on(next_pixels, next_inside, next_keys, next_widths, spawned, pixel, inside, keys, width, i)
                next_keys[spawned] = _mix(keys[i] + np.uint64(j))
                counts[REFLECTION] += 1
                spawned += 1
        elif max(m0, m1, m2) >= least:
            twice = 2.0 * (dx * nx + dy * ny + dz * nz)
            rx, ry, rz = dx - twice * nx, dy - twice * ny, dz - twice * nz
            if rx * gx + ry * gy + rz * gz <= 0.0:  # nor may it send a reflection into the face
                twice = 2.0 * (dx * gx + dy * gy + dz * gz)
                rx, ry, rz = dx - twice * gx, dy - twice * gy, dz - twice * gz
            _put(next_origins, spawned, ox, oy, oz)
            _put(next_directions, spawned, rx, ry, rz)
            _put(next_weights, spawned, m0, m1, m2)
            _hand_on(next_pixels, next_inside, next_keys, next_widths, spawned, pixel, inside, keys, width, i)
            counts[REFLECTION] += 1
            spawned += 1
        elif max(m0, m1, m2) > 0.0:
            counts[WEAK_REFLECTION] += 1
    return spawned


@inner_kernel
def _hand_on(next_pixels, next_inside, next_keys, next_widths, k, pixel, inside, keys, width, i):
    """Give a spawned ray its pixel, the bodies that it runs in, its place in lobes and its width."""
    if next_widths.shape[0] > 0:
        next_widths[k] = width
    next_pixels[k] = pixel
    for j in range(inside.shape[1]):
        next_inside[k, j] = inside[i, j]
    if next_keys.shape[0] > 0:
        next_keys[k] = keys[i]


@inline_kernel
def _in_lobe(key, step):
    """A place in [0, 1)²: the key's own, ``step`` places on along the R2 sequence (Roberts 2018)."""
    step = np.uint64(step)
    a = ((key & _LOW) + step * _R2_ACROSS) & _LOW
    b = ((key >> np.uint64(32)) + step * _R2_AROUND) & _LOW
    return a * (1.0 / 4294967296.0), b * (1.0 / 4294967296.0)


@kernel
def glossy_direction(alpha, across, around, dx, dy, dz, nx, ny, nz):
    """Reflect a direction at a facet of a GGX surface, one of those seen from there, and how much of it gets away.

    Facets are sampled in proportion to their visible area by spherical caps (Dupuy and Benyoub 2023); the share is
    G2/G1 of Smith's height-correlated shadowing (Heitz 2014), 0 for a direction into the surface. Its mean is the
    single-scattering albedo.

    Parameters
    ----------
    alpha : float
        GGX's width, above 0: the square of the roughness.
    across, around : float
        A place in [0, 1)².
    """
    cosine = -(dx * nx + dy * ny + dz * nz)
    # the surface's frame: z its normal, x away from which the ray comes
    tx, ty, tz = -dx - cosine * nx, -dy - cosine * ny, -dz - cosine * nz
    sine = math.sqrt(tx * tx + ty * ty + tz * tz)
    if sine < 1e-6:
        if abs(nx) < 0.8:
            tx, ty, tz = 1.0 - nx * nx, -nx * ny, -nx * nz
        else:
            tx, ty, tz = -ny * nx, 1.0 - ny * ny, -ny * nz
        length = math.sqrt(tx * tx + ty * ty + tz * tz)
        sine = 0.0
    else:
        length = sine
    tx, ty, tz = tx / length, ty / length, tz / length
    bx, by, bz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
    # stretched to a sphere: a cap of it, shifted, holds the facets that are seen
    vx, vz = alpha * sine, cosine
    length = math.sqrt(vx * vx + vz * vz)
    vx, vz = vx / length, vz / length
    hz = (1.0 - across) * (1.0 + vz) - vz
    radius = math.sqrt(max(1.0 - hz * hz, 0.0))
    angle = 2.0 * math.pi * around
    hx, hy, hz = alpha * (radius * math.cos(angle) + vx), alpha * radius * math.sin(angle), hz + vz
    length = math.sqrt(hx * hx + hy * hy + hz * hz)
    hx, hy, hz = hx / length, hy / length, hz / length
    twice = 2.0 * (sine * hx + cosine * hz)
    rx, ry, rz = twice * hx - sine, twice * hy, twice * hz - cosine
    if rz <= 0.0:
        return nx, ny, nz, 0.0
    seen = _smith(alpha, cosine)
    share = (1.0 + seen) / (1.0 + seen + _smith(alpha, rz))
    return rx * tx + ry * bx + rz * nx, rx * ty + ry * by + rz * ny, rx * tz + ry * bz + rz * nz, share


@inline_kernel
def _smith(alpha, cosine):
    """Smith's Λ of a GGX surface."""
    return 0.5 * (math.sqrt(1.0 + alpha * alpha * (1.0 / (cosine * cosine) - 1.0)) - 1.0)


@kernel
def highlight(f0, roughness):
    """Strength and exponent of the Blinn–Phong highlight of a microfacet surface.

    Its width is that of a lobe of α = roughness² (Karis 2013), its strength normalised D/4 seen head on, at most 1.
    """
    shininess = max(2.0 / max(roughness, 0.05) ** 4 - 2.0, 1.0)
    return min(f0 * (1.0 - roughness) * (shininess + 2.0) / 8.0, 1.0), shininess


@inline_kernel
def _up_to_smooth(corners, normals, f, u, v, px, py, pz, gx, gy, gz):
    """The way from a place in a face up to the smooth surface that the face stands for (Hanika 2021).

    The mean of the ways onto the tangent planes of the corners, where these lie above. A shadow ray from the face
    itself is stopped by the neighbouring faces wherever light grazes: a dark band with teeth.
    """
    x, y, z = 0.0, 0.0, 0.0
    for c in range(3):
        share = 1.0 - u - v if c == 0 else (u if c == 1 else v)
        nx, ny, nz = float(normals[f, c, 0]), float(normals[f, c, 1]), float(normals[f, c, 2])
        side = -1.0 if nx * gx + ny * gy + nz * gz < 0.0 else 1.0  # of a face seen from behind
        above = (px - corners[f, c, 0]) * nx + (py - corners[f, c, 1]) * ny + (pz - corners[f, c, 2]) * nz
        up = share * side * min(side * above, 0.0)
        x, y, z = x - up * nx, y - up * ny, z - up * nz
    return x, y, z


@kernel
def add_unblocked(blocked, colours, pixels, radiance):
    """Add the light of every shadow ray that arrived."""
    for i in range(blocked.shape[0]):
        if blocked[i] != 0:
            for c in range(3):
                radiance[pixels[i], c] += colours[i, c]


@kernel
def keep_unblocked(blocked, origins, directions, reach, colours, pixels, inside):
    """Pack the shadow rays that nothing opaque stops to the front.

    Returns
    -------
    int
        How many there are.
    """
    kept = 0
    for i in range(blocked.shape[0]):
        if blocked[i] != 0:
            for c in range(3):
                origins[kept, c], directions[kept, c] = origins[i, c], directions[i, c]
                colours[kept, c] = colours[i, c]
            reach[kept], pixels[kept] = reach[i], pixels[i]
            for j in range(inside.shape[1]):
                inside[kept, j] = inside[i, j]
            kept += 1
    return kept


@kernel
def pass_faces(
    found, found_u, found_v, found_distances, rows, primitives, u, v, distances, directions, inside,
    corners, faces, coordinates, object_of_face, materials, textures, alphas,
    out_origins, out_directions, out_rows,
):  # fmt: skip
    """Let rays pass the faces that are not there: cut out by alpha, or hidden in a body of higher priority.

    ``found`` are hits of the rays ``rows``, or of all if it is of no length; they are entered in the table of hits
    ``primitives``, ``u``, ``v``, ``distances``, from the ray's start. Rays that pass go into the ``out_`` arrays.

    Returns
    -------
    int
        How many rays pass.
    """
    count = 0
    for j in range(found.shape[0]):
        i = j
        if rows.shape[0] > 0:
            i = rows[j]
            primitives[i], u[i], v[i] = found[j], found_u[j], found_v[j]
            distances[i] += found_distances[j]
        f = primitives[i]
        if f < 0:
            continue
        body = object_of_face[f]
        dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
        entering = faces[f, 0] * dx + faces[f, 1] * dy + faces[f, 2] * dz < 0.0
        if not _cut_out(coordinates, textures, alphas, materials, body, f, u[i], v[i]):
            if not _transmits(materials, body):
                continue
            before, after = _media(inside, i, materials, body, entering)
            if before != after:
                continue
            _cross(inside, i, body, entering)
        _put_behind(out_origins, count, corners, faces, f, u[i], v[i], entering)
        _put(out_directions, count, dx, dy, dz)
        out_rows[count] = i
        count += 1
    return count


@kernel
def pass_clear_face(
    primitives, u, v, distances, origins, directions, reach, colours, pixels, inside,
    corners, faces, coordinates, object_of_face, materials, textures, alphas, first_clear, radiance,
):  # fmt: skip
    """Take shadow rays through the next transmissive or cut-out face: coloured shadows.

    A ray that met no face arrives and its light is added; the others are dimmed by Fresnel, colour and absorption,
    moved behind the face and kept, packed to the front. Light goes straight on: no caustics. Its angle in each body
    is that of Snell's law all the same, from the straight ray's angle to the face in air: parallel faces take what
    they would take of the bent ray.

    Returns
    -------
    int
        How many rays were kept.
    """
    kept = 0
    for i in range(primitives.shape[0]):
        dx, dy, dz = np.float64(directions[i, 0]), np.float64(directions[i, 1]), np.float64(directions[i, 2])
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        hit = primitives[i] >= 0
        f = primitives[i] + first_clear
        body = object_of_face[f] if hit else -1
        entering = hit and faces[f, 0] * dx + faces[f, 1] * dy + faces[f, 2] * dz < 0.0
        there = hit and not _cut_out(coordinates, textures, alphas, materials, body, f, u[i], v[i])
        past = 0.0  # the share that the body leaves free
        if there and materials[body, _ALPHA_BLEND] > 0.0:
            past = 1.0 - _there(coordinates, textures, alphas, materials, body, f, u[i], v[i], 0.0, 0.0, 0.0, 0.0)
        clear = there and _transmits(materials, body)
        if there and past == 0.0 and not clear:
            continue
        if clear and not entering:
            _enter(inside, i, body)
        way = min(float(distances[i]), reach[i]) if hit else reach[i]
        medium = _medium(inside, i, materials, -1)
        if medium >= 0 and way < FAR:
            for c in range(3):
                colours[i, c] *= math.exp(-materials[medium, _ABSORPTION + c] * way * length)
        if not hit:
            for c in range(3):
                radiance[pixels[i], c] += colours[i, c]
            continue
        strongest = 0.0
        before, after = -1, -1
        if clear:
            before, after = _media(inside, i, materials, body, entering)
        for c in range(3):
            through = 0.0 if there and not clear else 1.0
            if before != after:
                through = materials[body, _TRANSMISSION + c] * (
                    1.0 - _straight_reflectance(materials, before, after, c, faces, f, dx, dy, dz, length)
                )
            colours[i, c] *= past + (1.0 - past) * through
            colours[kept, c] = colours[i, c]
            strongest = max(strongest, colours[kept, c])
        if strongest < LEAST_WEIGHT:
            continue
        for j in range(inside.shape[1]):
            inside[kept, j] = inside[i, j]
        if clear:
            _cross(inside, kept, body, entering)
        _put_behind(origins, kept, corners, faces, f, u[i], v[i], entering)
        _put(directions, kept, dx, dy, dz)
        # A point light's direction ends at the light: what is left of it, as a share of the same direction.
        reach[kept] = reach[i] - distances[i] if reach[i] < FAR else FAR
        pixels[kept] = pixels[i]
        kept += 1
    return kept


@kernel
def _straight_reflectance(materials, before, after, c, faces, f, dx, dy, dz, length):
    """Fresnel's share at a face between two media for light that goes straight on at its angle in air."""
    cosine = (faces[f, 0] * dx + faces[f, 1] * dy + faces[f, 2] * dz) / length
    n1, n2 = _index(materials, before, c), _index(materials, after, c)
    within = 1.0 - (1.0 - cosine * cosine) / (n1 * n1)
    return fresnel(math.sqrt(within), n1 / n2)[0] if within > 0.0 else 1.0


@kernel
def start_inside(origins, bounds, first_body, out_rows, out_candidates):
    """Rays that start within the bounds (B, 2, 3) of bodies, and these bodies, −1 after the last.

    Returns
    -------
    int
        How many rays there are.
    """
    count = 0
    for i in range(origins.shape[0]):
        x, y, z = origins[i, 0], origins[i, 1], origins[i, 2]
        found = 0
        for b in range(bounds.shape[0]):
            if (
                bounds[b, 0, 0] <= x <= bounds[b, 1, 0]
                and bounds[b, 0, 1] <= y <= bounds[b, 1, 1]
                and bounds[b, 0, 2] <= z <= bounds[b, 1, 2]
                and found < out_candidates.shape[1]
            ):
                out_candidates[count, found] = first_body + b
                found += 1
        if found:
            for j in range(found, out_candidates.shape[1]):
                out_candidates[count, j] = -1
            out_rows[count] = i
            count += 1
    return count


@kernel
def tell_inside(
    primitives, u, v, rows, candidates, origins, directions, inside, corners, faces, object_of_face, first_clear
):
    """Tell by the first face of each candidate along a ray whether it starts inside: there the ray leaves the body.

    Rays with candidates left are moved behind the face and kept, packed to the front. A body left later was
    entered earlier: it stands before the others in ``inside``.

    Returns
    -------
    int
        How many rays were kept.
    """
    kept = 0
    for i in range(primitives.shape[0]):
        if primitives[i] < 0:
            continue
        f = primitives[i] + first_clear
        body = object_of_face[f]
        dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
        entering = faces[f, 0] * dx + faces[f, 1] * dy + faces[f, 2] * dz < 0.0
        row, was = rows[i], candidates.shape[1]
        for j in range(candidates.shape[1]):
            candidates[kept, j] = candidates[i, j]
            if candidates[kept, j] == body:
                was = j
        if was < candidates.shape[1]:
            _leave(candidates, kept, body)
            if not entering:
                for j in range(inside.shape[1] - 1, 0, -1):
                    inside[row, j] = inside[row, j - 1]
                inside[row, 0] = body
        if candidates[kept, 0] < 0:
            continue
        rows[kept] = row
        _put_behind(origins, kept, corners, faces, f, u[i], v[i], entering)
        _put(directions, kept, dx, dy, dz)
        kept += 1
    return kept


@kernel
def _medium(inside, i, materials, without):
    """The body of highest priority that a ray is in, of equal ones the first entered; −1 for none.

    ``without`` is left out once.
    """
    best = -1
    for k in range(inside.shape[1]):
        body = inside[i, k]
        if body < 0:
            break
        if body == without:
            without = -1
        elif best < 0 or materials[body, _PRIORITY] > materials[best, _PRIORITY]:
            best = body
    return best


@kernel
def _media(inside, i, materials, body, entering):
    """What is before and behind a face of a body; the same if another body hides the face (Schmidt, Budge 2002)."""
    if entering:
        before = _medium(inside, i, materials, -1)
        hidden = before >= 0 and materials[before, _PRIORITY] >= materials[body, _PRIORITY]
        return before, before if hidden else body
    after = _medium(inside, i, materials, body)
    before = _medium(inside, i, materials, -1)
    for k in range(inside.shape[1]):
        if inside[i, k] == body:
            return before, after
    # not known to be inside: an open body
    return body if after < 0 or materials[body, _PRIORITY] > materials[after, _PRIORITY] else after, after


@kernel
def _enter(inside, i, body):
    """Note that a ray is in a body, if it is not noted yet; a full list forgets."""
    for k in range(inside.shape[1]):
        if inside[i, k] == body:
            return
        if inside[i, k] < 0:
            inside[i, k] = body
            return


@kernel
def _leave(inside, i, body):
    """Take a body out of a list, once."""
    last, found = inside.shape[1] - 1, False
    for k in range(inside.shape[1]):
        found = found or inside[i, k] == body
        if found:
            inside[i, k] = inside[i, k + 1] if k < last else -1


@kernel
def _cross(inside, i, body, entering):
    if entering:
        _enter(inside, i, body)
    else:
        _leave(inside, i, body)


@inline_kernel
def _index(materials, body, c):
    """Index of refraction of a body for a channel, 1 outside of all."""
    return np.float64(materials[body, _IOR + c]) if body >= 0 else 1.0


@inline_kernel
def _disperses(materials, body):
    return body >= 0 and (
        materials[body, _IOR] != materials[body, _IOR + 1] or materials[body, _IOR] != materials[body, _IOR + 2]
    )


@inline_kernel
def _transmits(materials, body):
    return (
        max(materials[body, _TRANSMISSION], materials[body, _TRANSMISSION + 1], materials[body, _TRANSMISSION + 2])
        > 0.0
    )


@kernel
def _cut_out(coordinates, textures, alphas, materials, body, f, u, v):
    """Whether the texture's alpha leaves no surface at a place of a face."""
    if materials[body, _CUTOFF] == 0.0:
        return False
    x, y, _ = _interpolate(coordinates, f, u, v)
    return _alpha(textures, int(materials[body, _TEXTURE]), alphas, x, y) < materials[body, _CUTOFF]


@kernel
def _there(coordinates, textures, alphas, materials, body, f, u, v, au, av, bu, bv):
    """The share of a blended surface that is there: its factor times the texture's alpha, where it has one."""
    share, row = materials[body, _ALPHA_BLEND], int(materials[body, _TEXTURE])
    if row >= 0 and textures[row, 0] == IMAGE and textures[row, 4] >= 0.0:
        x, y, _ = _interpolate(coordinates, f, u, v)
        taps, level, bu, bv = _filter(textures, row, au, av, bu, bv)
        total = 0.0
        for tap in range(taps):
            s = (tap + 0.5) / taps - 0.5
            near, far, part = _levels(row, level)
            here = _alpha(textures, near, alphas, x + s * bu, y + s * bv)
            if part > 0.0:
                here += part * (_alpha(textures, far, alphas, x + s * bu, y + s * bv) - here)
            total += here
        share *= total / taps
    return share


@kernel
def _alpha(textures, row, alphas, x, y):
    """Alpha of an image at (u, v), bilinear."""
    a, b, c, d, fx, fy = _texels_at(textures, row, x, y)
    first = int(textures[row, 4]) - int(textures[row, 1])
    upper = (1 - fx) * alphas[first + a] + fx * alphas[first + b]
    lower = (1 - fx) * alphas[first + c] + fx * alphas[first + d]
    return (1 - fy) * upper + fy * lower


@kernel
def _put_behind(out, i, corners, faces, f, u, v, entering):
    """A place just behind a face, seen along a ray that enters or leaves by it."""
    px, py, pz = _start_point(corners, faces, f, u, v)
    lift = -faces[f, 3] if entering else faces[f, 3]
    _put(out, i, px + lift * faces[f, 0], py + lift * faces[f, 1], pz + lift * faces[f, 2])


@kernel
def _mapped_normal(
    corners, coordinates, textures, texels, f, u, v, row, scale, entering, nx, ny, nz, dx, dy, dz, au, av, bu, bv
):  # fmt: skip
    """The shading normal tilted by a normal map; untilted where that would turn it away from the viewer.

    Tangents are those of the face's own (u, v), made square to the shading normal; not MikkTSpace's, which are
    averaged over a mesh's corners.
    """
    s, t, _ = _interpolate(coordinates, f, u, v)
    x, y, z = _filtered(textures, row, texels, s, t, au, av, bu, bv)
    x, y, z = scale * (2.0 * x - 1.0), scale * (2.0 * y - 1.0), 2.0 * z - 1.0
    u1, v1 = coordinates[f, 1, 0] - coordinates[f, 0, 0], coordinates[f, 1, 1] - coordinates[f, 0, 1]
    u2, v2 = coordinates[f, 2, 0] - coordinates[f, 0, 0], coordinates[f, 2, 1] - coordinates[f, 0, 1]
    turn = float(u1) * v2 - float(u2) * v1
    if turn == 0.0 or x * x + y * y < 1e-12:
        return nx, ny, nz
    side = (1.0 if entering else -1.0) * (1.0 if turn > 0.0 else -1.0)
    ax, ay, az = _edge(corners, f, 1)
    bx, by, bz = _edge(corners, f, 2)
    # where u grows, and where v grows, up to a positive factor and the side
    tx, ty, tz = _square(v2 * ax - v1 * bx, v2 * ay - v1 * by, v2 * az - v1 * bz, nx, ny, nz)
    bx, by, bz = _square(u1 * bx - u2 * ax, u1 * by - u2 * ay, u1 * bz - u2 * az, nx, ny, nz)
    bx, by, bz = _square(bx, by, bz, tx, ty, tz)
    mx = side * (x * tx + y * bx) + z * nx
    my = side * (x * ty + y * by) + z * ny
    mz = side * (x * tz + y * bz) + z * nz
    length = math.sqrt(mx * mx + my * my + mz * mz)
    if length == 0.0 or mx * dx + my * dy + mz * dz >= 0.0:
        return nx, ny, nz
    return mx / length, my / length, mz / length


@inline_kernel
def _edge(corners, f, k):
    return (
        np.float64(corners[f, k, 0]) - corners[f, 0, 0],
        np.float64(corners[f, k, 1]) - corners[f, 0, 1],
        np.float64(corners[f, k, 2]) - corners[f, 0, 2],
    )


@kernel
def _square(x, y, z, nx, ny, nz):
    """The part of a vector square to a unit vector, as a unit vector; zero if there is none."""
    along = x * nx + y * ny + z * nz
    x, y, z = x - along * nx, y - along * ny, z - along * nz
    length = math.sqrt(x * x + y * y + z * z)
    return (x / length, y / length, z / length) if length > 0.0 else (0.0, 0.0, 0.0)


@kernel
def fresnel(cosine, ratio):
    """Unpolarised reflectance of a dielectric face, and the cosine behind it.

    ``ratio`` is n1/n2. Total internal reflection gives (1, 0).
    """
    sine2 = ratio * ratio * (1.0 - cosine * cosine)
    if sine2 >= 1.0:
        return 1.0, 0.0
    behind = math.sqrt(1.0 - sine2)
    s = (ratio * cosine - behind) / (ratio * cosine + behind)
    p = (ratio * behind - cosine) / (ratio * behind + cosine)
    return 0.5 * (s * s + p * p), behind


@kernel
def background_colour(background, dy):
    """Colour of the sky for a unit direction with the upward component ``dy``."""
    t = min(abs(dy) * background[9], 1.0)
    pole = 3 if dy > 0.0 else 6
    return (
        background[0] + t * (background[pole] - background[0]),
        background[1] + t * (background[pole + 1] - background[1]),
        background[2] + t * (background[pole + 2] - background[2]),
    )


@inline_kernel
def _sky(background, textures, texels, dx, dy, dz, spread):
    """Colour of the surroundings for a unit direction: of the equirectangular image, or of the gradient."""
    if background[_SKY_IMAGE] >= 0.0:
        return _sky_image(background, textures, texels, dx, dy, dz, spread)
    return background_colour(background, dy)


@kernel
def _sky_image(background, textures, texels, dx, dy, dz, spread):
    row = int(background[_SKY_IMAGE])
    half = 0.5 / textures[row, 3]  # of a texel: the top row does not run into the bottom one
    u = 0.5 + math.atan2(np.float64(dx), np.float64(dz)) / (2.0 * math.pi) - background[_SKY_TURN]
    v = 0.5 + math.asin(min(max(np.float64(dy), -1.0), 1.0)) / math.pi
    v = min(max(v, half), 1.0 - half)
    across = spread / (2.0 * math.pi * max(math.sqrt(dx * dx + dz * dz), spread, 1e-9))
    r, g, b = _filtered(textures, row, texels, u, v, across, 0.0, 0.0, spread / math.pi)
    return background[_SKY_INTENSITY] * r, background[_SKY_INTENSITY] * g, background[_SKY_INTENSITY] * b


@kernel
def encode_srgb(radiance, rows, scale, curve, out):
    """Linear light times ``scale`` to rounded integer sRGB by a curve of samples over [0, 1].

    ``rows`` says where in ``out`` each colour goes.
    """
    last = curve.shape[0] - 1
    for i in range(radiance.shape[0]):
        for c in range(3):
            x = min(max(radiance[i, c] * scale, 0.0), 1.0) * last
            j = min(int(x), last - 1)
            out[rows[i], c] = int(curve[j] + (x - j) * (curve[j + 1] - curve[j]) + 0.5)


@kernel
def jitter(seed, sample, across, down, shuffle, columns, first_row, first_column, out):
    """A place in one stratum of across × down, for each pixel its own: a hash of seed, pixel and sample.

    The stratum is ``sample``, or, if ``shuffle``, one of a walk through all that starts elsewhere in every pixel:
    places on the aperture must not follow those in the pixel.
    """
    strata = across * down
    stride = max(1, int(0.618 * strata)) if shuffle else 1
    while _common_divisor(stride, strata) > 1:
        stride += 1
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            pixel = np.uint64(first_row + i) * np.uint64(columns) + np.uint64(first_column + j)
            own = _mix(np.uint64(seed) ^ _mix(pixel))
            h = _mix(own + np.uint64(sample))
            stratum = (sample * stride + int(own >> np.uint64(33))) % strata if shuffle else sample
            x = (stratum % across + (h >> np.uint64(40)) * (1.0 / 16777216.0)) / across
            y = (stratum // across + ((h >> np.uint64(8)) & np.uint64(16777215)) * (1.0 / 16777216.0)) / down
            out[i, j, 0] = x
            out[i, j, 1] = y


@kernel
def _common_divisor(a, b):
    while b:
        a, b = b, a % b
    return a


FAR = np.float32(1e30)  # how far a shadow ray to a directional light reaches, in its own lengths


@inline_kernel
def _mix(h):
    """splitmix64's finaliser (Steele, Lea, Flood 2014)."""
    h = h + np.uint64(0x9E3779B97F4A7C15)
    h = (h ^ (h >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    h = (h ^ (h >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return h ^ (h >> np.uint64(31))


@inline_kernel
def _put(rows, i, x, y, z):
    rows[i, 0], rows[i, 1], rows[i, 2] = x, y, z


@inline_kernel
def _interpolate(values, f, u, v):
    w = 1.0 - u - v
    return (
        w * values[f, 0, 0] + u * values[f, 1, 0] + v * values[f, 2, 0],
        w * values[f, 0, 1] + u * values[f, 1, 1] + v * values[f, 2, 1],
        w * values[f, 0, 2] + u * values[f, 1, 2] + v * values[f, 2, 2],
    )


@inline_kernel
def _hit_point(corners, f, u, v):
    """The point from barycentric coordinates: it lies in the face, which origin + t·direction need not."""
    return _interpolate(corners, f, float(u), float(v))


@inline_kernel
def _start_point(corners, faces, f, u, v):
    """The hit point drawn a hair towards the middle of its face, for rays to start from.

    On an edge it would lie in the neighbouring face too, which a ray from there cannot meet: light would come in
    at the corners of a closed room.
    """
    u, v, pull = float(u), float(v), float(faces[f, 4])
    return _interpolate(corners, f, u + pull * (1.0 / 3.0 - u), v + pull * (1.0 / 3.0 - v))


@inline_kernel
def _shading_normal(normals, f, u, v, gx, gy, gz, dx, dy, dz):
    """The interpolated vertex normal on the ray's side, or the face's own where there is none or it faces away."""
    x, y, z = _interpolate(normals, f, float(u), float(v))
    length = math.sqrt(x * x + y * y + z * z)
    if length == 0.0:
        return gx, gy, gz
    if x * gx + y * gy + z * gz < 0.0:
        length = -length
    inverse = 1.0 / length
    x, y, z = x * inverse, y * inverse, z * inverse
    if x * dx + y * dy + z * dz >= 0.0:
        return gx, gy, gz
    return x, y, z


@inline_kernel
def _towards_light(lights, k, x, y, z):
    """Direction to a light, a unit vector if it is far away, and how much of that direction a shadow ray covers."""
    if lights[k, 0] == DIRECTIONAL:
        return -lights[k, 1], -lights[k, 2], -lights[k, 3], FAR
    return lights[k, 1] - x, lights[k, 2] - y, lights[k, 3] - z, np.float32(0.9999)


@inline_kernel
def _cone(lights, k, lx, ly, lz, norm):
    """Share of a spot light in a direction: 1 in its inner cone, 0 outside the outer one."""
    cosine = -(lx * lights[k, _CONE_AXIS] + ly * lights[k, _CONE_AXIS + 1] + lz * lights[k, _CONE_AXIS + 2]) * norm
    share = min(max(cosine * lights[k, _CONE_SCALE] + lights[k, _CONE_OFFSET], 0.0), 1.0)
    return share * share


@inline_kernel
def _wrap(i, n, wrap):
    """Texel i and the next one, for i from −1 on; without a division."""
    if wrap == REPEAT:
        return i if i >= 0 else n - 1, i + 1 if 0 < i + 1 < n else 0
    return max(i, 0), min(i + 1, n - 1)


@inline_kernel
def _folded(t, wrap):
    """A texture coordinate taken into the image, [0, 1]."""
    if wrap == REPEAT:
        return t - math.floor(t)
    if wrap == MIRROR:
        return abs(t - 2.0 * math.floor(0.5 * t + 0.5))  # from the nearest even number
    return min(max(t, 0.0), 1.0)


@inner_kernel
def texture_colour(table, row, texels, x, y, z):
    """Linear colour of a texture at a texture coordinate."""
    kind = table[row, 0]
    if kind == IMAGE:
        return _image(table, row, texels, x, y)
    if kind == VERTEX:
        return x, y, z
    if kind == CHECKER:
        # A face often lies just on a cell's border: decided here, not by rounding noise.
        odd = (
            math.floor(x * table[row, 1] + 1e-6)
            + math.floor(y * table[row, 2] + 1e-6)
            + math.floor(z * table[row, 3] + 1e-6)
        ) % 2
        t = 1.0 if odd else 0.0
    elif kind == STRIPES:
        s = x * table[row, 1] + y * table[row, 2] + z * table[row, 3]
        if table[row, 10] > 0.0:
            away = abs(s - 2.0 * math.floor(0.5 * s) - 0.5)  # from the middle of a stripe of the first colour
            inner = 0.5 - abs(away - 1.0)  # how far inside the second colour, in widths
            t = min(max(0.5 + inner / table[row, 10], 0.0), 1.0)
        else:
            t = 1.0 if math.floor(s + 1e-6) % 2 else 0.0
    else:
        t = 0.5 + table[row, 11] * _fractal(
            x * table[row, 1], y * table[row, 2], z * table[row, 3], int(table[row, 10])
        )
        t = min(max(t, 0.0), 1.0)
    return (
        table[row, 4] + t * (table[row, 7] - table[row, 4]),
        table[row, 5] + t * (table[row, 8] - table[row, 5]),
        table[row, 6] + t * (table[row, 9] - table[row, 6]),
    )


@inner_kernel
def _image(table, row, texels, u, v):
    """Colour of an image at (u, v), bilinear."""
    a, b, c, d, fx, fy = _texels_at(table, row, u, v)
    w00, w10, w01, w11 = (1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy
    pixels, codes = texels
    if table[row, 5] != 0.0:
        k, m, n, o = codes[a, 0], codes[b, 0], codes[c, 0], codes[d, 0]
        red = w00 * LINEAR[k] + w10 * LINEAR[m] + w01 * LINEAR[n] + w11 * LINEAR[o]
        k, m, n, o = codes[a, 1], codes[b, 1], codes[c, 1], codes[d, 1]
        green = w00 * LINEAR[k] + w10 * LINEAR[m] + w01 * LINEAR[n] + w11 * LINEAR[o]
        k, m, n, o = codes[a, 2], codes[b, 2], codes[c, 2], codes[d, 2]
        blue = w00 * LINEAR[k] + w10 * LINEAR[m] + w01 * LINEAR[n] + w11 * LINEAR[o]
    else:
        red = w00 * pixels[a, 0] + w10 * pixels[b, 0] + w01 * pixels[c, 0] + w11 * pixels[d, 0]
        green = w00 * pixels[a, 1] + w10 * pixels[b, 1] + w01 * pixels[c, 1] + w11 * pixels[d, 1]
        blue = w00 * pixels[a, 2] + w10 * pixels[b, 2] + w01 * pixels[c, 2] + w11 * pixels[d, 2]
    return red, green, blue


@kernel
def _footprint(corners, coordinates, f, width, dx, dy, dz, gx, gy, gz):
    """How far a ray's cross-section of some width reaches over (u, v): across the plane of incidence, and in it.

    A disc across the ray is an ellipse on the face (Heckbert 1986), longer by 1/cos in the plane of incidence.
    """
    ax, ay, az = _edge(corners, f, 1)
    bx, by, bz = _edge(corners, f, 2)
    mx, my, mz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    square = mx * mx + my * my + mz * mz
    if square == 0.0:
        return 0.0, 0.0, 0.0, 0.0
    px, py, pz = gy * dz - gz * dy, gz * dx - gx * dz, gx * dy - gy * dx
    sine = math.sqrt(px * px + py * py + pz * pz)
    if sine < 1e-6:
        px, py, pz = ax, ay, az
        sine = math.sqrt(px * px + py * py + pz * pz)
    px, py, pz = px / sine, py / sine, pz / sine
    qx, qy, qz = gy * pz - gz * py, gz * px - gx * pz, gx * py - gy * px
    longer = width / max(abs(dx * gx + dy * gy + dz * gz), 1e-3)
    u1, v1 = coordinates[f, 1, 0] - coordinates[f, 0, 0], coordinates[f, 1, 1] - coordinates[f, 0, 1]
    u2, v2 = coordinates[f, 2, 0] - coordinates[f, 0, 0], coordinates[f, 2, 1] - coordinates[f, 0, 1]
    # of a vector p in the face: p = i·a + j·b, i = (p × b)·m/m², j = (a × p)·m/m²
    i = ((py * bz - pz * by) * mx + (pz * bx - px * bz) * my + (px * by - py * bx) * mz) * width / square
    j = ((ay * pz - az * py) * mx + (az * px - ax * pz) * my + (ax * py - ay * px) * mz) * width / square
    k = ((qy * bz - qz * by) * mx + (qz * bx - qx * bz) * my + (qx * by - qy * bx) * mz) * longer / square
    l = ((ay * qz - az * qy) * mx + (az * qx - ax * qz) * my + (ax * qy - ay * qx) * mz) * longer / square
    return i * u1 + j * u2, i * v1 + j * v2, k * u1 + l * u2, k * v1 + l * v2


@kernel
def _filter(table, row, au, av, bu, bv):
    """Number of taps, level of each, and the way over (u, v) that they lie along: the longer of two diameters.

    The level fits the shorter diameter, or the distance of the taps where there would be too many.
    """
    width, height = table[row, 2], table[row, 3]
    a = math.sqrt((au * width) ** 2 + (av * height) ** 2)
    b = math.sqrt((bu * width) ** 2 + (bv * height) ** 2)
    if a > b:
        a, b, bu, bv = b, a, au, av
    taps = int(min(max(math.ceil(b / max(a, 1.0)), 1.0), MOST_TAPS))
    level = math.log2(max(a, b / taps, 1.0)) - SHARPER
    return taps, min(max(level, 0.0), table[row, _LEVELS]), bu, bv


@inline_kernel
def _levels(row, level):
    """Rows of the levels above and below, and how far it is to the second."""
    near = int(level)
    return row + near, row + near + 1, level - near


@kernel
def _filtered(table, row, texels, u, v, au, av, bu, bv):
    """Colour of an image over an ellipse about (u, v) of two diameters: means of its pyramid (Williams 1983)."""
    taps, level, bu, bv = _filter(table, row, au, av, bu, bv)
    near, far, part = _levels(row, level)
    if taps == 1 and level == 0.0:
        return _image(table, row, texels, u, v)
    red, green, blue = 0.0, 0.0, 0.0
    for tap in range(taps):
        s = (tap + 0.5) / taps - 0.5
        r, g, b = _image(table, near, texels, u + s * bu, v + s * bv)
        if part > 0.0:
            r1, g1, b1 = _image(table, far, texels, u + s * bu, v + s * bv)
            r, g, b = r + part * (r1 - r), g + part * (g1 - g), b + part * (b1 - b)
        red, green, blue = red + r, green + g, blue + b
    return red / taps, green / taps, blue / taps


@inner_kernel
def _texels_at(table, row, u, v):
    """The four texels about (u, v): left and right above, left and right below, and how far to right and down."""
    first, width, height = int(table[row, 1]), int(table[row, 2]), int(table[row, 3])
    across, down = int(table[row, 6]), int(table[row, 7])
    x = _folded(u, across) * width - 0.5
    y = (1.0 - _folded(v, down)) * height - 0.5
    i, j = math.floor(x), math.floor(y)
    i0, i1 = _wrap(int(i), width, across)
    j0, j1 = _wrap(int(j), height, down)
    a, b = first + j0 * width, first + j1 * width
    return a + i0, a + i1, b + i0, b + i1, x - i, y - j


@inner_kernel
def _fractal(x, y, z, packed):
    """Octaves of gradient noise, each of half the size and strength."""
    octaves, seed = packed % 16, packed // 16
    total, strength = 0.0, 1.0
    for octave in range(octaves):
        total += strength * gradient_noise(x, y, z, seed + octave)
        x, y, z, strength = 2.03 * x, 2.03 * y, 2.03 * z, 0.5 * strength
    return total


@inner_kernel
def gradient_noise(x, y, z, seed):
    """Perlin's improved gradient noise (2002) with hashed lattice gradients; about −1…1, 0 on the lattice."""
    fx, fy, fz = math.floor(x), math.floor(y), math.floor(z)
    x, y, z = x - fx, y - fy, z - fz
    u, v, w = _fade(x), _fade(y), _fade(z)
    i0, j0, k0 = np.int64(fx) * _PX + seed * _SEED, np.int64(fy) * _PY, np.int64(fz) * _PZ
    i1, j1, k1 = i0 + _PX, j0 + _PY, k0 + _PZ
    near = _lerp(
        v,
        _lerp(u, _slope(i0 ^ j0 ^ k0, x, y, z), _slope(i1 ^ j0 ^ k0, x - 1, y, z)),
        _lerp(u, _slope(i0 ^ j1 ^ k0, x, y - 1, z), _slope(i1 ^ j1 ^ k0, x - 1, y - 1, z)),
    )
    far = _lerp(
        v,
        _lerp(u, _slope(i0 ^ j0 ^ k1, x, y, z - 1), _slope(i1 ^ j0 ^ k1, x - 1, y, z - 1)),
        _lerp(u, _slope(i0 ^ j1 ^ k1, x, y - 1, z - 1), _slope(i1 ^ j1 ^ k1, x - 1, y - 1, z - 1)),
    )
    return _lerp(w, near, far)


@kernel
def terrain(x, z, seed, octaves, rough, ridged, out):
    """Heights of a fractal surface over points (m, n), about −1…1, or 0…1 if folded into ridges (Musgrave 1998).

    Ridges are rough only where they are high already: valleys stay smooth.
    """
    for i in range(x.shape[0]):
        for j in range(x.shape[1]):
            total, strength, most, weight, scale = 0.0, 1.0, 0.0, 1.0, 1.0
            for octave in range(octaves):
                # between the lattice's planes: on one of them noise is 0 at every corner
                n = gradient_noise(x[i, j] * scale, 0.37 + octave, z[i, j] * scale, seed + octave)
                if ridged:
                    n = (1.0 - abs(n)) ** 2 * weight
                    weight = min(max(1.6 * n, 0.0), 1.0)
                    most += strength
                total += strength * n
                strength *= rough
                scale *= 2.03
            out[i, j] = total / most if ridged else total


@inline_kernel
def _fade(t):
    return t * t * t * (t * (t * 6 - 15) + 10)


@inline_kernel
def _lerp(t, a, b):
    return a + t * (b - a)


@inline_kernel
def _slope(cell, x, y, z):
    """Dot product with one of twelve gradients towards the edges of a cube, chosen by a multiplicative hash."""
    h = ((cell * _GOLDEN) >> 60) & 15
    return _GRADIENTS[h, 0] * x + _GRADIENTS[h, 1] * y + _GRADIENTS[h, 2] * z

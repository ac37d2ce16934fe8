"""Compiled kernels of resection: distances of image points to projected curves.

Types are checked by hand here (numba compiles these functions from their arguments); the
shapes and units are those of ``resection``, which is the door to this file.
"""

from __future__ import annotations

import numpy as np
from numba import njit

# Strict IEEE arithmetic, so that the same input gives the same bits; division by zero gives
# infinity, as in numpy. Without the interpreter's lock: others are answered meanwhile.
compiled = njit(cache=True, error_model="numpy", nogil=True)

SEGMENT = 0
NEAR = 0.3
"""Metres in front of the camera at which curves are cut off."""
BEHIND_PX = 2000.0
"""Distance of a point whose curve lies wholly behind the camera."""
ARC_SAMPLES = 24
ARC_STEPS = 4


@compiled
def accumulate(
    parameters, kinds, shapes, pixels, curve, weight, mean, sigma, scale, half_diagonal,
    cost, gradient, information,
):  # fmt: skip
    """Cost, gradient and J^T W J of each row of parameters, written to the last three."""
    offsets = np.empty((len(pixels), 2))
    jacobians = np.empty((len(pixels), 2, 8))
    for b in range(len(parameters)):
        residual_rows(
            parameters[b], kinds, shapes, pixels, curve, half_diagonal, offsets, jacobians
        )
        total = 0.0
        g, H = gradient[b], information[b]
        g[:] = 0.0
        H[:] = 0.0
        for k in range(8):
            deviation = (parameters[b, k] - mean[k]) / sigma[k]
            total += 0.5 * deviation * deviation
            g[k] += deviation / sigma[k]
            H[k, k] += 1.0 / (sigma[k] * sigma[k])
        for n in range(len(pixels)):
            squared = offsets[n, 0] ** 2 + offsets[n, 1] ** 2
            root = np.sqrt(1.0 + squared / (scale * scale))
            total += weight[n] * scale * scale * (root - 1.0)
            w = weight[n] / root
            rows = 1 if offsets[n, 1] == 0.0 else 2
            for row in range(rows):
                e = w * offsets[n, row]
                for i in range(8):
                    j_i = jacobians[n, row, i]
                    g[i] += e * j_i
                    wj = w * j_i
                    for k in range(i + 1):
                        H[i, k] += wj * jacobians[n, row, k]
        for i in range(8):
            for k in range(i):
                H[k, i] = H[i, k]
        cost[b] = total


@compiled
def residual_rows(parameters, kinds, shapes, pixels, curve, half_diagonal, offsets, jacobians):
    """Residuals and their Jacobian for one camera, written to ``offsets`` and ``jacobians``.

    The first residual of a point is normal to the curve, the second along it (zero but beyond
    an end). Shapes (N, 2) and (N, 2, 8).
    """
    camera = unpack(parameters, half_diagonal)
    ends = np.empty(4)
    samples = np.empty((ARC_SAMPLES + 1, 2))
    place = np.empty(6)
    last = -1
    visible = False
    for n in range(len(pixels)):
        m = curve[n]
        if m != last:
            last = m
            if kinds[m] == SEGMENT:
                visible = project_segment(camera, shapes[m], ends)
            else:
                visible = sample_arc(camera, shapes[m], samples)
        inside = False
        if visible:
            if kinds[m] == SEGMENT:
                inside = nearest_on_segment(camera, shapes[m], ends, pixels[n], place)
            else:
                inside = nearest_on_arc(camera, shapes[m], samples, pixels[n], place)
        if visible and depth(camera, place) > 0.5 * NEAR:
            residual(camera, place, inside, pixels[n], offsets[n], jacobians[n])
        else:
            offsets[n, 0], offsets[n, 1] = BEHIND_PX, 0.0
            jacobians[n] = 0.0


@compiled
def unpack(parameters, half_diagonal):
    """Rotation row by row, position, focal length, kappa / half_diagonal^2 and its unit."""
    sp, cp = np.sin(parameters[0]), np.cos(parameters[0])
    st, ct = np.sin(parameters[1]), np.cos(parameters[1])
    sr, cr = np.sin(parameters[2]), np.cos(parameters[2])
    camera = np.empty(21)
    # R = Rz(-roll) Rx(-tilt) Rz(-pan)
    camera[0], camera[1], camera[2] = cr * cp - sr * ct * sp, cr * sp + sr * ct * cp, sr * st
    camera[3], camera[4], camera[5] = -sr * cp - cr * ct * sp, -sr * sp + cr * ct * cp, cr * st
    camera[6], camera[7], camera[8] = st * sp, -st * cp, ct
    camera[9:12] = parameters[3:6]
    camera[12] = np.exp(parameters[6])
    camera[13] = parameters[7] / (half_diagonal * half_diagonal)
    camera[14] = 1.0 / (half_diagonal * half_diagonal)
    camera[15], camera[16], camera[17], camera[18], camera[19], camera[20] = sp, cp, st, ct, sr, cr
    return camera


@compiled
def radial_growth(u):
    """Radius as seen over ideal radius, for u = kappa (radius / half_diagonal)^2."""
    return 1 + u + 0.5 * u * u


@compiled
def to_camera(camera, x, y, z):
    """Point of the pitch frame in the camera frame, metres."""
    dx, dy, dz = x - camera[9], y - camera[10], z - camera[11]
    return turn(camera, dx, dy, dz)


@compiled
def turn(camera, dx, dy, dz):
    """Direction of the pitch frame in the camera frame."""
    return (
        camera[0] * dx + camera[1] * dy + camera[2] * dz,
        camera[3] * dx + camera[4] * dy + camera[5] * dz,
        camera[6] * dx + camera[7] * dy + camera[8] * dz,
    )


@compiled
def depth(camera, place):
    """Depth of a place on a curve, metres."""
    return to_camera(camera, place[0], place[1], place[2])[2]


@compiled
def ideal_pixel(camera, px, py):
    """The ideal pixel that appears at (px, py): Newton on the radius."""
    kappa = camera[13]
    if kappa == 0.0:
        return px, py
    target = np.sqrt(px * px + py * py)
    rho = target
    for _ in range(4):
        u = kappa * rho * rho
        rho -= (rho * (1 + u + 0.5 * u * u) - target) / (1 + 3 * u + 2.5 * u * u)
    share = rho / target if target > 0 else 1.0
    return px * share, py * share


@compiled
def project_segment(camera, shape, ends):
    """Where along the segment the part in front of the camera begins and ends.

    Writes the two places (0 to 1 along the segment) and their depths; False where nothing is
    in front.
    """
    z0 = to_camera(camera, shape[0], shape[1], shape[2])[2]
    z1 = to_camera(camera, shape[3], shape[4], shape[5])[2]
    ends[0], ends[1], ends[2], ends[3] = 0.0, 1.0, z0, z1
    if z0 < NEAR and z1 < NEAR:
        return False
    if z0 < NEAR:
        ends[0], ends[2] = (NEAR - z0) / (z1 - z0), NEAR
    elif z1 < NEAR:
        ends[1], ends[3] = (NEAR - z0) / (z1 - z0), NEAR
    return True


@compiled
def nearest_on_segment(camera, shape, ends, pixel, place):
    """Writes the place of the segment nearest to the pixel and the segment's direction.

    Straight lines stay straight before distortion, so the nearest place is sought there; the
    residual is then taken in the image as seen.
    """
    qx, qy = ideal_pixel(camera, pixel[0], pixel[1])
    dx, dy, dz = shape[3] - shape[0], shape[4] - shape[1], shape[5] - shape[2]
    ax, ay, az = to_camera(
        camera, shape[0] + ends[0] * dx, shape[1] + ends[0] * dy, shape[2] + ends[0] * dz
    )
    bx, by, bz = to_camera(
        camera, shape[0] + ends[1] * dx, shape[1] + ends[1] * dy, shape[2] + ends[1] * dz
    )
    focal = camera[12]
    ax, ay, bx, by = focal * ax / az, focal * ay / az, focal * bx / bz, focal * by / bz
    lx, ly = bx - ax, by - ay
    squared = lx * lx + ly * ly
    s = ((qx - ax) * lx + (qy - ay) * ly) / squared if squared > 1e-12 else 0.0
    inside = 0.0 <= s <= 1.0
    s = min(max(s, 0.0), 1.0)
    # From the share of the image segment to the share of the segment in space.
    along = s * az / (bz * (1 - s) + s * az)
    t = ends[0] + along * (ends[1] - ends[0])
    place[0], place[1], place[2] = shape[0] + t * dx, shape[1] + t * dy, shape[2] + t * dz
    place[3], place[4], place[5] = dx, dy, dz
    return inside


@compiled
def sample_arc(camera, shape, samples):
    """Writes the image of points along the arc (NaN behind); False where none is in front."""
    focal, kappa = camera[12], camera[13]
    seen = False
    for i in range(ARC_SAMPLES + 1):
        angle = shape[3] + (shape[4] - shape[3]) * i / ARC_SAMPLES
        x, y, z = to_camera(
            camera, shape[0] + shape[2] * np.cos(angle), shape[1] + shape[2] * np.sin(angle), 0.0
        )
        if z < NEAR:
            samples[i, 0] = np.nan
            continue
        px, py = focal * x / z, focal * y / z
        growth = radial_growth(kappa * (px * px + py * py))
        samples[i, 0], samples[i, 1] = px * growth, py * growth
        seen = True
    return seen


@compiled
def nearest_on_arc(camera, shape, samples, pixel, place):
    """Writes the place of the arc nearest to the pixel and its tangent, starting at a chord."""
    step = (shape[4] - shape[3]) / ARC_SAMPLES
    angle, closest = shape[3], np.inf
    for i in range(ARC_SAMPLES):
        ax, ay = samples[i, 0], samples[i, 1]
        lx, ly = samples[i + 1, 0] - ax, samples[i + 1, 1] - ay
        squared = lx * lx + ly * ly
        share = ((pixel[0] - ax) * lx + (pixel[1] - ay) * ly) / squared if squared > 0 else 0.0
        share = min(max(share, 0.0), 1.0)
        distance = (ax + share * lx - pixel[0]) ** 2 + (ay + share * ly - pixel[1]) ** 2
        # A chord with an end behind the camera is NaN and never closer.
        if distance < closest:
            angle, closest = shape[3] + step * (i + share), distance
    full = shape[4] - shape[3] > 2 * np.pi - 1e-9
    focal, kappa = camera[12], camera[13]
    for _ in range(ARC_STEPS):
        sine, cosine = np.sin(angle), np.cos(angle)
        x, y, z = to_camera(camera, shape[0] + shape[2] * cosine, shape[1] + shape[2] * sine, 0.0)
        if z < NEAR:
            break
        vx, vy, vz = turn(camera, -shape[2] * sine, shape[2] * cosine, 0.0)
        px, py = focal * x / z, focal * y / z
        rho2 = px * px + py * py
        growth, bend = radial_growth(kappa * rho2), 2 * kappa * (1 + kappa * rho2)
        gx, gy = focal * (vx - x / z * vz) / z, focal * (vy - y / z * vz) / z
        inward = bend * (px * gx + py * gy)
        gx, gy = gx * growth + px * inward, gy * growth + py * inward
        ex, ey = pixel[0] - px * growth, pixel[1] - py * growth
        move = (gx * ex + gy * ey) / max(gx * gx + gy * gy, 1e-12)
        angle += min(max(move, -step), step)
    inside = full or (shape[3] <= angle <= shape[4])
    if not full:
        angle = min(max(angle, shape[3]), shape[4])
    sine, cosine = np.sin(angle), np.cos(angle)
    place[0], place[1], place[2] = shape[0] + shape[2] * cosine, shape[1] + shape[2] * sine, 0.0
    place[3], place[4], place[5] = -shape[2] * sine, shape[2] * cosine, 0.0
    return inside


@compiled
def residual(camera, place, inside, pixel, offset, jacobian):
    """Writes the offset of one image point from one place of space, and its derivatives."""
    dx, dy, dz = place[0] - camera[9], place[1] - camera[10], place[2] - camera[11]
    ux, uy, uz = turn(camera, dx, dy, dz)
    focal, kappa = camera[12], camera[13]
    nx, ny = ux / uz, uy / uz
    px, py = focal * nx, focal * ny
    rho2 = px * px + py * py
    growth = radial_growth(kappa * rho2)
    # Derivative of the seen by the ideal pixel.
    bend = 2 * kappa * (1 + kappa * rho2)
    dxx, dxy, dyy = growth + bend * px * px, bend * px * py, growth + bend * py * py
    ex, ey = pixel[0] - px * growth, pixel[1] - py * growth
    # Unit tangent of the projected curve: it splits the offset into normal and along.
    vx, vy, vz = turn(camera, place[3], place[4], place[5])
    ix, iy = focal * (vx - nx * vz) / uz, focal * (vy - ny * vz) / uz
    gx, gy = dxx * ix + dxy * iy, dxy * ix + dyy * iy
    length = np.sqrt(gx * gx + gy * gy)
    if length > 1e-12:
        gx, gy = gx / length, gy / length
    else:
        gx, gy = 1.0, 0.0
    offset[0] = gx * ey - gy * ex
    offset[1] = 0.0 if inside else gx * ex + gy * ey
    projection_derivatives(camera, dx, dy, dz, jacobian)
    for k in range(8):
        jx, jy = jacobian[0, k], jacobian[1, k]
        jacobian[0, k] = gy * jx - gx * jy
        jacobian[1, k] = 0.0 if inside else -(gx * jx + gy * jy)


@compiled
def projection_derivatives(camera, dx, dy, dz, derivatives):
    """Writes the derivatives of the seen pixel by the parameters, shape (2, 8).

    (dx, dy, dz) is the point less the camera's position, pitch frame.
    """
    ux, uy, uz = turn(camera, dx, dy, dz)
    focal, kappa, unit = camera[12], camera[13], camera[14]
    nx, ny = ux / uz, uy / uz
    px, py = focal * nx, focal * ny
    rho2 = px * px + py * py
    growth = radial_growth(kappa * rho2)
    bend = 2 * kappa * (1 + kappa * rho2)
    dxx, dxy, dyy = growth + bend * px * px, bend * px * py, growth + bend * py * py
    sp, cp, st, ct, sr, cr = camera[15], camera[16], camera[17], camera[18], camera[19], camera[20]
    along, across = cp * dx + sp * dy, -sp * dx + cp * dy
    lifted = -st * across + ct * dz
    lowered = ct * across + st * dz
    for k in range(8):
        a, b, c = 0.0, 0.0, 0.0
        if k == 0:
            # d Rz(-pan) X / d pan = (across, -along, 0), then tilted and rolled.
            a = cr * across - sr * ct * along
            b = -sr * across - cr * ct * along
            c = st * along
        elif k == 1:
            a, b, c = sr * lifted, cr * lifted, -lowered
        elif k == 2:
            a, b, c = uy, -ux, 0.0
        elif k < 6:
            a, b, c = -camera[k - 3], -camera[k], -camera[k + 3]
        if k < 6:
            qx, qy = focal * (a - nx * c) / uz, focal * (b - ny * c) / uz
            jx, jy = dxx * qx + dxy * qy, dxy * qx + dyy * qy
        elif k == 6:
            jx, jy = dxx * px + dxy * py, dxy * px + dyy * py
        else:
            share = rho2 * unit * (1 + kappa * rho2)
            jx, jy = px * share, py * share
        derivatives[0, k], derivatives[1, k] = jx, jy


@compiled
def point_rows(parameters, points, half_diagonals, derivatives):
    """Writes ``projection_derivatives`` of a point in each of many cameras, shape (N, 2, 8)."""
    for n in range(len(parameters)):
        camera = unpack(parameters[n], half_diagonals[n])
        dx, dy, dz = points[n] - parameters[n, 3:6]
        projection_derivatives(camera, dx, dy, dz, derivatives[n])

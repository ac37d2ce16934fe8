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
def accumulate_equations(
    parameters, kinds, shapes, pixels, curve, weight, mean, sigma, scale, half_diagonal,
    cost, gradient, information,
):  # fmt: skip
    """Cost, gradient and J^T W J of each row of parameters, written to the last three.

    Parameters (B, 8); kinds and shapes of the curves as ``resection.Curves`` has them; pixels
    (N, 2) with curve and weight (N,); mean and sigma of the prior (8,); scale of the soft-L1 loss
    and half diagonal in pixels. Cost (B,), gradient (B, 8), information (B, 8, 8).
    """
    offsets = np.empty((len(pixels), 2))
    jacobians = np.empty((len(pixels), 2, 8))
    arcs, ideal = sample_arc_points(kinds, shapes), np.empty((2, len(pixels)))
    samples, place = np.empty((5, ARC_SAMPLES + 1)), np.empty(6)
    for b in range(len(parameters)):
        camera = unpack_camera(parameters[b], half_diagonal)
        residual_rows_of_camera(
            camera, kinds, shapes, arcs, pixels, curve, ideal, samples, place, offsets, jacobians
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
                    g[i] += e * jacobians[n, row, i]
                # Whole rows, though the lower triangle alone counts: they are added eight at once.
                for i in range(8):
                    wj = w * jacobians[n, row, i]
                    for k in range(8):
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
    residual_rows_of_camera(
        unpack_camera(parameters, half_diagonal), kinds, shapes, sample_arc_points(kinds, shapes), pixels, curve,
        np.empty((2, len(pixels))), np.empty((5, ARC_SAMPLES + 1)), np.empty(6),
        offsets, jacobians,
    )  # fmt: skip


@compiled
def residual_rows_of_camera(
    camera, kinds, shapes, arcs, pixels, curve, ideal, samples, place, offsets, jacobians
):
    """``residual_rows`` of a camera: pixels (N, 2) with their curve (N,).

    ``arcs`` are ``sample_arc_points``. Room: ideal (2, N), samples (5, ARC_SAMPLES + 1), place (6,).
    Written: offsets (N, 2), pixels, and jacobians (N, 2, 8).
    """
    ideal_pixels(camera, pixels, ideal)
    shares = np.empty((2, ARC_SAMPLES))
    last = -1
    visible = False
    ends = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for n in range(len(pixels)):
        m = curve[n]
        x, y = pixels[n, 0], pixels[n, 1]
        if m != last:
            last = m
            if kinds[m] == SEGMENT:
                visible, ends = project_segment(camera, shapes, m)
            else:
                visible = project_arc(camera, arcs, m, samples)
        inside = False
        if visible:
            if kinds[m] == SEGMENT:
                inside = find_nearest_on_segment(shapes, m, ends, ideal[0, n], ideal[1, n], place)
            else:
                inside = find_nearest_on_arc(camera, shapes, m, samples, shares, x, y, place)
        if visible and curve_depth(camera, place) > 0.5 * NEAR:
            write_residual_row(camera, place, inside, x, y, offsets, jacobians, n)
        else:
            offsets[n, 0], offsets[n, 1] = BEHIND_PX, 0.0
            for k in range(8):
                jacobians[n, 0, k] = 0.0
                jacobians[n, 1, k] = 0.0


@compiled
def sample_arc_points(kinds, shapes):
    """Points along each arc, metres, shape (M, ARC_SAMPLES + 1, 2); no camera moves them."""
    points = np.zeros((len(kinds), ARC_SAMPLES + 1, 2))
    for m in range(len(kinds)):
        if kinds[m] != SEGMENT:
            for i in range(ARC_SAMPLES + 1):
                angle = shapes[m, 3] + (shapes[m, 4] - shapes[m, 3]) * i / ARC_SAMPLES
                points[m, i, 0] = shapes[m, 0] + shapes[m, 2] * np.cos(angle)
                points[m, i, 1] = shapes[m, 1] + shapes[m, 2] * np.sin(angle)
    return points


@compiled
def unpack_camera(parameters, half_diagonal):
    """Rotation row by row, position, focal length, kappa / half_diagonal^2 and its unit.

    A tuple: kernels count who holds an array each time that they hand it on.
    """
    sp, cp = np.sin(parameters[0]), np.cos(parameters[0])
    st, ct = np.sin(parameters[1]), np.cos(parameters[1])
    sr, cr = np.sin(parameters[2]), np.cos(parameters[2])
    # R = Rz(-roll) Rx(-tilt) Rz(-pan)
    return (
        cr * cp - sr * ct * sp, cr * sp + sr * ct * cp, sr * st,
        -sr * cp - cr * ct * sp, -sr * sp + cr * ct * cp, cr * st,
        st * sp, -st * cp, ct,
        parameters[3], parameters[4], parameters[5],
        np.exp(parameters[6]), parameters[7] / (half_diagonal * half_diagonal),
        1.0 / (half_diagonal * half_diagonal), sp, cp, st, ct, sr, cr,
    )  # fmt: skip


@compiled
def radial_growth_factor(u):
    """Radius as seen over ideal radius, for u = kappa (radius / half_diagonal)^2."""
    return 1 + u + 0.5 * u * u


@compiled
def distortion_and_derivative(kappa, px, py):
    """Growth of the radius, and the derivative of the seen by the ideal pixel (xx, xy, yy).

    (px, py) is the ideal pixel less the principal point.
    """
    rho2 = px * px + py * py
    growth, bend = radial_growth_factor(kappa * rho2), 2 * kappa * (1 + kappa * rho2)
    return growth, growth + bend * px * px, bend * px * py, growth + bend * py * py


@compiled
def distort_step(kappa, px, py, ix, iy):
    """Growth of the radius, and a small step (ix, iy) of the ideal pixel as it is seen."""
    rho2 = px * px + py * py
    growth, bend = radial_growth_factor(kappa * rho2), 2 * kappa * (1 + kappa * rho2)
    inward = bend * (px * ix + py * iy)
    return growth, ix * growth + px * inward, iy * growth + py * inward


@compiled
def pitch_to_camera(camera, x, y, z):
    """Point of the pitch frame in the camera frame, metres."""
    dx, dy, dz = x - camera[9], y - camera[10], z - camera[11]
    return rotate_to_camera(camera, dx, dy, dz)


@compiled
def rotate_to_camera(camera, dx, dy, dz):
    """Direction of the pitch frame in the camera frame."""
    return (
        camera[0] * dx + camera[1] * dy + camera[2] * dz,
        camera[3] * dx + camera[4] * dy + camera[5] * dz,
        camera[6] * dx + camera[7] * dy + camera[8] * dz,
    )


@compiled
def curve_depth(camera, place):
    """Depth of a place on a curve, metres."""
    return pitch_to_camera(camera, place[0], place[1], place[2])[2]


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
def ideal_pixels(camera, pixels, ideal):
    """Writes ``ideal_pixel`` of many pixels, shape (2, N): several at once, as nothing branches."""
    kappa = camera[13]
    for n in range(len(pixels)):
        ideal[0, n], ideal[1, n] = pixels[n, 0], pixels[n, 1]
    if kappa == 0.0:
        return
    for n in range(len(pixels)):
        px, py = ideal[0, n], ideal[1, n]
        target = np.sqrt(px * px + py * py)
        rho = target
        for _ in range(4):
            u = kappa * rho * rho
            rho -= (rho * (1 + u + 0.5 * u * u) - target) / (1 + 3 * u + 2.5 * u * u)
        share = rho / target if target > 0 else 1.0
        ideal[0, n], ideal[1, n] = px * share, py * share


@compiled
def project_segment(camera, shapes, m):
    """Whether any of a segment is in front of the camera, and its part that is: where it begins
    and ends (0 to 1 along the segment), both ends' ideal pixels, and their depths."""
    x0, y0, z0 = shapes[m, 0], shapes[m, 1], shapes[m, 2]
    first = pitch_to_camera(camera, x0, y0, z0)[2]
    last = pitch_to_camera(camera, shapes[m, 3], shapes[m, 4], shapes[m, 5])[2]
    begin, end = 0.0, 1.0
    if first < NEAR and last < NEAR:
        return False, (0.0, 1.0, 0.0, 0.0, 0.0, 0.0, first, last)
    if first < NEAR:
        begin = (NEAR - first) / (last - first)
    elif last < NEAR:
        end = (NEAR - first) / (last - first)
    dx, dy, dz = shapes[m, 3] - x0, shapes[m, 4] - y0, shapes[m, 5] - z0
    ax, ay, az = pitch_to_camera(camera, x0 + begin * dx, y0 + begin * dy, z0 + begin * dz)
    bx, by, bz = pitch_to_camera(camera, x0 + end * dx, y0 + end * dy, z0 + end * dz)
    focal = camera[12]
    ax, ay, bx, by = focal * ax / az, focal * ay / az, focal * bx / bz, focal * by / bz
    return True, (begin, end, ax, ay, bx, by, az, bz)


@compiled
def find_nearest_on_segment(shapes, m, ends, qx, qy, place):
    """Writes the place of the segment nearest to an ideal pixel and the segment's direction.

    Straight lines stay straight before distortion, so the nearest place is sought there; the
    residual is then taken in the image as seen.
    """
    begin, end, ax, ay, bx, by, az, bz = ends
    dx, dy, dz = (
        shapes[m, 3] - shapes[m, 0],
        shapes[m, 4] - shapes[m, 1],
        shapes[m, 5] - shapes[m, 2],
    )
    lx, ly = bx - ax, by - ay
    squared = lx * lx + ly * ly
    s = ((qx - ax) * lx + (qy - ay) * ly) / squared if squared > 1e-12 else 0.0
    inside = 0.0 <= s <= 1.0
    s = min(max(s, 0.0), 1.0)
    # From the share of the image segment to the share of the segment in space.
    along = s * az / (bz * (1 - s) + s * az)
    t = begin + along * (end - begin)
    place[0], place[1], place[2] = (
        shapes[m, 0] + t * dx,
        shapes[m, 1] + t * dy,
        shapes[m, 2] + t * dz,
    )
    place[3], place[4], place[5] = dx, dy, dz
    return inside


@compiled
def project_arc(camera, arcs, m, samples):
    """Writes the image of points along the arc (NaN behind), and of each chord between them its
    direction and squared length, shape (5, ARC_SAMPLES + 1); False where none is in front."""
    focal, kappa = camera[12], camera[13]
    seen = False
    for i in range(ARC_SAMPLES + 1):
        x, y, z = pitch_to_camera(camera, arcs[m, i, 0], arcs[m, i, 1], 0.0)
        if z < NEAR:
            samples[0, i] = np.nan
            continue
        px, py = focal * x / z, focal * y / z
        growth = radial_growth_factor(kappa * (px * px + py * py))
        samples[0, i], samples[1, i] = px * growth, py * growth
        seen = True
    for i in range(ARC_SAMPLES):
        lx, ly = samples[0, i + 1] - samples[0, i], samples[1, i + 1] - samples[1, i]
        samples[2, i], samples[3, i], samples[4, i] = lx, ly, lx * lx + ly * ly
    return seen


@compiled
def find_nearest_on_arc(camera, shapes, m, samples, shares, pixel_x, pixel_y, place):
    """Writes the place of the arc nearest to the pixel and its tangent, starting at a chord."""
    x0, y0, radius, start, stop = (
        shapes[m, 0],
        shapes[m, 1],
        shapes[m, 2],
        shapes[m, 3],
        shapes[m, 4],
    )
    step = (stop - start) / ARC_SAMPLES
    for i in range(ARC_SAMPLES):
        ax, ay, lx, ly = samples[0, i], samples[1, i], samples[2, i], samples[3, i]
        squared = samples[4, i]
        share = ((pixel_x - ax) * lx + (pixel_y - ay) * ly) / squared if squared > 0 else 0.0
        share = min(max(share, 0.0), 1.0)
        shares[0, i] = share
        shares[1, i] = (ax + share * lx - pixel_x) ** 2 + (ay + share * ly - pixel_y) ** 2
    angle, closest = start, np.inf
    for i in range(ARC_SAMPLES):
        # A chord with an end behind the camera is NaN and never closer.
        if shares[1, i] < closest:
            angle, closest = start + step * (i + shares[0, i]), shares[1, i]
    full = stop - start > 2 * np.pi - 1e-9
    focal, kappa = camera[12], camera[13]
    for _ in range(ARC_STEPS):
        sine, cosine = np.sin(angle), np.cos(angle)
        x, y, z = pitch_to_camera(camera, x0 + radius * cosine, y0 + radius * sine, 0.0)
        if z < NEAR:
            break
        vx, vy, vz = rotate_to_camera(camera, -radius * sine, radius * cosine, 0.0)
        px, py = focal * x / z, focal * y / z
        gx, gy = focal * (vx - x / z * vz) / z, focal * (vy - y / z * vz) / z
        growth, gx, gy = distort_step(kappa, px, py, gx, gy)
        ex, ey = pixel_x - px * growth, pixel_y - py * growth
        move = (gx * ex + gy * ey) / max(gx * gx + gy * gy, 1e-12)
        angle += min(max(move, -step), step)
    inside = full or (start <= angle <= stop)
    if not full:
        angle = min(max(angle, start), stop)
    sine, cosine = np.sin(angle), np.cos(angle)
    place[0], place[1], place[2] = x0 + radius * cosine, y0 + radius * sine, 0.0
    place[3], place[4], place[5] = -radius * sine, radius * cosine, 0.0
    return inside


@compiled
def write_residual_row(camera, place, inside, pixel_x, pixel_y, offsets, jacobians, n):
    """Writes the offset of an image point from a place of space, and its derivatives, as row ``n``."""
    dx, dy, dz = place[0] - camera[9], place[1] - camera[10], place[2] - camera[11]
    ux, uy, uz = rotate_to_camera(camera, dx, dy, dz)
    focal, kappa = camera[12], camera[13]
    nx, ny = ux / uz, uy / uz
    px, py = focal * nx, focal * ny
    growth, dxx, dxy, dyy = distortion_and_derivative(kappa, px, py)
    ex, ey = pixel_x - px * growth, pixel_y - py * growth
    # Unit tangent of the projected curve: it splits the offset into normal and along.
    vx, vy, vz = rotate_to_camera(camera, place[3], place[4], place[5])
    ix, iy = focal * (vx - nx * vz) / uz, focal * (vy - ny * vz) / uz
    gx, gy = dxx * ix + dxy * iy, dxy * ix + dyy * iy
    length = np.sqrt(gx * gx + gy * gy)
    if length > 1e-12:
        gx, gy = gx / length, gy / length
    else:
        gx, gy = 1.0, 0.0
    offsets[n, 0] = gx * ey - gy * ex
    offsets[n, 1] = 0.0 if inside else gx * ex + gy * ey
    write_derivative_row(camera, dx, dy, dz, jacobians, n)
    for k in range(8):
        jx, jy = jacobians[n, 0, k], jacobians[n, 1, k]
        jacobians[n, 0, k] = gy * jx - gx * jy
        jacobians[n, 1, k] = 0.0 if inside else -(gx * jx + gy * jy)


@compiled
def projection_derivatives(camera, dx, dy, dz, derivatives):
    """Writes the derivatives of the seen pixel by the parameters, shape (2, 8).

    (dx, dy, dz) is the point less the camera's position, pitch frame.
    """
    write_derivative_row(camera, dx, dy, dz, derivatives.reshape((1, 2, 8)), 0)


@compiled
def write_derivative_row(camera, dx, dy, dz, derivatives, n):
    """``projection_derivatives`` into row ``n`` of many."""
    ux, uy, uz = rotate_to_camera(camera, dx, dy, dz)
    focal, kappa, unit = camera[12], camera[13], camera[14]
    nx, ny = ux / uz, uy / uz
    px, py = focal * nx, focal * ny
    _, dxx, dxy, dyy = distortion_and_derivative(kappa, px, py)
    sp, cp, st, ct, sr, cr = camera[15], camera[16], camera[17], camera[18], camera[19], camera[20]
    along, across = cp * dx + sp * dy, -sp * dx + cp * dy
    lifted = -st * across + ct * dz
    lowered = ct * across + st * dz
    # d Rz(-pan) X / d pan = (across, -along, 0), then tilted and rolled.
    _pixel_derivative_of_motion(
        derivatives,
        n,
        0,
        cr * across - sr * ct * along,
        -sr * across - cr * ct * along,
        st * along,
        focal,
        nx,
        ny,
        uz,
        dxx,
        dxy,
        dyy,
    )
    _pixel_derivative_of_motion(
        derivatives, n, 1, sr * lifted, cr * lifted, -lowered, focal, nx, ny, uz, dxx, dxy, dyy
    )
    _pixel_derivative_of_motion(derivatives, n, 2, uy, -ux, 0.0, focal, nx, ny, uz, dxx, dxy, dyy)
    r = camera
    _pixel_derivative_of_motion(
        derivatives, n, 3, -r[0], -r[3], -r[6], focal, nx, ny, uz, dxx, dxy, dyy
    )
    _pixel_derivative_of_motion(
        derivatives, n, 4, -r[1], -r[4], -r[7], focal, nx, ny, uz, dxx, dxy, dyy
    )
    _pixel_derivative_of_motion(
        derivatives, n, 5, -r[2], -r[5], -r[8], focal, nx, ny, uz, dxx, dxy, dyy
    )
    derivatives[n, 0, 6], derivatives[n, 1, 6] = dxx * px + dxy * py, dxy * px + dyy * py
    rho2 = px * px + py * py
    share = rho2 * unit * (1 + kappa * rho2)
    derivatives[n, 0, 7], derivatives[n, 1, 7] = px * share, py * share


@compiled
def _pixel_derivative_of_motion(derivatives, n, k, a, b, c, focal, nx, ny, uz, dxx, dxy, dyy):
    """Writes what the pixel does when the point moves by (a, b, c) in the camera frame."""
    qx, qy = focal * (a - nx * c) / uz, focal * (b - ny * c) / uz
    derivatives[n, 0, k], derivatives[n, 1, k] = dxx * qx + dxy * qy, dxy * qx + dyy * qy


@compiled
def derivative_rows_of_points(parameters, points, half_diagonals, derivatives):
    """Writes ``projection_derivatives`` of a point in each of many cameras, shape (N, 2, 8)."""
    for n in range(len(parameters)):
        camera = unpack_camera(parameters[n], half_diagonals[n])
        dx, dy, dz = points[n] - parameters[n, 3:6]
        projection_derivatives(camera, dx, dy, dz, derivatives[n])

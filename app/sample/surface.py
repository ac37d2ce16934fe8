"""Surface: grass, lines, boards, stands and sky, one ray for each pixel.

Lines have their true width: each pixel takes the share of its footprint on the grass that is
painted, so that a far line fades instead of growing to a whole pixel.
"""

from __future__ import annotations

import math

import numba
import numpy as np

HALF_LENGTH, HALF_WIDTH = 52.5, 34.0
HALF_LINE = 0.06
BOARD_HEIGHT = 0.95
SEAT_WIDTH, ROW_DEPTH = 0.54, 0.86
TILE = 512
"""Side of a noise tile; a power of two, so that wrapping is a mask."""

_jit = numba.njit(cache=True, nogil=True, fastmath=False)


@_jit
def _hash(i: int, j: int, k: int) -> float:
    """A number in [0, 1) that belongs to the cell (i, j) of layer k."""
    h = np.uint32(i * 374761393 + j * 668265263 + k * 2147483647 + 1013904223)
    h = np.uint32((h ^ (h >> np.uint32(13))) * np.uint32(1274126177))
    h = np.uint32((h ^ (h >> np.uint32(15))) * np.uint32(2246822519))
    return float(h ^ (h >> np.uint32(16))) / 4294967296.0


@_jit
def _tile(tile: np.ndarray, x: float, y: float) -> float:
    """Bilinear value of a wrapping noise tile; x and y in cells."""
    fx, fy = math.floor(x), math.floor(y)
    i, j = int(fx), int(fy)
    u, v = x - fx, y - fy
    i0, j0 = i & (TILE - 1), j & (TILE - 1)
    i1, j1 = (i + 1) & (TILE - 1), (j + 1) & (TILE - 1)
    top = tile[j0, i0] + u * (tile[j0, i1] - tile[j0, i0])
    low = tile[j1, i0] + u * (tile[j1, i1] - tile[j1, i0])
    value: float = top + v * (low - top)
    return value


@_jit
def _stroke(distance: float, width: float, half: float) -> float:
    """Share of a footprint of that width that a line of half width ``half`` covers."""
    if abs(distance) > half + 0.5 * width:
        return 0.0
    low = max(distance - 0.5 * width, -half)
    high = min(distance + 0.5 * width, half)
    return max(high - low, 0.0) / width


@_jit
def _step(distance: float, width: float) -> float:
    """Share of a footprint that lies on the positive side."""
    if abs(distance) > 0.5 * width:
        return 1.0 if distance > 0 else 0.0
    return distance / width + 0.5


@_jit
def _paint(gx: float, gy: float, ax_x: float, ax_y: float, ay_x: float, ay_y: float) -> float:
    """Share of a pixel that is painted white.

    (ax_x, ax_y) is the step on the grass for one pixel to the right, (ay_x, ay_y) for one down.
    """
    x, y = abs(gx), abs(gy)
    wx = abs(ax_x) + abs(ay_x) + 1e-6
    wy = abs(ax_y) + abs(ay_y) + 1e-6
    paint = 0.0
    end_x, end_y = _step(HALF_LENGTH + HALF_LINE - x, wx), _step(HALF_WIDTH + HALF_LINE - y, wy)
    paint = max(paint, _stroke(y - HALF_WIDTH, wy, HALF_LINE) * end_x)
    paint = max(paint, _stroke(x - HALF_LENGTH, wx, HALF_LINE) * end_y)
    paint = max(paint, _stroke(x, wx, HALF_LINE) * end_y)
    for depth, half in ((16.5, 20.16), (5.5, 9.16)):
        front = HALF_LENGTH - depth
        end = _step(half + HALF_LINE - y, wy)
        paint = max(paint, _stroke(x - front, wx, HALF_LINE) * end)
        end = _step(x - front + HALF_LINE, wx) * end_x
        paint = max(paint, _stroke(y - half, wy, HALF_LINE) * end)
    paint = max(paint, _ring(gx, gy, 9.15, ax_x, ax_y, ay_x, ay_y))
    sign = 1.0 if gx > 0 else -1.0
    off = gx - sign * 41.5
    outside = _step(36.0 - x + HALF_LINE, wx)
    if outside > 0.0:
        paint = max(paint, _ring(off, gy, 9.15, ax_x, ax_y, ay_x, ay_y) * outside)
    if x < HALF_LENGTH + 0.06 and y < HALF_WIDTH + 0.06:
        corner_x, corner_y = x - HALF_LENGTH, y - HALF_WIDTH
        if corner_x > -1.5 and corner_y > -1.5:
            # Footprints are symmetric, so the mirrored corner may use the same steps.
            paint = max(paint, _ring(corner_x, corner_y, 1.0, ax_x, ax_y, ay_x, ay_y))
    width = 0.5 * (wx + wy)
    paint = max(paint, _step(0.12 - math.hypot(off, gy), width) * min(1.0, 0.24 / wy))
    return max(paint, _step(0.13 - math.hypot(gx, gy), width) * min(1.0, 0.26 / wy))


@_jit
def _ring(
    x: float, y: float, radius: float, ax_x: float, ax_y: float, ay_x: float, ay_y: float
) -> float:
    r = math.hypot(x, y)
    if abs(r - radius) > 6.0 or r < 1e-6:
        return 0.0
    width = (abs(x * ax_x + y * ax_y) + abs(x * ay_x + y * ay_y)) / r + 1e-6
    return _stroke(r - radius, width, HALF_LINE)


@_jit
def _bands(s: float, band: float, width: float) -> float:
    """-1 and +1 in turn along s, smoothed over a footprint of that width."""
    edge = min(max(width, 0.12), band)
    phase = s / band
    k = math.floor(phase)
    inside = (phase - k) * band
    value = 1.0 if int(k) & 1 else -1.0
    if inside < 0.5 * edge:
        return value * (inside / (0.5 * edge))
    if band - inside < 0.5 * edge:
        return value * ((band - inside) / (0.5 * edge))
    return value


@_jit
def _side_hit(
    s0: float, ds: float, h0: float, dh: float, board: float, along: float, dalong: float,
    reach: float, profile: np.ndarray,
) -> tuple[float, int, float]:  # fmt: skip
    """The first thing that a ray meets on one side: its t, its part and the place on the part.

    Part -1 is nothing, 0 the board, 1 + i the i-th piece of the profile.
    """
    best, part, place = 1e9, -1, 0.0
    t = (board - s0) / ds
    h = h0 + dh * t
    # Boards end where those of the next side begin.
    if t > 0 and 0.0 <= h <= BOARD_HEIGHT and abs(along + dalong * t) <= reach:
        best, part, place = t, 0, h
    for i in range(profile.shape[0] - 1):
        ex, ey = profile[i + 1, 0] - profile[i, 0], profile[i + 1, 1] - profile[i, 1]
        cross = ds * ey - dh * ex
        if abs(cross) < 1e-12:
            continue
        px, py = profile[i, 0] - s0, profile[i, 1] - h0
        t = (px * ey - py * ex) / cross
        if t <= 0.0 or t >= best:
            continue
        length = math.sqrt(ex * ex + ey * ey)
        at = ((s0 + ds * t - profile[i, 0]) * ex + (h0 + dh * t - profile[i, 1]) * ey) / length
        if 0.0 <= at <= length:
            best, part, place = t, 1 + i, at
    return best, part, place


@_jit
def _tier_hit(
    s0: float, ds: float, h0: float, dh: float, profile: np.ndarray
) -> tuple[float, float]:
    """Where a ray from above meets the first tier: its t (1e9: nowhere) and the place on it."""
    ex, ey = profile[2, 0] - profile[1, 0], profile[2, 1] - profile[1, 1]
    cross = ds * ey - dh * ex
    if abs(cross) < 1e-12:
        return 1e9, 0.0
    t = ((profile[1, 0] - s0) * ey - (profile[1, 1] - h0) * ex) / cross
    length = math.sqrt(ex * ex + ey * ey)
    at = ((s0 + ds * t - profile[1, 0]) * ex + (h0 + dh * t - profile[1, 1]) * ey) / length
    if t <= 0.0 or at < 0.0 or at > length:
        return 1e9, 0.0
    return t, at


@_jit
def _crowd(
    out: np.ndarray, u: float, v: float, layer: int, foot: float,
    crowd: np.ndarray, seat: np.ndarray, empty: float,
) -> None:  # fmt: skip
    """Colour of a place in a stand: people in rows, empty seats, stairs."""
    column, row = math.floor(u / SEAT_WIDTH), math.floor(v / ROW_DEPTH)
    lu, lv = u / SEAT_WIDTH - column, v / ROW_DEPTH - row
    i, j = int(column), int(row)
    if i % 24 == 0:
        step = 0.8 + 0.25 * (1.0 if lv > 0.5 else 0.0)
        out[0], out[1], out[2] = 96.0 * step, 98.0 * step, 100.0 * step
        return
    pick = _hash(i, j, layer)
    if pick < empty:
        shade = 0.55 + 0.45 * (1.0 if 0.15 < lv < 0.7 and 0.1 < lu < 0.9 else 0.0)
        out[0], out[1], out[2] = seat[0] * shade, seat[1] * shade, seat[2] * shade
        return
    who = int(_hash(i, j, layer + 7) * crowd.shape[0])
    light = 0.62 + 0.5 * _hash(i, j, layer + 13)
    head_u, head_v = 0.5 + 0.24 * (_hash(i, j, layer + 3) - 0.5), 0.70 + 0.1 * (pick - 0.5)
    du, dv = (lu - head_u) * SEAT_WIDTH, (lv - head_v) * ROW_DEPTH * 0.62
    if du * du + dv * dv < 0.0125:
        tone = 0.45 + 0.55 * _hash(i, j, layer + 5)
        hair = 0.45 if lv > head_v + 0.06 else 1.0
        out[0], out[1], out[2] = 126.0 * tone * hair, 158.0 * tone * hair, 208.0 * tone * hair
    elif lv < head_v and abs(lu - 0.5) < 0.42:
        dim = light * (0.62 + 0.38 * min(1.0, lv / 0.4))
        out[0], out[1], out[2] = crowd[who, 0] * dim, crowd[who, 1] * dim, crowd[who, 2] * dim
    else:
        out[0], out[1], out[2] = 44.0, 42.0, 42.0
    # Where a person is smaller than a pixel, only the mean of the crowd is left.
    blur = min(max((foot - 0.25) / 0.6, 0.0), 0.8)
    for c in range(3):
        out[c] += blur * (crowd[who, c] * 0.35 + 52.0 - out[c])


@_jit
def _grass(
    out: np.ndarray, gx: float, gy: float, distance: float, foot: float, wx: float, wy: float,
    view_x: float, view_y: float, p: np.ndarray, coarse: np.ndarray, fine: np.ndarray,
) -> None:  # fmt: skip
    """Colour of the grass without lines and shadows."""
    band, contrast, mowing = p[3], p[4], p[5]
    # Mown grass bends: a band shines when one looks along the way the mower went.
    tone = 0.0
    if mowing != 1.0:
        tone += _bands(gx, band, wx) * (0.3 + 0.7 * abs(view_y))
    if mowing != 0.0:
        tone += _bands(gy + 0.5 * band, band, wy) * (0.3 + 0.7 * abs(view_x))
    if mowing == 2.0:
        tone *= 0.6
    if abs(gx) > HALF_LENGTH + 2.5 or abs(gy) > HALF_WIDTH + 2.2:
        tone *= 0.15
    patches = _tile(coarse, gx * 8.0, gy * 8.0)
    broad = _tile(coarse, gx * 1.1 + 77.0, gy * 1.1 + 31.0)
    blades = _tile(fine, gx * 60.0, gy * 60.0)
    tufts = _tile(fine, gx * 11.0 + 9.0, gy * 11.0 + 5.0)
    near = min(1.0, 0.03 / (foot + 1e-6))
    middle = min(1.0, 0.16 / (foot + 1e-6))
    light = 1.0 + 0.5 * contrast * tone + 0.055 * broad + 0.05 * patches * middle
    light += 0.10 * blades * near + 0.065 * tufts * middle
    brown = 0.0
    if abs(gx) > 38.0 and abs(gy) < 12.0:
        mouth = math.exp(-((abs(gx) - 50.5) ** 2) / 6.0 - gy * gy / 14.0)
        spot = math.exp(-((abs(gx) - 41.5) ** 2) / 1.5 - gy * gy / 1.5)
        brown = p[6] * min(0.55, (0.75 * mouth + 0.4 * spot) * max(0.0, 0.6 + 0.8 * patches))
    # Grazing rays see the shiny side of the blades: paler and a little bluer.
    sheen = 0.16 * distance / (distance + 80.0)
    out[0] = (p[0] * (1 - brown) + 62.0 * brown) * light * (1 + 1.1 * sheen)
    out[1] = (p[1] * (1 - brown) + 108.0 * brown) * light * (1 + 0.55 * sheen)
    out[2] = (p[2] * (1 - brown) + 122.0 * brown) * light * (1 + 0.75 * sheen)


@_jit
def _board(
    out: np.ndarray, u: float, h: float, foot: float, atlas: np.ndarray, levels: np.ndarray
) -> None:
    """Colour of an advertising board; ``levels`` holds first row, height, width of each size."""
    level = 0
    scale = levels[0, 2] / levels[0, 3]
    while level + 1 < levels.shape[0] and foot * scale > 1.3:
        level += 1
        scale *= 0.5
    top, height, width = int(levels[level, 0]), int(levels[level, 1]), int(levels[level, 2])
    x = (u / levels[level, 3]) % 1.0 * width - 0.5
    y = (1.0 - h / BOARD_HEIGHT) * height - 0.5
    y = min(max(y, 0.0), height - 1.001)
    i, j = math.floor(x), int(y)
    fu, fv = x - math.floor(x), y - j
    i0, i1 = i % width, (i + 1) % width
    for c in range(3):
        high = atlas[top + j, i0, c] * (1 - fu) + atlas[top + j, i1, c] * fu
        low = atlas[top + j + 1, i0, c] * (1 - fu) + atlas[top + j + 1, i1, c] * fu
        out[c] = high * (1 - fv) + low * fv


@_jit
def shade(
    image: np.ndarray, background: np.ndarray, shadow: np.ndarray, camera: np.ndarray,
    p: np.ndarray, sides: np.ndarray, profile: np.ndarray, kinds: np.ndarray, crowd: np.ndarray,
    seat: np.ndarray, atlas: np.ndarray, levels: np.ndarray, coarse: np.ndarray, fine: np.ndarray,
) -> None:  # fmt: skip
    """Paint the whole frame.

    Args:
        image: Output, blue green red, uint8, shape (H, W, 3).
        background: Output, 255 where the pixel lies behind the boards, uint8, shape (H, W).
        shadow: Light that figures leave on the grass, 255 is all, uint8, shape (H, W).
        camera: R row by row, position, focal length, x0, y0, k1; shape (16,).
        p: Grass colour 0-2, band, contrast, mowing, wear 3-6, exposure 7-9, light on the crowd
            10, empty seats 11, sky 12-17, shade of the stand 18-20 (0 darkness: none), wall 21-23.
        sides: For +x, -x, +y, -y: 1 where the side has boards and stands, 0 where the camera
            stands, 2 where it stands above the first tier and sees that; then the distance of the
            boards; shape (8,).
        profile: Cross section of the stands, shape (N, 2); kinds: of its pieces, (N - 1,).
        crowd: Colours of clothes, shape (M, 3); seat: colour of an empty seat, (3,).
        atlas: Boards at all sizes, uint8; levels: where each size lies, see ``_board``.
        coarse: Noise tile of patches; fine: of blades; float32, shape (512, 512).
    """
    rows, columns = image.shape[0], image.shape[1]
    R, C = camera[:9].copy().reshape(3, 3), camera[9:12]
    focal, x0, y0, k1 = camera[12], camera[13], camera[14], camera[15]
    height = -C[2]
    colour = np.zeros(3)
    for row in range(rows):
        for column in range(columns):
            a, b = (column - x0) / focal, (row - y0) / focal
            d2, s = a * a + b * b, 1.0
            for _ in range(4):
                s = 1.0 / (1.0 + k1 * d2 * s * s)
            a, b = a * s, b * s
            dx = R[0, 0] * a + R[1, 0] * b + R[2, 0]
            dy = R[0, 1] * a + R[1, 1] * b + R[2, 1]
            dz = R[0, 2] * a + R[1, 2] * b + R[2, 2]
            ground = height / dz if dz > 1e-9 else 1e9
            gx, gy = C[0] + ground * dx, C[1] + ground * dy
            best, part, place, side = ground, -1, 0.0, -1
            for k in range(4):
                if sides[k] == 0.0:
                    continue
                sign = 1.0 if k % 2 == 0 else -1.0
                half = HALF_LENGTH if k < 2 else HALF_WIDTH
                ds = sign * (dx if k < 2 else dy)
                s0 = sign * (C[0] if k < 2 else C[1]) - half
                if sides[k] == 2.0:
                    if ds < -1e-9:
                        t, at = _tier_hit(s0, ds, height, -dz, profile)
                        if t < best:
                            best, part, place, side = t, 2, at, k
                    continue
                if ds <= 1e-9 or s0 + ds * best < sides[4 + k]:
                    continue
                along, dalong = (C[1], dy) if k < 2 else (C[0], dx)
                reach = HALF_WIDTH + sides[6] if k < 2 else HALF_LENGTH + sides[4]
                t, what, at = _side_hit(
                    s0, ds, height, -dz, sides[4 + k], along, dalong, reach, profile
                )
                if what >= 0 and t < best:
                    best, part, place, side = t, what, at, k
            light = 1.0
            behind = 255
            if part == 0:
                hx, hy = C[0] + best * dx, C[1] + best * dy
                u = (hy if side == 0 else -hy) if side < 2 else (-hx if side == 2 else hx)
                _board(colour, u, place, best / focal, atlas, levels)
                light = 0.9
                behind = 0
            elif part > 0:
                hx, hy = C[0] + best * dx, C[1] + best * dy
                u = (hy if side == 0 else -hy) if side < 2 else (-hx if side == 2 else hx)
                kind = kinds[part - 1]
                length = math.hypot(
                    profile[part, 0] - profile[part - 1, 0], profile[part, 1] - profile[part - 1, 1]
                )
                if kind == 1:
                    _crowd(
                        colour, u, place, side * 31 + part * 101, best / focal, crowd, seat, p[11]
                    )
                    light = p[10] * (1.0 - 0.35 * place / length)
                elif kind == 0:
                    rib = 1.12 if u % 4.0 < 0.12 else 1.0
                    ribbon = 1.9 if part > 1 and 0.35 < place / length < 0.6 else 1.0
                    for c in range(3):
                        colour[c] = p[21 + c] * rib * (0.8 + 0.2 * place / length)
                        colour[c] = colour[c] * ribbon if ribbon == 1.0 else 0.55 * seat[c] + 50.0
                    light = p[10]
                else:
                    beam = 0.72 if u % 7.0 < 0.5 else 1.0
                    for c in range(3):
                        colour[c] = 88.0 * beam
                    light = p[10]
            elif dz <= 1e-9:
                up = min(1.0, -dz / math.sqrt(dx * dx + dy * dy) * 3.0)
                for c in range(3):
                    colour[c] = p[12 + c] + up * (p[15 + c] - p[12 + c])
            else:
                # One pixel to the right and one down, as steps on the grass.
                step = ground / focal
                rx, ry = R[0, 2] / dz, R[1, 2] / dz
                ax_x, ax_y = step * (R[0, 0] - dx * rx), step * (R[0, 1] - dy * rx)
                ay_x, ay_y = step * (R[1, 0] - dx * ry), step * (R[1, 1] - dy * ry)
                wx, wy = abs(ax_x) + abs(ay_x), abs(ax_y) + abs(ay_y)
                foot = math.sqrt(abs(ax_x * ay_y - ax_y * ay_x))
                flat = math.sqrt(dx * dx + dy * dy) + 1e-9
                on_grass = (
                    abs(gx) < HALF_LENGTH + sides[4] + 0.2 and abs(gy) < HALF_WIDTH + sides[6] + 0.2
                )
                if on_grass:
                    behind = 0
                    _grass(
                        colour, gx, gy, ground * flat, foot, wx, wy, dx / flat, dy / flat,
                        p, coarse, fine,
                    )  # fmt: skip
                    if abs(gx) < HALF_LENGTH + 1.0 and abs(gy) < HALF_WIDTH + 1.0:
                        paint = _paint(gx, gy, ax_x, ax_y, ay_x, ay_y)
                        if paint > 0.0:
                            worn = 0.93 + 0.07 * _tile(fine, gx * 25.0, gy * 25.0)
                            paint *= min(1.0, worn)
                            colour[0] += paint * (226.0 - colour[0])
                            colour[1] += paint * (234.0 - colour[1])
                            colour[2] += paint * (231.0 - colour[2])
                else:
                    grit = 1.0 + 0.06 * _tile(fine, gx * 14.0, gy * 14.0) * min(1.0, 0.1 / foot)
                    # Under the camera's own stand it is dark.
                    far = max(abs(gx) - HALF_LENGTH, abs(gy) - HALF_WIDTH) - profile[0, 0]
                    grit *= 1.0 - 0.68 * _step(far, 1.2)
                    colour[0], colour[1], colour[2] = 92.0 * grit, 90.0 * grit, 88.0 * grit
                light = shadow[row, column] / 255.0
                if p[20] > 0.0:
                    edge = gy - (p[18] + p[19] * gx)
                    light *= 1.0 - p[20] * _step(edge, max(0.5, wy))
            background[row, column] = behind
            for c in range(3):
                value = colour[c] * light * p[7 + c]
                image[row, column, c] = np.uint8(min(max(value, 0.0), 255.0))

"""Surface: grass, painted lines, boards, stands and sky, one ray for each pixel.

Each pixel takes the share of its footprint on the grass that is painted, so that a far line
fades instead of growing to a whole pixel.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba
import numpy as np

from app.geometry.arrays import FloatArray

_jit = numba.njit(cache=True, nogil=True, fastmath=False)

HALF_LENGTH, HALF_WIDTH = 52.5, 34.0
HALF_LINE = 0.06


@_jit
def _line_coverage(distance: float, width: float, half: float) -> float:
    """Share of a footprint of that width that a line of half width ``half`` covers."""
    if abs(distance) > half + 0.5 * width:
        return 0.0
    low = max(distance - 0.5 * width, -half)
    high = min(distance + 0.5 * width, half)
    return max(high - low, 0.0) / width


@_jit
def edge_coverage(distance: float, width: float) -> float:
    """Share of a footprint that lies on the positive side."""
    if abs(distance) > 0.5 * width:
        return 1.0 if distance > 0 else 0.0
    return distance / width + 0.5


@_jit
def _ring_coverage(
    x: float, y: float, radius: float, ax_x: float, ax_y: float, ay_x: float, ay_y: float
) -> float:
    r = math.hypot(x, y)
    if abs(r - radius) > 6.0 or r < 1e-6:
        return 0.0
    width = (abs(x * ax_x + y * ax_y) + abs(x * ay_x + y * ay_y)) / r + 1e-6
    return _line_coverage(r - radius, width, HALF_LINE)


@_jit
def paint_coverage(
    gx: float, gy: float, ax_x: float, ax_y: float, ay_x: float, ay_y: float
) -> float:
    """Share of a pixel that is painted white.

    (ax_x, ax_y) is the step on the grass for one pixel to the right, (ay_x, ay_y) for one down.
    """
    x, y = abs(gx), abs(gy)
    wx = abs(ax_x) + abs(ay_x) + 1e-6
    wy = abs(ax_y) + abs(ay_y) + 1e-6
    paint = 0.0
    end_x, end_y = (
        edge_coverage(HALF_LENGTH + HALF_LINE - x, wx),
        edge_coverage(HALF_WIDTH + HALF_LINE - y, wy),
    )
    paint = max(paint, _line_coverage(y - HALF_WIDTH, wy, HALF_LINE) * end_x)
    paint = max(paint, _line_coverage(x - HALF_LENGTH, wx, HALF_LINE) * end_y)
    paint = max(paint, _line_coverage(x, wx, HALF_LINE) * end_y)
    for depth, half in ((16.5, 20.16), (5.5, 9.16)):
        front = HALF_LENGTH - depth
        end = edge_coverage(half + HALF_LINE - y, wy)
        paint = max(paint, _line_coverage(x - front, wx, HALF_LINE) * end)
        end = edge_coverage(x - front + HALF_LINE, wx) * end_x
        paint = max(paint, _line_coverage(y - half, wy, HALF_LINE) * end)
    paint = max(paint, _ring_coverage(gx, gy, 9.15, ax_x, ax_y, ay_x, ay_y))
    sign = 1.0 if gx > 0 else -1.0
    off = gx - sign * 41.5
    outside = edge_coverage(36.0 - x + HALF_LINE, wx)
    if outside > 0.0:
        paint = max(paint, _ring_coverage(off, gy, 9.15, ax_x, ax_y, ay_x, ay_y) * outside)
    if x < HALF_LENGTH + 0.06 and y < HALF_WIDTH + 0.06:
        corner_x, corner_y = x - HALF_LENGTH, y - HALF_WIDTH
        if corner_x > -1.5 and corner_y > -1.5:
            # Footprints are symmetric, so the mirrored corner may use the same steps.
            paint = max(paint, _ring_coverage(corner_x, corner_y, 1.0, ax_x, ax_y, ay_x, ay_y))
    width = 0.5 * (wx + wy)
    paint = max(paint, edge_coverage(0.12 - math.hypot(off, gy), width) * min(1.0, 0.24 / wy))
    return max(paint, edge_coverage(0.13 - math.hypot(gx, gy), width) * min(1.0, 0.26 / wy))


BOARD_HEIGHT = 0.95
SEAT_WIDTH, ROW_DEPTH = 0.54, 0.86
TILE = 512
"""Side of a noise tile; a power of two, so that wrapping is a mask."""
_FAR = 1e9
_GROUND, _BOARD = -1, 0
"""Parts that a ray can meet; 1 + i is the i-th piece of the stands' profile."""
_WALL, _CROWD = 0, 1


# Caches of compiled code name these classes, also those of earlier versions: their names stay.
class ShadingCamera(NamedTuple):
    """The camera: R, position in the pitch frame, and lens (pixels; first radial coefficient)."""

    rotation: FloatArray
    position: FloatArray
    focal: float
    x0: float
    y0: float
    k1: float


class ShadingGrass(NamedTuple):
    """The grass: its colour, and how it is mown.

    ``across``: in bands across the pitch, or along it; ``band`` is their width, metres. ``edge``
    and ``slope`` are y at x = 0 and slope of the border of the stand's shadow, ``darkness`` is
    how dark it is (0: no shadow).
    """

    blue: float
    green: float
    red: float
    across: bool
    band: float
    contrast: float
    edge: float
    slope: float
    darkness: float


class ShadingStadium(NamedTuple):
    """What stands around the grass.

    ``seen``: for +x, -x, +y, -y whether the side has boards and stands (it has none where the
    camera stands). The boards are ``beyond`` the goal lines and ``along`` the side lines, metres.
    ``profile`` is the cross section of the stands, shape (N, 2), ``kinds`` of its pieces,
    shape (N - 1,). ``crowd`` holds colours of clothes, shape (M, 3), ``empty`` the share of empty
    seats, ``light`` the light on it all, ``sky`` the colours at the horizon and higher up.
    ``atlas`` and ``levels`` are the boards at all sizes, see ``make_board_mipmap``.
    """

    seen: np.ndarray
    beyond: float
    along: float
    profile: FloatArray
    kinds: np.ndarray
    crowd: FloatArray
    seat: FloatArray
    wall: FloatArray
    empty: float
    light: float
    sky: FloatArray
    atlas: np.ndarray
    levels: FloatArray


@_jit
def _hash_cell(i: int, j: int, k: int) -> float:
    """A number in [0, 1) that belongs to the cell (i, j) of layer k."""
    h = np.uint32(i * 374761393 + j * 668265263 + k * 2147483647 + 1013904223)
    h = np.uint32((h ^ (h >> np.uint32(13))) * np.uint32(1274126177))
    h = np.uint32((h ^ (h >> np.uint32(15))) * np.uint32(2246822519))
    return float(h ^ (h >> np.uint32(16))) / 4294967296.0


@_jit
def _sample_tile(tile: np.ndarray, x: float, y: float) -> float:
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
def _mowing_band_value(s: float, band: float, width: float) -> float:
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
def _intersect_side(
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
def _shade_board(
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
def _set_colour(out: np.ndarray, colour: np.ndarray, gain: float, more: float = 0.0) -> None:
    """Set a colour: written out, for each pixel of a frame asks for several."""
    for c in range(3):
        out[c] = colour[c] * gain + more


@_jit
def _dim_colour(out: np.ndarray, gain: float) -> None:
    for c in range(3):
        out[c] *= gain


@_jit
def _shade_crowd(
    out: np.ndarray, u: float, v: float, layer: int, foot: float,
    crowd: np.ndarray, seat: np.ndarray, empty: float,
) -> None:  # fmt: skip
    """Colour of a place in a stand: people in rows, empty seats, stairs."""
    column, row = math.floor(u / SEAT_WIDTH), math.floor(v / ROW_DEPTH)
    lu, lv = u / SEAT_WIDTH - column, v / ROW_DEPTH - row
    i, j = int(column), int(row)
    if i % 24 == 0:
        _set_colour(out, seat, 0.0, 106.0 if lv > 0.5 else 80.0)
        return
    if _hash_cell(i, j, layer) < empty:
        _set_colour(out, seat, 1.0 if 0.15 < lv < 0.7 else 0.55)
        return
    clothes = crowd[int(_hash_cell(i, j, layer + 7) * crowd.shape[0])]
    if lv < 0.68 and abs(lu - 0.5) < 0.42:
        light = 0.62 + 0.5 * _hash_cell(i, j, layer + 13)
        _set_colour(out, clothes, light * (0.62 + 0.38 * min(1.0, lv / 0.4)))
    elif 0.5 < lv < 0.92 and abs(lu - 0.5) < 0.2:
        tone = 0.4 + 0.5 * _hash_cell(i, j, layer + 5)
        out[0], out[1], out[2] = 126.0 * tone, 158.0 * tone, 208.0 * tone
    else:
        _set_colour(out, clothes, 0.0, 43.0)
    # Where a person is smaller than a pixel, only the mean of the crowd is left.
    blur = min(max((foot - 0.25) / 0.6, 0.0), 0.8)
    for c in range(3):
        out[c] += blur * (clothes[c] * 0.35 + 52.0 - out[c])


@_jit
def _shade_grass(
    out: np.ndarray, gx: float, gy: float, distance: float, foot: float, wx: float, wy: float,
    view_x: float, view_y: float, turf: ShadingGrass, coarse: np.ndarray, fine: np.ndarray,
) -> None:  # fmt: skip
    """Colour of the grass without lines and shadows."""
    # Mown grass bends: a band shines when one looks along the way the mower went.
    if turf.across:
        tone = _mowing_band_value(gx, turf.band, wx) * (0.3 + 0.7 * abs(view_y))
    else:
        tone = _mowing_band_value(gy + 0.5 * turf.band, turf.band, wy) * (0.3 + 0.7 * abs(view_x))
    if abs(gx) > HALF_LENGTH + 2.5 or abs(gy) > HALF_WIDTH + 2.2:
        tone *= 0.15
    patches = _sample_tile(coarse, gx * 8.0, gy * 8.0)
    broad = _sample_tile(coarse, gx * 1.1 + 77.0, gy * 1.1 + 31.0)
    blades = _sample_tile(fine, gx * 60.0, gy * 60.0)
    tufts = _sample_tile(fine, gx * 11.0 + 9.0, gy * 11.0 + 5.0)
    near, middle = min(1.0, 0.03 / (foot + 1e-6)), min(1.0, 0.16 / (foot + 1e-6))
    light = 1.0 + 0.5 * turf.contrast * tone + 0.055 * broad + 0.05 * patches * middle
    light += 0.10 * blades * near + 0.065 * tufts * middle
    # Grazing rays see the shiny side of the blades: paler and a little bluer.
    sheen = 0.16 * distance / (distance + 80.0)
    out[0] = turf.blue * light * (1 + 1.1 * sheen)
    out[1] = turf.green * light * (1 + 0.55 * sheen)
    out[2] = turf.red * light * (1 + 0.75 * sheen)


@_jit
def _shade_grass_with_lines(
    out: np.ndarray, gx: float, gy: float, ray: np.ndarray, t: float,
    R: np.ndarray, focal: float, turf: ShadingGrass, coarse: np.ndarray, fine: np.ndarray,
) -> None:  # fmt: skip
    """Colour of a place on the grass, with its lines and the shadow of the stand."""
    dx, dy, dz = ray[0], ray[1], ray[2]
    # One pixel to the right and one down, as steps on the grass.
    pixel = t / focal
    rx, ry = R[0, 2] / dz, R[1, 2] / dz
    ax_x, ax_y = pixel * (R[0, 0] - dx * rx), pixel * (R[0, 1] - dy * rx)
    ay_x, ay_y = pixel * (R[1, 0] - dx * ry), pixel * (R[1, 1] - dy * ry)
    wx, wy = abs(ax_x) + abs(ay_x), abs(ax_y) + abs(ay_y)
    foot = math.sqrt(abs(ax_x * ay_y - ax_y * ay_x))
    flat = math.sqrt(dx * dx + dy * dy) + 1e-9
    _shade_grass(out, gx, gy, t * flat, foot, wx, wy, dx / flat, dy / flat, turf, coarse, fine)
    if abs(gx) < HALF_LENGTH + 1.0 and abs(gy) < HALF_WIDTH + 1.0:
        paint = paint_coverage(gx, gy, ax_x, ax_y, ay_x, ay_y)
        if paint > 0.0:
            paint *= min(1.0, 0.93 + 0.07 * _sample_tile(fine, gx * 25.0, gy * 25.0))
            out[0] += paint * (226.0 - out[0])
            out[1] += paint * (234.0 - out[1])
            out[2] += paint * (231.0 - out[2])
    edge = gy - (turf.edge + turf.slope * gx)
    _dim_colour(out, 1.0 - turf.darkness * edge_coverage(edge, max(0.5, wy)))


@_jit
def _find_first_hit(
    C: np.ndarray, ray: np.ndarray, ground: float,
    seen: np.ndarray, beyond: float, along: float, profile: np.ndarray,
) -> tuple[float, int, float, int]:  # fmt: skip
    """What a ray meets first: its t, its part, the place on the part, and its side."""
    best, part, place, side = ground, _GROUND, 0.0, -1
    for k in range(4):
        axis, other = (0, 1) if k < 2 else (1, 0)
        half, reach = (HALF_LENGTH, HALF_WIDTH) if k < 2 else (HALF_WIDTH, HALF_LENGTH)
        sign = 1.0 if k % 2 == 0 else -1.0
        ds, s0, board = sign * ray[axis], sign * C[axis] - half, beyond if k < 2 else along
        if not seen[k] or ds <= 1e-9 or s0 + ds * best < board:
            continue
        reach += along if k < 2 else beyond
        t, what, at = _intersect_side(
            s0, ds, -C[2], -ray[2], board, C[other], ray[other], reach, profile
        )
        if what >= 0 and t < best:
            best, part, place, side = t, what, at, k
    return best, part, place, side


@_jit
def _shade_stand(
    out: np.ndarray, part: int, place: float, u: float, side: int, foot: float,
    profile: np.ndarray, kinds: np.ndarray, crowd: np.ndarray, seat: np.ndarray,
    wall: np.ndarray, empty: float,
) -> None:  # fmt: skip
    """Colour of a place on a piece of the stands."""
    run = profile[part, 0] - profile[part - 1, 0]
    rise = profile[part, 1] - profile[part - 1, 1]
    share, kind = place / math.hypot(run, rise), kinds[part - 1]
    if kind == _CROWD:
        _shade_crowd(out, u, place, side * 31 + part * 101, foot, crowd, seat, empty)
        _dim_colour(out, 1.0 - 0.35 * share)
    elif kind == _WALL:
        if part > 1 and 0.35 < share < 0.6:
            _set_colour(out, seat, 0.55, 50.0)
        else:
            _set_colour(out, wall, 0.8 + 0.2 * share)
    else:
        _set_colour(out, wall, 1.2 if u % 7.0 > 0.5 else 0.9)


@_jit
def _write_pixel_ray(ray: np.ndarray, R: np.ndarray, k1: float, a: float, b: float) -> None:
    """Direction of the ray of a pixel, pitch frame; along the optical axis it has length 1."""
    d2, s = a * a + b * b, 1.0
    for _ in range(4):
        s = 1.0 / (1.0 + k1 * d2 * s * s)
    for k in range(3):
        ray[k] = R[0, k] * a * s + R[1, k] * b * s + R[2, k]


@_jit
def _shade_sky(out: np.ndarray, ray: np.ndarray, sky: np.ndarray) -> None:
    up = min(1.0, -ray[2] / math.hypot(ray[0], ray[1]) * 3.0)
    for c in range(3):
        out[c] = sky[0, c] + up * (sky[1, c] - sky[0, c])


@_jit
def shade_frame(
    image: np.ndarray, background: np.ndarray, shadow: np.ndarray, exposure: np.ndarray,
    eye: ShadingCamera, turf: ShadingGrass, bowl: ShadingStadium, coarse: np.ndarray, fine: np.ndarray,
) -> None:  # fmt: skip
    """Paint the whole frame.

    Args:
        image: Output, blue green red, uint8, shape (H, W, 3).
        background: Output, 255 where the pixel lies behind the boards, uint8, shape (H, W).
        shadow: Light that figures leave on the ground, 255 is all, uint8, shape (H, W).
        exposure: Gain per channel, shape (3,).
        coarse: Noise tile of patches; fine: of blades; float32, shape (512, 512).
    """
    # Taken out of their tuples once: every access would count references again.
    R, C = eye.rotation, eye.position
    seen, profile, kinds, crowd = bowl.seen, bowl.profile, bowl.kinds, bowl.crowd
    seat, wall, sky, atlas, levels = bowl.seat, bowl.wall, bowl.sky, bowl.atlas, bowl.levels
    ray, colour = np.zeros(3), np.zeros(3)
    for row in range(image.shape[0]):
        for column in range(image.shape[1]):
            _write_pixel_ray(
                ray, R, eye.k1, (column - eye.x0) / eye.focal, (row - eye.y0) / eye.focal
            )
            ground = -C[2] / ray[2] if ray[2] > 1e-9 else _FAR
            t, part, place, side = _find_first_hit(
                C, ray, ground, seen, bowl.beyond, bowl.along, profile
            )
            x, y, foot, far = C[0] + t * ray[0], C[1] + t * ray[1], t / eye.focal, True
            if part == _GROUND and ground < _FAR:
                end, rim = abs(x) - HALF_LENGTH, abs(y) - HALF_WIDTH
                far = end > bowl.beyond + 0.2 or rim > bowl.along + 0.2
                if far:
                    _set_colour(colour, wall, 0.9)
                else:
                    _shade_grass_with_lines(colour, x, y, ray, t, R, eye.focal, turf, coarse, fine)
                _dim_colour(colour, shadow[row, column] / 255.0)
            elif part == _GROUND:
                _shade_sky(colour, ray, sky)
            else:
                u = (y if side < 2 else -x) * (1.0 if side % 2 == 0 else -1.0)
                far = part != _BOARD
                if far:
                    _shade_stand(
                        colour, part, place, u, side, foot,
                        profile, kinds, crowd, seat, wall, bowl.empty,
                    )  # fmt: skip
                    _dim_colour(colour, bowl.light)
                else:
                    _shade_board(colour, u, place, foot, atlas, levels)
                    _dim_colour(colour, 0.9)
            background[row, column] = 255 if far else 0
            for c in range(3):
                image[row, column, c] = np.uint8(min(max(colour[c] * exposure[c], 0.0), 255.0))

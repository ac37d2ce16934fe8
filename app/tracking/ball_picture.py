"""What a ball looks like: found near a click, and fitted to a fraction of a pixel, with its uncertainty."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt

from app.geometry.arrays import FloatArray
from app.tracking.ball_run import UNSEEN_PX

Image = npt.NDArray[np.uint8]
Grey = npt.NDArray[np.uint8]

BACKGROUND_LEVEL, CONTRAST = 64.0, 191.0
"""Of the grass around a ball in the grey picture that tells them apart, and by how much the ball is brighter there."""
SHADED = 0.65
"""What has so much of the ball's colour is as bright as the ball: its shaded side and its seams are ball, too."""
SMALLEST_PX, LARGEST_PX = 2.5, 80.0
"""Diameters of balls that are followed."""
SIZES = 1.22
"""Between two diameters that are tried where a ball is sought."""
EDGE_PX = 0.6
"""Over so many pixels the rim of a ball goes from bright to dark."""
ROUNDS = 6
FLOOR_PX, FLOOR_SHARE = 0.08, 0.03
"""What shading and compression leave uncertain of a centre, pixels and a share of the diameter."""
LEAST_LIKE, LEAST_CONTRAST = 0.4, 0.12
"""Correlation with a disc, and contrast, below which nothing near a click is taken for a ball."""
FAINTEST = 0.05
"""Contrast below which nothing is fitted, as a share of that of the clicked ball."""


@dataclass(frozen=True)
class BallSpot:
    """A ball in a picture.

    Attributes:
        x, y: Of its centre, pixels.
        diameter: Pixels.
        sigma_px: Standard deviation of the centre along each axis.
        likeness: How well a disc explains the picture there, 0 to 1.
        contrast: How much brighter than what is around it, in shares of the ball that was clicked.
    """

    x: float
    y: float
    diameter: float
    sigma_px: float
    likeness: float
    contrast: float

    @property
    def center(self) -> FloatArray:
        """Its centre, shape (2,)."""
        return np.array([self.x, self.y])


@dataclass(frozen=True)
class BallGreyConversion:
    """How colours become grey so that a ball stands out, as an even disc.

    Attributes:
        weights: Of red, green and blue, and what is added, shape (4,).
    """

    weights: FloatArray

    @staticmethod
    def of(image: Image, x: float, y: float, diameter: float) -> BallGreyConversion:
        """What tells a ball from what is around it.

        Args:
            image: Red green blue, shape (H, W, 3).
            x, y: Its centre, pixels.
            diameter: Pixels.
        """
        reach = int(np.ceil(1.5 * diameter)) + 2
        left, top = max(int(x) - reach, 0), max(int(y) - reach, 0)
        part = image[top : int(y) + reach + 1, left : int(x) + reach + 1].astype(float)
        rows, columns = np.mgrid[top : top + part.shape[0], left : left + part.shape[1]]
        away = np.hypot(columns - x, rows - y)
        inside = away <= max(0.35 * diameter, 0.8)
        around = (away > 0.75 * diameter + 0.5) & (away < 1.5 * diameter + 2)
        ball, ground = np.median(part[inside], axis=0), np.median(part[around], axis=0)
        apart = ball - ground
        if np.linalg.norm(apart) < 12.0:
            apart = np.array([40.0, 40.0, 40.0])
        # Shadow and light make grass darker and brighter, and no ball of it.
        shade = ground / max(float(np.linalg.norm(ground)), 1.0)
        tinted = apart - float(apart @ shade) * shade
        if np.linalg.norm(tinted) > 0.35 * np.linalg.norm(apart):
            apart = tinted
        slope = apart / (SHADED * float(apart @ (ball - ground))) * CONTRAST
        return BallGreyConversion(np.append(slope, BACKGROUND_LEVEL - float(slope @ ground)))

    def to_grey(self, image: Image) -> Grey:
        """The grey picture, shape (H, W)."""
        turned = cv2.transform(image, self.weights[None].astype(np.float32))
        return np.asarray(turned, np.uint8)


@lru_cache(maxsize=256)
def make_ball_template(
    diameter: float, smear: float = 0.0, angle: float = 0.0
) -> npt.NDArray[np.float32]:
    """The picture of a ball, 1 on 0, whose side is about two diameters.

    Args:
        diameter: Pixels.
        smear: How far it moves while the shutter is open, pixels.
        angle: Where to, radians.
    """
    reach = int(np.ceil(diameter + smear / 2))
    rows, columns = np.mgrid[-reach : reach + 1, -reach : reach + 1].astype(float)
    return np.asarray(_model_soft_disc(columns, rows, diameter / 2, smear, angle)[0], np.float32)


def _model_soft_disc(
    columns: FloatArray, rows: FloatArray, radius: float, smear: float, angle: float
) -> tuple[FloatArray, FloatArray]:
    """A disc, or what it covers on its way, with a soft rim; and how it changes with its place and radius."""
    across, down = np.cos(angle), np.sin(angle)
    along = columns * across + rows * down
    ahead = along - np.clip(along, -smear / 2, smear / 2)
    aside = rows * across - columns * down
    away = np.hypot(ahead, aside)
    shape = 1 / (1 + np.exp(np.clip((away - radius) * (2 / EDGE_PX), -30, 30)))
    steep = shape * (1 - shape) * (2 / EDGE_PX)
    unit = steep / np.maximum(away, 1e-6)
    x, y = ahead * across - aside * down, ahead * down + aside * across
    return shape, np.stack([x * unit, y * unit, steep], axis=-1)


def match_template(
    grey: Grey, template: npt.NDArray[np.float32]
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """How much each place of a picture looks like a template, and its contrast there.

    Args:
        grey: Shape (H, W), with as much around the places as the template reaches.
        template: Shape (2 r + 1, 2 r + 1).

    Returns:
        Correlation (-1 to 1) and contrast (shares of that of the clicked ball), both (H - 2 r, W - 2 r).
    """
    picture = grey.astype(np.float32)
    found = cv2.matchTemplate(picture, template, cv2.TM_CCOEFF)
    side = template.shape[0]
    flat = (side, side)
    mean = cv2.boxFilter(picture, -1, flat)
    square = cv2.sqrBoxFilter(picture, -1, flat)
    reach = side // 2
    inner = np.s_[reach : picture.shape[0] - reach, reach : picture.shape[1] - reach]
    variance = np.maximum(square[inner] - mean[inner] ** 2, 0.0) * side * side
    weight = float(((template - template.mean()) ** 2).sum())
    contrast = found / weight
    # Noise of flat grass looks like anything: what it could make is taken off.
    alike = found / np.sqrt(weight * (variance + side * side * 9.0))
    return np.asarray(alike, np.float32), np.asarray(contrast / CONTRAST, np.float32)


def fit_disc(
    grey: Grey, x: float, y: float, diameter: float, smear: float = 0.0, angle: float = 0.0
) -> BallSpot | None:
    """The ball at a place, fitted as a disc on an even background.

    Args:
        grey: From ``BallGreyConversion.to_grey``, shape (H, W).
        x, y: About where its centre is, pixels.
        diameter: About how large it is, pixels.
        smear, angle: As of ``make_ball_template``.

    Returns:
        None where nothing is brighter there, or it would move away.
    """
    reach = round(1.1 * diameter + smear / 2) + 2
    left, top = round(x) - reach, round(y) - reach
    right, bottom = left + 2 * reach + 1, top + 2 * reach + 1
    if left < 0 or top < 0 or right > grey.shape[1] or bottom > grey.shape[0]:
        return None
    part = grey[top:bottom, left:right].astype(float)
    rows, columns = np.mgrid[top:bottom, left:right].astype(float)
    away = np.hypot(columns - x, rows - y)
    weight = 1.0 / (1.0 + (away / (0.8 * diameter + smear / 2 + 1)) ** 6)
    at = np.array([x, y, diameter / 2])
    start = at.copy()

    root = np.sqrt(weight).ravel()
    for _ in range(ROUNDS):
        shape, slopes = _model_soft_disc(columns - at[0], rows - at[1], at[2], smear, angle)
        base = np.column_stack([shape.ravel(), np.ones(shape.size)]) * root[:, None]
        level = np.linalg.solve(base.T @ base + 1e-9 * np.eye(2), base.T @ (part.ravel() * root))
        rest = part.ravel() * root - base @ level
        slopes = slopes.reshape(-1, 3)
        whole = np.column_stack([level[0] * slopes * root[:, None], base])
        normal = whole.T @ whole
        # The size is known to a sixth, beside what the picture says.
        prior = (0.6 * CONTRAST / (0.16 * start[2])) ** 2
        normal[2, 2] += prior
        right_side = whole.T @ rest
        right_side[2] += prior * (start[2] - at[2])
        try:
            moved = np.linalg.solve(normal + 1e-6 * np.eye(5), right_side)[:3]
        except np.linalg.LinAlgError:
            return None
        at = at + np.clip(moved, -0.3 * diameter, 0.3 * diameter)
        at[2] = np.clip(at[2], 0.75 * start[2], 1.35 * start[2])
        if np.abs(moved[:2]).max() < 0.005:
            break
    if level[0] < FAINTEST * CONTRAST or np.hypot(*(at[:2] - start[:2])) > 0.75 * diameter:
        return None
    spread = float(rest @ rest) / max(weight.sum() - 5, 1.0)
    # What is left is not noise of single pixels: neighbours err together.
    covariance = 4.0 * spread * np.linalg.inv(normal + 1e-6 * np.eye(5))
    told = float(((part - np.average(part, weights=weight)) ** 2 * weight).sum())
    sigma = float(np.sqrt(max(covariance[0, 0], covariance[1, 1])))
    size = 2 * float(at[2])
    return BallSpot(
        float(at[0]),
        float(at[1]),
        size,
        float(np.hypot(sigma, FLOOR_PX + FLOOR_SHARE * size)),
        float(np.clip(1 - float(rest @ rest) / max(told, 1e-9), 0.0, 1.0)),
        float(level[0] / CONTRAST),
    )


def find_ball(
    image: Image, x: float, y: float, expected: float | None = None
) -> tuple[BallSpot, BallGreyConversion] | None:
    """The ball near a click: the spot that looks most like one, with its centre and size.

    Args:
        image: Red green blue, shape (H, W, 3).
        x, y: Where somebody clicked, pixels.
        expected: Diameter that the camera says, pixels; None: nobody knows.

    Returns:
        None where nothing near the click looks like a ball.
    """
    height, width = image.shape[:2]
    low, high = (
        (SMALLEST_PX + 0.5, width / 40) if expected is None else (0.8 * expected, 1.6 * expected)
    )
    low, high = max(low, SMALLEST_PX), min(max(high, SMALLEST_PX + 1), LARGEST_PX)
    near = max(6.0, 0.9 * (expected or 8.0))
    greys = [
        np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), np.uint8),
        np.asarray(image.min(axis=2), np.uint8),
    ]
    best: tuple[float, float, float, float] | None = None
    size = low
    while size <= high:
        template = make_ball_template(round(size, 2))
        reach = template.shape[0] // 2 + int(np.ceil(near))
        left, top = round(x) - reach, round(y) - reach
        if left >= 0 and top >= 0 and left + 2 * reach < width and top + 2 * reach < height:
            for grey in greys:
                part = grey[top : top + 2 * reach + 1, left : left + 2 * reach + 1]
                alike, contrast = match_template(part, template)
                rows, columns = np.mgrid[: alike.shape[0], : alike.shape[1]]
                away = np.hypot(columns - alike.shape[1] // 2, rows - alike.shape[0] // 2)
                usual = 1.0
                if expected is not None:
                    # On the grass, or a little nearer in the air.
                    usual = float(np.exp(-0.5 * (np.log(size / expected / 1.05) / 0.25) ** 2))
                score = (
                    usual
                    * np.where(contrast > LEAST_CONTRAST, alike, 0)
                    * np.exp(-0.5 * (away / (0.7 * near)) ** 2)
                )
                row, column = np.unravel_index(int(np.argmax(score)), score.shape)
                if best is None or score[row, column] > best[0]:
                    place = round(x) + int(column) - alike.shape[1] // 2
                    best = (
                        float(score[row, column]),
                        float(place),
                        float(round(y) + int(row) - alike.shape[0] // 2),
                        size,
                    )
        size *= SIZES
    if best is None or best[0] < LEAST_LIKE:
        return None
    colour = BallGreyConversion.of(image, *best[1:])
    spot = fit_disc(colour.to_grey(image), *best[1:])
    if spot is None:
        return None
    colour = BallGreyConversion.of(image, spot.x, spot.y, spot.diameter)
    return fit_disc(colour.to_grey(image), spot.x, spot.y, spot.diameter) or spot, colour


def find_similar_ball(grey: Grey, x: float, y: float, diameter: float) -> BallSpot:
    """The ball at a click by how it looks elsewhere: what looks like it there, else the click itself.

    Args:
        grey: From ``BallGreyConversion.to_grey`` of a frame that shows it well, shape (H, W).
        x, y: Where somebody clicked, pixels.
        diameter: About how large it is, pixels.
    """
    click = BallSpot(x, y, diameter, UNSEEN_PX, 0.0, 1.0)
    template = make_ball_template(round(diameter * 4) / 4)
    near = int(np.ceil(max(3.0, 0.5 * diameter)))
    reach = template.shape[0] // 2 + near
    left, top = round(x) - reach, round(y) - reach
    if left < 0 or top < 0 or left + 2 * reach >= grey.shape[1] or top + 2 * reach >= grey.shape[0]:
        return click
    alike, contrast = match_template(
        grey[top : top + 2 * reach + 1, left : left + 2 * reach + 1], template
    )
    rows, columns = np.mgrid[: alike.shape[0], : alike.shape[1]]
    away = np.hypot(columns - near, rows - near)
    score = alike * np.clip(contrast / 0.5, 0, 1) * np.exp(-0.5 * (away / near) ** 2)
    row, column = np.unravel_index(int(np.argmax(score)), score.shape)
    if score[row, column] < LEAST_LIKE:
        return click
    place = round(x) + int(column) - near, round(y) + int(row) - near
    spot = fit_disc(grey, *place, diameter)
    if spot is None or np.hypot(spot.x - x, spot.y - y) > near:
        return click
    return spot

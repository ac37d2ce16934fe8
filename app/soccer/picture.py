"""Picture geometry: what was done to a picture between the camera and the annotator.

A picture as it was taken has square pixels and its optical axis in the middle. A stretched one
has wide or narrow pixels, a cropped one has its axis beside the middle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from app.errors import InputError
from app.geometry.camera import Camera
from app.soccer.annotation import Lines, make_lines
from app.soccer.frames import ImageSize

ASPECTS = (0.5, 2.0)
MAX_SHIFT = 0.8
KNOWN_SIGMA = 0.05
"""Of an aspect or shift that frames of a match have shown together; one view shows less."""


@dataclass(frozen=True)
class PictureGeometry:
    """Aspect and principal point of a picture, with how well they are known.

    Attributes:
        aspect: Width of a pixel by its height: 1.05 is a picture stretched by 5 % in width.
        shift: Of the optical axis from the middle of the picture, right and down, in half
            diagonals.
        sigma: Standard deviations of the aspect (as a share) and of both shifts; where they are
            wide, the lines of the view itself say what the numbers are.
    """

    aspect: float = 1.0
    shift: tuple[float, float] = (0.0, 0.0)
    sigma: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        numbers = (self.aspect, *self.shift, *self.sigma)
        if not all(map(math.isfinite, numbers)) or min(self.sigma) < 0:
            raise InputError(
                "the geometry of a picture must have finite numbers and no negative sigma"
            )
        if not ASPECTS[0] <= self.aspect <= ASPECTS[1]:
            raise InputError(
                f"the aspect of a pixel must lie from {ASPECTS[0]:g} to {ASPECTS[1]:g}"
            )
        if max(map(abs, self.shift)) > MAX_SHIFT:
            raise InputError(
                f"the optical axis must lie within {MAX_SHIFT:g} half diagonals of the middle"
            )

    @property
    def is_known(self) -> bool:
        """Whether the numbers themselves count, and not what the lines of the view say."""
        return max(self.sigma) <= KNOWN_SIGMA

    def optical_center(self, size: ImageSize) -> tuple[float, float]:
        """Where the optical axis is in a picture of that size, pixels."""
        half = size.diagonal / 2
        right, down = self.shift
        return (size.width - 1) / 2 + right * half, (size.height - 1) / 2 + down * half

    def lines_in_original_picture(self, lines: Lines, size: ImageSize) -> Lines:
        """Where the picture as it was taken, of the same size, shows annotated points.

        Args:
            lines: Points by marking, pixels of the picture as it is.
            size: Of the picture.
        """
        x0, y0 = (size.width - 1) / 2, (size.height - 1) / 2
        x1, y1 = self.optical_center(size)
        return make_lines(
            {
                name: [(x0 + (x - x1) / self.aspect, y0 + y - y1) for x, y in points]
                for name, points in lines.items()
            }
        )

    def camera_of_annotated_picture(self, camera: Camera, size: ImageSize) -> Camera:
        """The camera of the picture as it is, from that of the picture as it was taken.

        Args:
            camera: With square pixels and its principal point in the middle.
            size: Of the picture.
        """
        x, y = camera.focal_length
        return replace(
            camera, focal_length=(x * self.aspect, y), principal_point=self.optical_center(size)
        )


def camera_aspect(camera: Camera) -> float:
    """Width of a pixel of a camera's picture by its height."""
    x, y = camera.focal_length
    return x / y


def camera_of_original_picture(camera: Camera) -> Camera:
    """The camera of a picture as it was taken, from that of the picture as it is; its principal
    point stays where it is."""
    y = camera.focal_length[1]
    return replace(camera, focal_length=(y, y))


OPEN = PictureGeometry(sigma=(0.3, 0.4, 0.4))
"""Of a picture of which nothing is known but that something was done to it: its lines say what."""


_COMMON = frozenset(
    ImageSize(width, height)
    for width, height in (
        (640, 360), (640, 480), (720, 480), (720, 576), (854, 480), (800, 600), (960, 540),
        (1024, 576), (1024, 768), (1280, 720), (1280, 960), (1440, 1080), (1600, 900), (1920, 1080),
        (2048, 1080), (2560, 1440), (2704, 1520), (3840, 2160), (4096, 2160), (7680, 4320),
    )
)  # fmt: skip
_WHOLE = 0.01
"""How far twice a coordinate of a middle may be from a whole number; estimated points are not whole."""
_SAME = 0.02
"""Sizes that differ by less are the same: pictures are cut and rounded."""


def size_centred_on_principal_point(camera: Camera, size: ImageSize) -> ImageSize | None:
    """The size whose middle a camera's principal point is; None where it may be the middle of ``size``.

    The middle is ((W - 1) / 2, (H - 1) / 2) or (W / 2, H / 2): tools differ. A size counts when it is
    a common one, or ``size`` enlarged or reduced.

    Args:
        camera: A camera that was given, not computed.
        size: Annotated size of the view that it belongs to.
    """
    found = []
    for more in (1.0, 0.0):
        width, height = (2 * value + more for value in camera.principal_point)
        whole = max(abs(width - round(width)), abs(height - round(height))) <= _WHOLE
        if not whole or min(width, height) < 2:
            continue
        other = ImageSize(round(width), round(height))
        across, down = other.width / size.width, other.height / size.height
        if max(abs(across - 1), abs(down - 1)) <= _SAME:
            return None
        # A common size first, then the one that is most like the view's.
        unlike = abs(size.height * across - other.height)
        if other in _COMMON or unlike <= 1:
            found.append((other not in _COMMON, unlike, other))
    return min(found, key=lambda it: it[:2])[2] if found else None

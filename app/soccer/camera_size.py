"""For which size of pictures a camera was made, as far as its principal point tells."""

from __future__ import annotations

from app.geometry.camera import Camera
from app.soccer.frames import ImageSize

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

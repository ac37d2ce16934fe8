"""Numbers with their unit as the interface shows them: one rounding for each, wherever it stands."""

from __future__ import annotations

_BEYOND_PX = 20_000
"""No picture is as large."""


def format_pixels(value: float) -> str:
    """A distance in a picture.

    Example:
        >>> pixels(7.26), pixels(241.1), pixels(1720.0), pixels(31_000.0)
        ('7.3 px', '241 px', '1.7k px', '>20k px')
    """
    size = abs(value)
    if size >= _BEYOND_PX:
        return ">20k px"
    if size >= 999.5:
        return f"{value / 1000:.{0 if size >= 9950 else 1}f}k px"
    return f"{value:.{0 if size >= 99.95 else 1}f} px"


def format_percent(value: float) -> str:
    """Per cent, without its sign.

    Example:
        >>> percent(0.057), percent(14.28), percent(113.0)
        ('0.06', '14.3', '113')
    """
    size = abs(value)
    return f"{value:.{0 if size >= 99.95 else 1 if size >= 9.995 else 2}f}"


def format_metres(value: float) -> str:
    """A place or its uncertainty on the pitch.

    Example:
        >>> metres(0.067)
        '0.07 m'
    """
    return f"{value:.2f} m"


def format_degrees(value: float) -> str:
    """An angle.

    Example:
        >>> degrees(44.46)
        '44.5°'
    """
    return f"{value:.1f}°"

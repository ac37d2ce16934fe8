"""Names of pictures as other tools write them, as parts of a path: Windows, absolute, URLs."""

from __future__ import annotations

import re
import unicodedata
from urllib.parse import unquote

_LOCAL = re.compile(r"^.{0,2000}?[?&]d=", re.DOTALL)
"""Label Studio's own address of a file on its disk: ``/data/local-files/?d=images/1.jpg``."""
_SCHEME = re.compile(r"([A-Za-z][A-Za-z0-9+.-]{1,20})://([^/\\]*)")
_DRIVE = re.compile(r"[A-Za-z]:(?=[/\\]|$)")


def picture_parts(name: str) -> tuple[str, ...]:
    """Folders and file of a picture's name, in composed letters, without what no folder here has.

    Drives, roots, ``.``, ``..``, hosts and what follows a ``?`` of an address are left out.

    Example:
        >>> picture_parts("..\\\\..\\\\media\\\\4\\\\north.jpg"), picture_parts("file:///C:/a%20b/1.jpg")
        (('media', '4', 'north.jpg'), ('a b', '1.jpg'))
    """
    text = name.strip()
    if local := _LOCAL.match(text):
        text = unquote(text[local.end() :].partition("&")[0])
    elif scheme := _SCHEME.match(text):
        text = text[scheme.end() :]
        text = unquote(text if scheme[1].lower() == "file" else re.split("[?#]", text)[0])
    text = unicodedata.normalize("NFC", text.replace("\\", "/"))
    drive = _DRIVE.match(text.lstrip("/"))
    if drive is not None:
        text = text.lstrip("/")[drive.end() :]
    return tuple(part for part in text.split("/") if part not in ("", ".", ".."))

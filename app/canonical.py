"""Canonical: the one JSON text of a value, of which digests are made and which is kept."""

from __future__ import annotations

import hashlib
import json
from typing import Any

_ENCODER = json.JSONEncoder(
    sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False
)


def canonical(value: Any) -> str:
    """The one JSON text of a value: sorted keys, no spaces.

    Raises:
        ValueError: A number is infinite or NaN.

    Example:
        >>> canonical({"b": 1, "a": [1.5, None]})
        '{"a":[1.5,null],"b":1}'
    """
    return _ENCODER.encode(value)


def digest_of(content: bytes) -> str:
    """Digest of content, 32 hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()[:32]

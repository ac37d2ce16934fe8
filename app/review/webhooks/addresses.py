"""Addresses that webhooks may have: those below one that the operator of the server has allowed.

Nobody's request decides whom the server talks to; the setting ``webhooks`` does.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from urllib.parse import SplitResult, urlsplit

from app.errors import ConflictError, InputError

_PORTS = {"http": 80, "https": 443}
LONGEST = 2000
"""Characters of an address."""


@dataclass(frozen=True)
class Address:
    """What of an address decides whom it reaches."""

    scheme: str
    host: str
    port: int
    path: str

    def is_below(self, other: Address) -> bool:
        """Whether it is another one, or leads on from it."""
        same = (self.scheme, self.host, self.port) == (other.scheme, other.host, other.port)
        folder = other.path if other.path.endswith("/") else other.path + "/"
        return same and (self.path == other.path or self.path.startswith(folder))


def read_address(text: str, pointer: str | None = None) -> Address:
    """An address as it will be used.

    Raises:
        InputError: It is none of http or https, names a user, or could lead elsewhere than it says.
    """
    try:
        parts = urlsplit(text)
        port = parts.port
    except ValueError:
        raise _refusal(text, pointer) from None
    if len(text) > LONGEST or not _is_plain(text, parts):
        raise _refusal(text, pointer)
    host = (parts.hostname or "").removesuffix(".")
    if not all(host.split(".")):
        raise _refusal(text, pointer)
    return Address(parts.scheme, host, port or _PORTS[parts.scheme], parts.path or "/")


def require_allowed(text: str, allowed: Iterable[str], pointer: str | None = None) -> None:
    """Raise unless the operator lets the server send to an address.

    Raises:
        InputError: It is no address, or none that is allowed.
        ConflictError: None is allowed at all.
    """
    address, places = read_address(text, pointer), [read_address(item) for item in allowed]
    if not places:
        raise ConflictError(
            "this server sends nothing to other addresses",
            hint="Its operator allows some by the setting TOUCHLINE_WEBHOOKS.",
        )
    if not any(address.is_below(place) for place in places):
        raise InputError(
            "the operator of this server does not allow that address",
            hint=f"It may begin with: {', '.join(sorted(allowed))}",
            pointer=pointer,
        )


def _is_plain(text: str, parts: SplitResult) -> bool:
    # Some servers cut parameters off a segment (RFC 3986, 3.3): "..;x" is ".." to them.
    decoded = parts.path.lower().replace("%2e", ".").replace("%3b", ";")
    segments = [segment.partition(";")[0] for segment in decoded.split("/")]
    return (
        text.isascii()
        and text.isprintable()
        and parts.scheme in _PORTS
        and bool(parts.hostname)
        and parts.username is None
        and not parts.fragment
        and "\\" not in text
        and " " not in text
        and "%2f" not in text.lower()
        and not {".", ".."} & set(segments)
    )


def _refusal(text: str, pointer: str | None) -> InputError:
    return InputError(
        f"{text[:100]!r} is no address that messages can be sent to",
        hint="Like https://hooks.example.org/touchline: http or https, without user, # and dots.",
        pointer=pointer,
    )

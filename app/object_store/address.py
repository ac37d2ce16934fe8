"""Addresses in object stores, as text.

An address is ``s3://NAME/inside``: the name is that of a configured store, not of a bucket, so
that no request and no file can name another bucket, prefix or endpoint.
"""

from __future__ import annotations

import re

from app.errors import InputError

SCHEME = "s3://"
_SEAL = re.compile(r"(.+)#(etag|sha256)=([^#]+)", re.DOTALL)


def is_address(text: str) -> bool:
    """Whether a text names something in an object store."""
    return text.startswith(SCHEME)


def split_address(address: str) -> tuple[str, str]:
    """Name of the store, and the key inside it without slashes at its ends.

    Raises:
        InputError: It is no address, or leads out of the store.
    """
    name, _, inside = address.removeprefix(SCHEME).partition("/")
    parts = inside.strip("/").split("/") if inside.strip("/") else []
    wrong = any(part in ("", ".", "..") or "\\" in part for part in parts)
    if not is_address(address) or wrong or not inside.isprintable() or len(inside) > 1000:
        raise InputError(
            "an address in a store is s3://NAME/folder/file, without empty parts or '..'"
        )
    return name, "/".join(parts)


def seal_address(address: str, etag: str) -> str:
    """An address with what the content is called that is meant."""
    return f"{address}#etag={etag.strip(chr(34))}"


def unseal_address(sealed: str) -> tuple[str, str, str]:
    """Address, and how its content is known: ``etag`` or ``sha256`` and its value, or empty."""
    found = _SEAL.fullmatch(sealed)
    return (found[1], found[2], found[3]) if found else (sealed, "", "")

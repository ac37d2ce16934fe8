"""What each client and each database of a test would make anew, made once for a test process."""

from __future__ import annotations

import os
from functools import cache
from ssl import SSLContext
from typing import Any

from httpx._config import create_ssl_context
from httpx._transports import default as transports
from sqlalchemy import Engine
from sqlalchemy.engine.default import DefaultDialect
from sqlalchemy.util import LRUCache

_statements: LRUCache[Any, Any] = LRUCache(5_000)
"""Texts by dialect and statement; more than there are in the product."""


def make_once() -> None:
    """Read trusted certificates once, and spell each statement once for each kind of database."""
    transports.create_ssl_context = _trusted
    # Engines keep what they spelt apart from each other, by their dialects.
    DefaultDialect.__eq__ = _is_alike  # type: ignore[method-assign, assignment]
    DefaultDialect.__hash__ = _hash  # type: ignore[method-assign, assignment]
    kept = property(lambda _engine: _statements, lambda _engine, _own: None)
    Engine._compiled_cache = kept  # type: ignore[assignment]


def _trusted(verify: Any = True, cert: Any = None, trust_env: bool = True) -> SSLContext:
    if verify is not True or cert:
        return create_ssl_context(verify, cert, trust_env)
    return _read(os.environ.get("SSL_CERT_FILE"), os.environ.get("SSL_CERT_DIR"), trust_env)


@cache
def _read(_file: str | None, _folder: str | None, trust_env: bool) -> SSLContext:
    return create_ssl_context(trust_env=trust_env)


def _kind(dialect: Any) -> tuple[object, ...]:
    """What the text of a statement follows from."""
    return type(dialect), dialect.dbapi, dialect.paramstyle


def _is_alike(dialect: Any, other: Any) -> bool:
    return isinstance(other, DefaultDialect) and _kind(dialect) == _kind(other)


def _hash(dialect: Any) -> int:
    return hash(type(dialect))

"""Packages that only some of this needs, asked for when they are."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from touchline.errors import MissingPackageError

_BRINGS = {"httpx": "touchline[library]", "pyarrow": "touchline[library]"}


def package(name: str) -> Any:
    """A package, imported.

    Raises:
        MissingPackageError: It is not installed.
    """
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        if error.name != name.partition(".")[0]:
            raise
        brings = _BRINGS.get(error.name, error.name)
        raise MissingPackageError(
            f"this needs the package {error.name}, which is not installed",
            f"Install it: pip install '{brings}'",
        ) from None

"""The folders that belong to the software beside its code: static files, migrations."""

from __future__ import annotations

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent


def own_folder(name: str) -> Path:
    """Where ``static`` or ``migrations`` lies: inside the package when it was installed from a
    wheel, beside it in a checkout."""
    installed = _PACKAGE / name
    return installed if installed.is_dir() else _PACKAGE.parent / name

"""Parquet: the package that reads and writes it."""

from __future__ import annotations

from typing import Any

from app.errors import InputError


def import_pyarrow() -> tuple[Any, Any]:
    try:
        import pyarrow
        import pyarrow.parquet as parquet
    except ImportError:
        raise InputError(
            "Parquet needs the package pyarrow, which is not installed",
            hint="Install Touchline with its extra: pip install 'touchline[export]'.",
        ) from None
    return pyarrow, parquet

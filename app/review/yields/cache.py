"""Yield cache: a table in a file, so that a restart need not read every solution again.

A cache like the thumbnails: it can be deleted at any time, and what cannot be read is made again.
"""

from __future__ import annotations

import zipfile
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import structlog

from app.durable import replace_file
from app.review.yields.table import EMPTY, YieldTable
from app.solving.facts import COLUMNS, Facts

FORMAT = "4"
"""Raised with every change of ``Facts``."""

log = structlog.get_logger("touchline.yields")


def keep_table(path: Path, calibration: str, table: YieldTable) -> None:
    """Write a table, whole or not at all; a full disk costs the cache and no answer.

    Args:
        path: The file.
        calibration: What the calibrations of the table were made by.
        table: Every array of it.
    """
    made_by = np.array([FORMAT, calibration])
    arrays: dict[str, Any] = {name: getattr(table.facts, name) for name in COLUMNS}
    arrays |= {"group_id": table.group_id, "inputs": table.inputs}
    file = BytesIO()
    np.savez(file, allow_pickle=False, made_by=made_by, **arrays)
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        # What a power cut leaves of it cannot be read, and is made again.
        replace_file(path, file.getbuffer(), durable=False)
    except OSError as error:
        log.warning("a yield table could not be kept", error=str(error))


def kept_table(path: Path, calibration: str) -> YieldTable:
    """The table in a file; an empty one where there is none of this kind."""
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            if arrays["made_by"].tolist() != [FORMAT, calibration]:
                return EMPTY
            columns = {name: arrays[name] for name in COLUMNS}
            ids, inputs = arrays["group_id"], arrays["inputs"]
            table = YieldTable(ids, inputs, Facts(len(ids), **columns))
    except FileNotFoundError:
        return EMPTY
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        log.warning("a kept yield table cannot be read and is made again", error=str(error))
        return EMPTY
    return table if _is_sound(table) else EMPTY


def forget_table(path: Path) -> None:
    """Delete a kept table."""
    with suppress(OSError):
        path.unlink(missing_ok=True)


def _is_sound(table: YieldTable) -> bool:
    """Whether every array has its type, its shape and rows that exist."""
    facts, lengths = table.facts, dict[str, int]()
    for name, (kind, shape) in COLUMNS.items():
        array, per = getattr(facts, name), name.partition("_")[0]
        rows = lengths.setdefault(per, len(array))
        if array.shape != (rows, *shape) or not np.issubdtype(array.dtype, kind):
            return False
    inside = (
        (facts.view_group, table.groups),
        (facts.mark_view, lengths["view"]),
        (facts.pair_group, table.groups),
        (facts.pair_view, lengths["view"]),
    )
    return (
        table.group_id.dtype == np.int64
        and table.group_id.shape == table.inputs.shape == (table.groups,)
        and np.issubdtype(table.inputs.dtype, np.str_)
        and all(not len(rows) or 0 <= rows.min() <= rows.max() < count for rows, count in inside)
    )

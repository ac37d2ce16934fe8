"""StatisticsCache: what statistics count, a row a group, kept in step with the database.

29 bytes a group lie in memory and in the cache. A look reads again what has changed since the last
one: groups that the database has marked, and groups that somebody has judged.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import structlog

from app.db.log import find_newest_entry_id, read_entry_hash
from app.db.session import Session
from app.db.store import Store
from app.errors import NotFoundError
from app.features.datasets.queries import read_dataset_names
from app.features.groups.revision_queries import (
    count_groups,
    find_newest_change_id,
    list_changed_group_ids,
)
from app.features.queue.queries import read_columns_after, read_columns_of_groups
from app.features.queue.statistics import (
    COLUMNS,
    Statistics,
    StatisticsColumns,
    make_statistics,
    rows_to_statistics_columns,
)
from app.features.verdicts.queries import find_newest_verdict_id, list_groups_judged_after_verdict
from app.features.what_if.cache import map_arrays, write_arrays
from app.features.what_if.service import AT_ONCE, read_policy
from app.geometry.arrays import IntArray
from app.soccer.solution import SOLVER_VERSION

FORMAT = 1
BATCH, CHUNK = 20_000, 500
"""Groups that are read at once: in order, or by their ids."""
WORTH_KEEPING = 500
"""From so many groups on they are written to the cache."""
FLUSH = 1000
"""So many changes are followed in memory before they are written."""
_ARRAYS = ("split", "match", "passes", "accepted", "cell", "bins")

log = structlog.get_logger("touchline.statistics")


@dataclass(frozen=True, eq=False)
class _DatasetColumns:
    """Groups in order of their ids, as of a moment.

    Attributes:
        policy: What judged them, and the solver's version.
        change: The last change of a group that is followed.
        verdict: The last verdict that is.
        entry: Number and hash of the log's last entry then.
        noted: Changes that the cache does not know of.
    """

    policy: str
    change: int
    verdict: int
    entry: tuple[int, str]
    group_id: IntArray
    counted: StatisticsColumns
    noted: int = 0


class StatisticsCache:
    """The statistics of whole datasets that somebody asked about."""

    def __init__(self, store: Store):
        self._store = store
        self._lock = threading.Lock()
        self._locks: dict[int, threading.Lock] = {}
        self._kept: dict[int, _DatasetColumns] = {}

    def get_statistics(self, dataset_id: int) -> Statistics:
        """The statistics of all groups of a dataset as it is now.

        Raises:
            NotFoundError: There is no such dataset.
        """
        with self._lock:
            lock = self._locks.setdefault(dataset_id, threading.Lock())
        with lock:
            try:
                found = self._refresh_columns(dataset_id)
            except NotFoundError:
                self._kept.pop(dataset_id, None)
                self._cache_file(dataset_id).unlink(missing_ok=True)
                raise
        return make_statistics(found.counted)

    def refresh_large_datasets(self) -> None:
        """Read those datasets that would let somebody wait."""
        with self._store.read() as session:
            names = read_dataset_names(session)
            large = [number for number in names if count_groups(session, number) > AT_ONCE]
        for dataset_id in large:
            try:
                self.get_statistics(dataset_id)
            except Exception:
                log.exception("statistics stay behind")

    def _cache_file(self, dataset_id: int) -> Path:
        return self._store.settings.yields / "statistics" / f"{dataset_id}.counted"

    def _refresh_columns(self, dataset_id: int) -> _DatasetColumns:
        with self._store.read() as session:
            policy = f"{read_policy(session, dataset_id).hash} {SOLVER_VERSION}"
            kept = self._kept.get(dataset_id) or _read_columns(
                session, self._cache_file(dataset_id)
            )
            if kept is not None and kept.policy == policy:
                kept = _update_columns(session, dataset_id, kept)
            if (
                kept is None
                or kept.policy != policy
                or len(kept.group_id) != count_groups(session, dataset_id)
            ):
                kept = replace(_read_all_columns(session, dataset_id, policy), noted=FLUSH)
        if kept.noted >= FLUSH and len(kept.group_id) >= WORTH_KEEPING:
            _write_columns(self._cache_file(dataset_id), kept)
            kept = replace(kept, noted=0)
        self._kept[dataset_id] = kept
        return kept


def _read_all_columns(session: Session, dataset_id: int, policy: str) -> _DatasetColumns:
    """Every group."""
    ids, parts = [], []
    for rows in _iterate_row_chunks(session, dataset_id):
        ids.append(np.array([row[0] for row in rows], np.int64))
        parts.append(rows_to_statistics_columns([row[1:] for row in rows]))
    return _DatasetColumns(
        policy,
        **_read_newest_ids(session),
        group_id=np.concatenate(ids or [np.zeros(0, np.int64)]),
        counted=_join_columns(parts) if parts else rows_to_statistics_columns([]),
    )


def _iterate_row_chunks(session: Session, dataset_id: int) -> Iterator[Sequence[Any]]:
    after = 0
    while rows := read_columns_after(session, dataset_id, ("group_id", *COLUMNS), after, BATCH):
        yield rows
        after = rows[-1].group_id


def _read_newest_ids(session: Session) -> dict[str, Any]:
    number = find_newest_entry_id(session)
    return {
        "change": find_newest_change_id(session),
        "verdict": find_newest_verdict_id(session),
        "entry": (number, read_entry_hash(session, number) or ""),
    }


def _update_columns(session: Session, dataset_id: int, kept: _DatasetColumns) -> _DatasetColumns:
    """What has changed, read again; groups that are gone show in the number of those left."""
    changed = set(list_changed_group_ids(session, dataset_id, kept.change))
    ids = sorted(changed | set(list_groups_judged_after_verdict(session, dataset_id, kept.verdict)))
    moment = _read_newest_ids(session)
    if not ids:
        return replace(kept, **moment)
    rows = [
        row
        for start in range(0, len(ids), CHUNK)
        for row in read_columns_of_groups(
            session, ids[start : start + CHUNK], (), ("group_id", *COLUMNS)
        )
    ]
    new = np.array([row[0] for row in rows], np.int64)
    stays = ~np.isin(kept.group_id, np.array(ids, np.int64))
    group_id = np.concatenate([kept.group_id[stays], new])
    joined = _join_columns(
        [_select_groups(kept.counted, stays), rows_to_statistics_columns([row[1:] for row in rows])]
    )
    order = np.argsort(group_id, kind="stable")
    return _DatasetColumns(
        kept.policy,
        **moment,
        group_id=group_id[order],
        counted=_select_groups(joined, order),
        noted=kept.noted + len(ids),
    )


def _select_groups(found: StatisticsColumns, chosen: Any) -> StatisticsColumns:
    return replace(found, **{name: getattr(found, name)[..., chosen] for name in _ARRAYS})


def _join_columns(parts: Sequence[StatisticsColumns]) -> StatisticsColumns:
    splits = sorted({name for part in parts for name in part.splits})
    matches = sorted({name for part in parts for name in part.matches})
    joined = {
        name: np.concatenate([getattr(part, name) for part in parts], axis=-1) for name in _ARRAYS
    }
    joined["split"] = np.concatenate(
        [_recode_names(part.splits, part.split, splits) for part in parts]
    )
    joined["match"] = np.concatenate(
        [_recode_names(part.matches, part.match, matches) for part in parts]
    )
    return StatisticsColumns(tuple(splits), tuple(matches), **joined)


def _recode_names(before: Sequence[str], codes: Any, names: Sequence[str]) -> Any:
    places = {name: place for place, name in enumerate(names)}
    return np.array([places[name] for name in before], np.int32)[codes] if len(codes) else codes


def _write_columns(file: Path, kept: _DatasetColumns) -> None:
    about = {
        "format": FORMAT,
        "policy": kept.policy,
        "change": kept.change,
        "verdict": kept.verdict,
        "entry": kept.entry,
        "splits": kept.counted.splits,
        "matches": kept.counted.matches,
    }
    arrays = {name: getattr(kept.counted, name) for name in _ARRAYS}
    try:
        write_arrays(file, about, {"group_id": kept.group_id, **arrays})
    except OSError as error:
        log.warning("statistics cannot be kept", error=str(error))


def _read_columns(session: Session, file: Path) -> _DatasetColumns | None:
    """What the cache holds; None where it holds nothing that this database could have said."""
    try:
        found = map_arrays(file, whole=True)
        about, arrays = found.about, dict(found.arrays)
        number, digest = about["entry"]
        if about["format"] != FORMAT or about["change"] > find_newest_change_id(session):
            return None
        if number and read_entry_hash(session, number) != digest:
            return None
        group_id = arrays.pop("group_id")
        held = StatisticsColumns(tuple(about["splits"]), tuple(about["matches"]), **arrays)
        return _DatasetColumns(
            about["policy"], about["change"], about["verdict"], (number, digest), group_id, held
        )
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, TypeError) as error:
        log.warning(
            "the cached statistics cannot be read; they are computed again", error=str(error)
        )
        return None

"""The groups of a dataset in blocks.

Blocks are kept in step with the database and hold the facts that stand beside solutions.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from app.db.log import find_newest_entry_id, read_entry_hash
from app.db.session import Session
from app.features.groups.queries import read_groups
from app.features.groups.revision_queries import (
    count_changed_groups,
    count_groups,
    find_newest_change_id,
    list_changed_groups,
    list_groups_after,
)
from app.features.solutions.queries import StoredGateFacts, read_calibrations, read_solution_facts
from app.features.what_if.cache import (
    CachedBlock,
    CachedTable,
    read_cached_table,
    write_cached_block,
    write_cached_block_list,
)
from app.features.what_if.table import EMPTY, YieldTable, join_tables, make_table
from app.solving.facts import (
    NOTHING,
    GroupFacts,
    collect_facts_of_views,
    facts_from_bytes,
    facts_to_bytes,
)

CHUNK = 400
"""Groups that are read at once."""


def read_tables(session: Session, rows: Sequence[Any]) -> tuple[YieldTable, YieldTable]:
    """The table of the groups that are solved, and that of the others.

    Args:
        session: A read session.
        rows: As ``list_groups_after`` returns them in the same session.
    """
    solved, others = [], []
    tables = []
    for start in range(0, len(rows), CHUNK):
        chunk = rows[start : start + CHUNK]
        found = _read_facts(
            session, [row.solution_id for row in chunk if row.solution_id is not None]
        )
        solved = [row for row in chunk if row.group_id in found]
        others += [row for row in chunk if row.group_id not in found]
        tables.append(make_table(solved, facts_from_bytes([found[row.group_id] for row in solved])))
    return join_tables([make_table([], NOTHING), *tables]), make_table(others, NOTHING)


def _read_facts(session: Session, solution_ids: Sequence[int]) -> dict[int, bytes]:
    """Facts of solutions, by group."""
    rows = read_solution_facts(session, solution_ids)
    found = {row.group_id: row.facts for row in rows if row.facts is not None}
    bare = [row for row in rows if row.facts is None]
    found.update((group, facts_to_bytes(facts)) for group, facts in _recompute_facts(session, bare))
    return found


def _recompute_facts(
    session: Session, rows: Sequence[StoredGateFacts]
) -> Iterator[tuple[int, GroupFacts]]:
    """Facts of solutions from before they were kept, where they still fit their group."""
    keys = {row.group_id: json.loads(row.calibrations) for row in rows}
    calibrations = read_calibrations(session, {key for names in keys.values() for key in names})
    groups = read_groups(session, list(keys), extras=False)
    for row in rows:
        stored = groups.get(row.group_id)
        if stored is not None and stored.inputs_hash == row.inputs_hash:
            found = [calibrations[key] for key in keys[row.group_id]]
            yield row.group_id, collect_facts_of_views(stored.group.views, found)


BLOCK = 8192
"""Groups of a block: its columns lie in the processor's cache while it is judged."""
WORTH_KEEPING = 500
"""From so many groups on a table is written to the cache; fewer are read again in a moment."""
FLUSH = 1000
"""So many changes are followed in memory before they are written."""


@dataclass
class DatasetBlocks:
    """The groups of a dataset.

    Attributes:
        folder: Of the cache.
        calibration: What the calibrations were made by.
        mark: The last change of the database that is followed.
        through: Number of the last group that was gathered; None once all are.
        blocks: Of groups that are solved, those in memory alone under no name.
        bare: The groups that are not.
        noted: Changes that the cache does not know of.
        version: Counts what changes the blocks.
        whole: The mark at which it held as many groups as the dataset.
    """

    folder: Path
    dataset_id: int
    calibration: str
    mark: int
    through: int | None = 0
    blocks: list[CachedBlock] = field(default_factory=list)
    bare: YieldTable = EMPTY
    noted: int = 0
    version: int = 0
    whole: int | None = None

    @staticmethod
    def create_empty(
        session: Session, folder: Path, dataset_id: int, calibration: str
    ) -> DatasetBlocks:
        """No group yet, as the database stands."""
        return DatasetBlocks(folder, dataset_id, calibration, find_newest_change_id(session))

    @staticmethod
    def load(
        session: Session, folder: Path, dataset_id: int, calibration: str
    ) -> DatasetBlocks | None:
        """What the cache holds; None where it holds nothing that this database could have said."""
        kept = read_cached_table(folder, calibration)
        if kept is None or kept.mark > find_newest_change_id(session):
            return None
        number, digest = kept.entry
        if number and read_entry_hash(session, number) != digest:
            return None
        found = DatasetBlocks(folder, dataset_id, calibration, kept.mark, kept.through)
        found.blocks, found.bare = list(kept.blocks), kept.bare
        return found

    @property
    def groups(self) -> int:
        """How many groups there are, solved or not."""
        return sum(block.groups for block in self.blocks) + self.bare.groups

    def has_all_groups(self, session: Session) -> bool:
        """Whether it holds as many groups as the dataset has; a million are counted once a change."""
        if self.whole != self.mark and self.groups == count_groups(session, self.dataset_id):
            self.whole = self.mark
        return self.whole == self.mark

    def count_groups_to_read(self, session: Session) -> int:
        """How many groups have to be read until it is in step."""
        total = (
            count_groups(session, self.dataset_id) - self.groups if self.through is not None else 0
        )
        return total + count_changed_groups(session, self.dataset_id, self.mark)

    def read_next_block(self, session: Session) -> bool:
        """Come a block of groups closer to the database; False: it is in step with the session."""
        return (
            self._read_new_groups(session)
            if self.through is not None
            else self._read_changed_groups(session)
        )

    def _read_new_groups(self, session: Session) -> bool:
        rows = list_groups_after(session, self.dataset_id, self.through or 0, BLOCK)
        solved, bare = read_tables(session, rows)
        if solved.groups:
            large = self.through or len(rows) >= WORTH_KEEPING
            self.blocks.append(self._write_block(solved) if large else CachedBlock("", solved))
        self.bare = join_tables([self.bare, bare]) if bare.groups else self.bare
        self.through = rows[-1].number if len(rows) == BLOCK else None
        self.version += 1
        if self.groups >= WORTH_KEEPING:
            self._write_block_list(session)
        return True

    def _read_changed_groups(self, session: Session) -> bool:
        """Read again what has changed; what was only solved under other thresholds has not."""
        rows = list_changed_groups(session, self.dataset_id, self.mark, BLOCK)
        if not rows:
            # The changes of other datasets need not be passed over again.
            self.mark = find_newest_change_id(session)
            return False
        self.mark = rows[-1].change_id
        self.noted += len(rows)
        same = self._rows_in_blocks([row.group_id for row in rows])
        new = [row for row in rows if same.get(row.group_id) != _row_values(row)]
        if new:
            self._replace_rows(read_tables(session, new))
            self.version += 1
        if self.noted >= FLUSH:
            self._write_unwritten_blocks(session)
        return True

    def _rows_in_blocks(self, group_ids: list[int]) -> dict[int, tuple[object, ...]]:
        """What the blocks hold of groups."""
        wanted, found = np.array(group_ids), dict[int, tuple[object, ...]]()
        for block in self.blocks:
            table = block.table
            here = np.isin(table.group_id, wanted)
            if block.live is not None:
                here &= block.live
            for row in np.flatnonzero(here).tolist():
                found[int(table.group_id[row])] = (
                    table.inputs[row].decode(),
                    table.splits[table.split[row]],
                    table.matches[table.match[row]],
                    *table.pitch[row].tolist(),
                )
        return found

    def _replace_rows(self, tables: tuple[YieldTable, YieldTable]) -> None:
        solved, bare = tables
        new = np.concatenate([solved.group_id, bare.group_id])
        blocks = [block.without(new) for block in self.blocks]
        tail = [block for block in blocks if not block.name]
        self.blocks = [block for block in blocks if block.name and block.groups]
        if solved.groups or any(block.groups for block in tail):
            table = join_tables([*(block.live_table for block in tail), solved])
            self.blocks.append(CachedBlock("", table))
        self.bare = join_tables([self.bare.select_groups(~np.isin(self.bare.group_id, new)), bare])

    def _write_unwritten_blocks(self, session: Session) -> None:
        """Write what is in memory alone, together with blocks that became small."""
        small = [block for block in self.blocks if not block.name or block.groups < BLOCK // 2]
        if any(not block.name for block in small):
            kept = [block for block in self.blocks if block not in small]
            table = join_tables([block.live_table for block in small])
            self.blocks = [*kept, self._write_block(table)]
            self.version += 1
            self.version += 1
        self._write_block_list(session)

    def _write_block(self, table: YieldTable) -> CachedBlock:
        return write_cached_block(self.folder, table)

    def _write_block_list(self, session: Session) -> None:
        number = find_newest_entry_id(session)
        entry = number, read_entry_hash(session, number) or ""
        write_cached_block_list(
            self.folder,
            CachedTable(
                self.calibration, self.mark, entry, self.through, tuple(self.blocks), self.bare
            ),
        )
        self.noted = 0


def _row_values(row: object) -> tuple[object, ...]:
    names = ("inputs_hash", "split", "match", "pitch_length", "pitch_width")
    return tuple(getattr(row, name) for name in names)

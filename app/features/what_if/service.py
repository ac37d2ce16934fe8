"""The tables of datasets, kept in step with the database as groups change, and their check."""

from __future__ import annotations

import threading
from collections import Counter, OrderedDict
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import structlog

from app.config import Settings
from app.db.check import CheckResult
from app.db.session import Session
from app.db.store import Store
from app.errors import NotFoundError, OverloadedError, ReviewError
from app.features.datasets.queries import find_dataset, parse_stored_policy, read_dataset_names
from app.features.groups.revision_queries import count_changed_groups, count_groups
from app.features.what_if.block_results import (
    BlockResults,
    GroupCounts,
    count_table_groups,
    map_in_threads,
)
from app.features.what_if.blocks import DatasetBlocks
from app.features.what_if.cache import (
    ARRAYS,
    CachedBlock,
    delete_cached_table,
    map_arrays,
    read_cached_results,
    write_cached_results,
)
from app.features.what_if.table import EMPTY, YieldTable, join_tables
from app.geometry.arrays import BoolArray
from app.soccer.policy import Policy
from app.soccer.solution import SOLVER_VERSION
from app.wording import plural

MAX_BYTES = 512 * 1024 * 1024
"""What all tables together may hold in memory; beyond it the one that was asked for longest ago
goes. Files that are mapped do not count: the system takes their memory back when it needs it."""
AT_ONCE = 20_000
"""Groups that are read while somebody waits; of more, who asks is told how far they are."""
PATIENCE_SECONDS = 5.0
"""How long who asks waits for others who read at the moment."""
FAR_BEHIND = 2000
"""Changes from which on it is worth a look whether another process has followed them."""

log = structlog.get_logger("touchline.yields")


@dataclass(frozen=True)
class TableBlock:
    """A block of a table, and what the present policy makes of it."""

    block: CachedBlock
    judged: BlockResults

    @cached_property
    def present_counts(self) -> GroupCounts:
        """The counts of its groups under the present policy."""
        judgement = self.judged.judgement
        return count_table_groups(
            self.table, self.live_rows, self.judged.policy, judgement, judgement
        )

    def count_under_policy(self, policy: Policy) -> GroupCounts:
        """The counts of its groups under another policy."""
        judgement = self.judged.judge_with_policy(policy)
        return count_table_groups(
            self.table,
            self.live_rows,
            policy,
            self.judged.judgement,
            judgement,
            self.present_counts,
        )

    @property
    def table(self) -> YieldTable:
        """Its groups, those among them that do not count any more."""
        return self.block.table

    @property
    def live_rows(self) -> BoolArray | slice:
        """Chooses the rows of those that count."""
        return slice(None) if self.block.live is None else self.block.live

    @cached_property
    def counts_by_match_and_split(self) -> Counter[tuple[str, str]]:
        """How many groups that count lie in each match and split."""
        return self.table.count_groups_by_match_and_split(self.block.live)


@dataclass(frozen=True)
class TableSnapshot:
    """A dataset's table with what is computed from it, all of one state.

    Attributes:
        policy: The present one.
        blocks: The groups that are solved.
        bare: The others.
    """

    policy: Policy
    blocks: tuple[TableBlock, ...]
    bare: YieldTable

    @cached_property
    def solved_count(self) -> int:
        """How many groups are solved."""
        return sum(part.block.groups for part in self.blocks)

    @property
    def unsolved_count(self) -> int:
        """How many are not."""
        return self.bare.groups

    @cached_property
    def table(self) -> YieldTable:
        """The groups that are solved, in one table."""
        return join_tables([EMPTY, *(part.block.live_table for part in self.blocks)])

    @property
    def nbytes(self) -> int:
        """Memory that it holds, without what is mapped from files."""
        loose = sum(part.table.nbytes for part in self.blocks if not part.block.name)
        return loose + sum(part.judged.nbytes for part in self.blocks) + self.bare.nbytes

    @cached_property
    def counts_by_match_and_split(self) -> Counter[tuple[str, str]]:
        """How many groups lie in each match and split, solved or not."""
        total = self.bare.count_groups_by_match_and_split()
        for part in self.blocks:
            total.update(part.counts_by_match_and_split)
        return total


@dataclass
class _YieldEntry:
    """A dataset's groups, and the snapshot that was made of them last."""

    lock: threading.Lock = field(default_factory=threading.Lock)
    gathered: DatasetBlocks | None = None
    version: int | None = None
    snapshot: TableSnapshot | None = None
    read: tuple[int, int] = (0, 0)
    """How many groups are read, and how many are left: for who asks meanwhile."""


class WhatIfStore:
    """The tables of the datasets that somebody asked about."""

    def __init__(self, store: Store):
        self._store = store
        self._lock = threading.Lock()
        self._kept: OrderedDict[int, _YieldEntry] = OrderedDict()

    def get_snapshot(self, dataset_id: int) -> TableSnapshot:
        """The table of a dataset as it is now; what has changed since the last look is read.

        Raises:
            NotFoundError: There is no such dataset.
            OverloadedError: So many groups have changed that a thread reads them first.
        """
        kept = self._get_entry(dataset_id)
        if not kept.lock.acquire(timeout=PATIENCE_SECONDS):
            raise _not_ready_error(kept)
        try:
            snapshot = self._try_refresh(dataset_id, kept, AT_ONCE)
        finally:
            kept.lock.release()
        if snapshot is None:
            error = _not_ready_error(kept)
            work = threading.Thread(
                target=self._update_table_or_log, args=(dataset_id,), daemon=True
            )
            work.start()
            raise error
        self._evict_snapshots()
        return snapshot

    def update_table(self, dataset_id: int) -> None:
        """Bring a table in step, however much has changed, before somebody asks.

        Raises:
            NotFoundError: There is no such dataset.
        """
        kept = self._get_entry(dataset_id)
        with kept.lock:
            self._try_refresh(dataset_id, kept, None)
        self._evict_snapshots()

    def refresh_large_datasets(self) -> None:
        """Bring those tables in step that would let somebody wait."""
        with self._store.read() as session:
            names = read_dataset_names(session)
            large = [number for number in names if count_groups(session, number) > AT_ONCE]
        for dataset_id in large:
            self._update_table_or_log(dataset_id)

    def _update_table_or_log(self, dataset_id: int) -> None:
        try:
            self.update_table(dataset_id)
        except ReviewError as error:
            log.warning("a yield table stays behind", error=error.message)
        except Exception:
            log.exception("a yield table stays behind")

    def _get_entry(self, dataset_id: int) -> _YieldEntry:
        with self._lock:
            kept = self._kept.setdefault(dataset_id, _YieldEntry())
            self._kept.move_to_end(dataset_id)
        return kept

    def _folder(self, dataset_id: int) -> Path:
        return self._store.settings.yields / str(dataset_id)

    def _try_refresh(
        self, dataset_id: int, kept: _YieldEntry, most: int | None
    ) -> TableSnapshot | None:
        try:
            return self._refresh_snapshot(dataset_id, kept, most)
        except NotFoundError:
            with self._lock:
                self._kept.pop(dataset_id, None)
            delete_cached_table(self._folder(dataset_id))
            raise

    def _refresh_snapshot(
        self, dataset_id: int, kept: _YieldEntry, most: int | None
    ) -> TableSnapshot | None:
        """The snapshot as of now; None where more groups than ``most`` would have to be read."""
        while True:
            with self._store.read() as session:
                policy = read_policy(session, dataset_id)
                blocks = self._load_current_blocks(session, dataset_id, kept, policy)
                left = blocks.count_groups_to_read(session)
                kept.read = blocks.groups, left
                if most is not None and left > most:
                    return None
                if blocks.read_next_block(session):
                    continue
                if not blocks.has_all_groups(session):
                    # Groups went without a mark, as when the log is replayed.
                    folder, calibration = blocks.folder, blocks.calibration
                    kept.gathered = DatasetBlocks.create_empty(
                        session, folder, dataset_id, calibration
                    )
                    kept.snapshot = None
                    continue
            break
        old = kept.snapshot
        if old is None or kept.version != blocks.version or old.policy != policy:
            kept.snapshot = self._make_snapshot(blocks, policy, old)
            kept.version = blocks.version
        return kept.snapshot

    def _load_current_blocks(
        self, session: Session, dataset_id: int, kept: _YieldEntry, policy: Policy
    ) -> DatasetBlocks:
        """The groups as they were looked at last, here or by another process."""
        calibration, folder = (
            f"{policy.calibration_hash} {SOLVER_VERSION}",
            self._folder(dataset_id),
        )
        known = kept.gathered
        if known is not None and known.calibration != calibration:
            known = None
        if known is None or count_changed_groups(session, dataset_id, known.mark) > FAR_BEHIND:
            found = DatasetBlocks.load(session, folder, dataset_id, calibration)
            if found is not None and (known is None or found.mark > known.mark):
                known = found
        if known is None:
            known = DatasetBlocks.create_empty(session, folder, dataset_id, calibration)
        if known is not kept.gathered:
            kept.gathered, kept.snapshot = known, None
        return known

    def _make_snapshot(
        self, blocks: DatasetBlocks, policy: Policy, old: TableSnapshot | None
    ) -> TableSnapshot:
        """The snapshot of groups under a policy; what was judged before no longer is."""
        before = {id(part.table): part for part in old.blocks} if old is not None else {}

        def judge_block(block: CachedBlock) -> TableBlock:
            known = before.get(id(block.table))
            if known is not None and known.judged.policy.hash == policy.hash:
                return known if known.block is block else TableBlock(block, known.judged)
            if known is None:
                judged = read_cached_results(blocks.folder, block, policy)
                if judged is not None:
                    return TableBlock(block, judged)
            table = block.table
            if known is not None:
                judged = known.judged.rejudge(policy)
            else:
                judged = BlockResults.judge_facts(table.facts, table.jac, policy)
            if block.name:
                judged.compute_missing()
                write_cached_results(blocks.folder, block, judged)
            return TableBlock(block, judged)

        return TableSnapshot(policy, tuple(map_in_threads(judge_block, blocks.blocks)), blocks.bare)

    def _evict_snapshots(self) -> None:
        with self._lock:
            sizes = {
                key: kept.snapshot.nbytes
                for key, kept in self._kept.items()
                if kept.snapshot is not None
            }
            for key in list(sizes)[:-1]:
                if sum(sizes.values()) <= MAX_BYTES:
                    return
                del self._kept[key], sizes[key]


def read_policy(session: Session, dataset_id: int) -> Policy:
    """The present policy of a dataset; raises NotFoundError when there is none."""
    row = find_dataset(session, dataset_id)
    if row is None:
        raise NotFoundError.dataset(dataset_id)
    return parse_stored_policy(row.policy)


def _not_ready_error(kept: _YieldEntry) -> OverloadedError:
    done, left = kept.read
    return OverloadedError(
        f"the yield is being counted: {done:,} groups are read, about {left:,} are left",
        hint="Repeat the request in a few seconds.",
    )


def examine_yield_cache(settings: Settings) -> CheckResult:
    """Read every file of the cache; one that a server deletes meanwhile is none any more."""
    files = [path for ending in ARRAYS for path in sorted(settings.yields.glob(f"*/*{ending}"))]
    damaged = [path for path in files if not _is_file_readable(path)]
    if damaged:
        more = "" if len(damaged) == 1 else f" and {plural(len(damaged) - 1, 'other')}"
        sentence = f"{damaged[0].relative_to(settings.home)}{more} cannot be read"
        advice = (
            f"Stop the server and delete {settings.yields}: the server computes the counts again."
        )
        return CheckResult("yields", False, sentence, advice)
    count = plural(len(files), "file")
    return CheckResult("yields", True, f"{count} in the cache, each as it was written")


def _is_file_readable(path: Path) -> bool:
    try:
        map_arrays(path, whole=True)
    except FileNotFoundError:
        return True
    except (OSError, ValueError, KeyError, TypeError):
        return False
    return True

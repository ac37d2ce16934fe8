"""Tables of a dataset in files, so that a restart need not read every solution."""

from __future__ import annotations

import json
import secrets
import shutil
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import structlog

from app.durable import replace_file
from app.features.what_if.block_results import BlockResults, get_click_noise
from app.features.what_if.table import FIGURES, HEADS, YieldTable
from app.geometry.arrays import BoolArray, IntArray
from app.json_text import json_text
from app.soccer.policy import Policy
from app.solving.facts import COLUMNS, NOTHING, GroupFacts
from app.solving.judgement import Judgement

_HEAD = 16
"""Bytes before the description: its length, and its checksum."""
_LINE = 64
"""Every array begins at a multiple of it."""


@dataclass(frozen=True)
class ArraysFile:
    """What a file holds: ``about`` it, and its arrays by name."""

    about: Mapping[str, Any]
    arrays: Mapping[str, Any]


def write_arrays(path: Path, about: Mapping[str, Any], arrays: Mapping[str, Any]) -> None:
    """Write a file, whole or not at all; what a power cut leaves cannot be read.

    Raises:
        OSError: The disk refuses.
    """
    places, size = dict[str, Any](), 0
    for name, array in arrays.items():
        places[name] = [array.dtype.str, array.shape, size]
        size += -(-array.nbytes // _LINE) * _LINE
    head = {"about": about, "arrays": places, "bytes": size, "checksum": _checksum(arrays)}
    described = json_text(head).encode()
    start = -(-(_HEAD + len(described)) // _LINE) * _LINE
    content = bytearray(start + size)
    content[:_HEAD] = np.array([len(described), zlib.crc32(described)], "<u8").tobytes()
    content[_HEAD : _HEAD + len(described)] = described
    for name, array in arrays.items():
        at = start + places[name][2]
        content[at : at + array.nbytes] = np.ascontiguousarray(array).tobytes()
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    replace_file(path, memoryview(content), durable=False)


def map_arrays(path: Path, *, whole: bool = False) -> ArraysFile:
    """The arrays of a file.

    Args:
        path: The file.
        whole: Whether what the arrays hold is compared with their checksum, which reads all of it.

    Raises:
        OSError: It cannot be read.
        ValueError: It is not what was written.
    """
    found, checksum = _map_with_checksum(path)
    # A file from before there was a checksum has none to compare.
    if whole and checksum is not None and _checksum(found.arrays) != checksum:
        raise ValueError(f"{path.name} is damaged: its checksum does not match")
    return found


def _checksum(arrays: Mapping[str, Any]) -> int:
    now = 0
    for array in arrays.values():
        now = zlib.crc32(np.ascontiguousarray(array).tobytes(), now)
    return now


def _map_with_checksum(path: Path) -> tuple[ArraysFile, int | None]:
    """The arrays of a file, and their checksum."""
    raw = np.asarray(np.memmap(path, np.uint8, "r"))
    length, checksum = np.frombuffer(raw[:_HEAD].tobytes(), "<u8").tolist()
    described = raw[_HEAD : _HEAD + length].tobytes()
    if zlib.crc32(described) != checksum:
        raise ValueError(f"{path.name} is damaged: the checksum of its head does not match")
    head = json.loads(described)
    start = -(-(_HEAD + length) // _LINE) * _LINE
    if len(raw) != start + head["bytes"]:
        raise ValueError(f"{path.name} is truncated or too long")
    arrays = {}
    for name, (kind, shape, at) in head["arrays"].items():
        dtype = np.dtype(kind)
        end = start + at + dtype.itemsize * int(np.prod(shape, dtype=int))
        arrays[name] = raw[start + at : end].view(dtype).reshape(shape)
    return ArraysFile(head["about"], arrays), head.get("checksum")


FORMAT = 6
"""Raised with every change of ``GroupFacts``, or of what it holds."""
LIST, BARE = "table.json", "bare.heads"
ARRAYS = (".facts", ".judged", ".heads", ".counted")
"""How names of files of arrays end."""
_JUDGEMENT = (
    "jac",
    "view_failed",
    "pair_failed",
    "failed",
    "baseline",
    "point",
    "parallax",
    "distance",
)
_LATER = ("sigma", "p_value")
_NOT_READ = (OSError, ValueError, KeyError, TypeError, IndexError)

log = structlog.get_logger("touchline.yields")


@dataclass(frozen=True, eq=False)
class CachedBlock:
    """A block in a file: its name, its groups, and those that still count; None: all do."""

    name: str
    table: YieldTable
    live: BoolArray | None = None

    @cached_property
    def groups(self) -> int:
        """How many groups count."""
        return self.table.groups if self.live is None else int(self.live.sum())

    @property
    def live_table(self) -> YieldTable:
        """The table of the groups that count."""
        return self.table if self.live is None else self.table.select_groups(self.live)

    def without(self, group_ids: IntArray) -> CachedBlock:
        """The block in which some groups do not count any more."""
        gone = np.isin(self.table.group_id, group_ids)
        live = ~gone if self.live is None else self.live & ~gone
        return replace(self, live=live) if gone.any() else self


@dataclass(frozen=True, eq=False)
class CachedTable:
    """What a folder holds.

    Attributes:
        calibration: What the calibrations of the table were made by.
        mark: Up to this change of the database it is true.
        entry: Number and hash of the last entry of the log then.
        through: Number of the last group that was read, where not all were yet.
        bare: The groups that are not solved.
    """

    calibration: str
    mark: int
    entry: tuple[int, str]
    through: int | None
    blocks: tuple[CachedBlock, ...]
    bare: YieldTable


def write_cached_block(folder: Path, table: YieldTable) -> CachedBlock:
    """Write a block, and map it; on a full disk it stays in memory under no name."""
    name = secrets.token_hex(8)
    arrays = {item: getattr(table.facts, item) for item in COLUMNS}
    arrays |= {item: getattr(table, item) for item in (*HEADS, *FIGURES)}
    about = {"format": FORMAT, "splits": table.splits, "matches": table.matches}
    try:
        write_arrays(_block_path(folder, name), about, arrays)
        return CachedBlock(name, _map_table(folder, name))
    except _NOT_READ as error:
        _log_failure(error)
        return CachedBlock("", table)


def write_cached_block_list(folder: Path, table: CachedTable) -> None:
    """Write which blocks count, and delete those that do not any more."""
    if not all(block.name for block in table.blocks):
        return
    blocks = [
        {"name": block.name, "gone": [] if block.live is None else _list_deleted_rows(block.live)}
        for block in table.blocks
    ]
    bare = table.bare
    about = {"mark": table.mark, "splits": bare.splits, "matches": bare.matches}
    named = {**vars(table), "format": FORMAT, "blocks": blocks, "bare": None}
    try:
        write_arrays(folder / BARE, about, {name: getattr(bare, name) for name in HEADS})
        replace_file(folder / LIST, json_text(named).encode(), durable=False)
        names = {BARE.partition(".")[0], *(block.name for block in table.blocks)}
        for path in folder.iterdir():
            if path.name != LIST and path.name.partition(".")[0] not in names:
                path.unlink(missing_ok=True)
    except OSError as error:
        _log_failure(error)


def read_cached_table(folder: Path, calibration: str) -> CachedTable | None:
    """What a folder holds; None where there is none of this kind."""
    try:
        found = json.loads((folder / LIST).read_bytes())
        if found["format"] != FORMAT or found["calibration"] != calibration:
            return None
        blocks = tuple(
            _exclude_deleted_groups(
                CachedBlock(item["name"], _map_table(folder, item["name"])), item["gone"]
            )
            for item in found["blocks"]
        )
        number, digest = found["entry"]
        for path in folder.iterdir():
            # What is used is not old, however long ago it was made.
            path.touch()
        through = found["through"]
        bare = _map_unsolved_table(folder, found["mark"])
        return CachedTable(calibration, found["mark"], (number, digest), through, blocks, bare)
    except FileNotFoundError:
        return None
    except _NOT_READ as error:
        _log_failure(error)
        return None


def write_cached_results(folder: Path, block: CachedBlock, judged: BlockResults) -> None:
    """Write what a policy makes of a block."""
    if not block.name:
        return
    arrays = {name: getattr(judged.judgement, name) for name in _JUDGEMENT}
    for name in _LATER:
        if getattr(judged, name) is not None:
            arrays[name] = getattr(judged, name)
    try:
        write_arrays(
            _results_path(folder, block.name), {"policy": _policy_key(judged.policy)}, arrays
        )
    except OSError as error:
        _log_failure(error)


def read_cached_results(folder: Path, block: CachedBlock, policy: Policy) -> BlockResults | None:
    """The cached results of a block under this policy; None where there are none."""
    if not block.name:
        return None
    try:
        found = map_arrays(_results_path(folder, block.name))
        if found.about["policy"] != _policy_key(policy):
            return None
        judgement = Judgement(**{name: found.arrays[name] for name in _JUDGEMENT})
        table = block.table
        if judgement.failed.shape[1:] != (table.groups,):
            raise ValueError(
                "the stored gate results have another number of groups than their block"
            )
        judged = BlockResults(table.facts, table.jac, policy, judgement)
        for name in _LATER:
            setattr(judged, name, found.arrays.get(name))
        return judged
    except FileNotFoundError:
        return None
    except _NOT_READ as error:
        _log_failure(error)
        return None


def delete_cached_table(folder: Path) -> None:
    """Delete a kept table."""
    shutil.rmtree(folder, ignore_errors=True)


def _policy_key(policy: Policy) -> list[Any]:
    return [policy.hash, *get_click_noise(policy)]


def _block_path(folder: Path, name: str) -> Path:
    return folder / f"{name}.facts"


def _results_path(folder: Path, name: str) -> Path:
    return folder / f"{name}.judged"


def _map_table(folder: Path, name: str) -> YieldTable:
    """The table of a block, mapped."""
    found = map_arrays(_block_path(folder, name))
    if found.about["format"] != FORMAT:
        raise ValueError("the cached block was written in another format")
    arrays = found.arrays
    facts = GroupFacts(len(arrays["group_id"]), **{item: arrays[item] for item in COLUMNS})
    heads = {item: arrays[item] for item in HEADS}
    splits, matches = tuple(found.about["splits"]), tuple(found.about["matches"])
    table = YieldTable(**heads, splits=splits, matches=matches, facts=facts)
    # What follows from the facts is read, too.
    vars(table).update({item: arrays[item] for item in FIGURES})
    _require_valid_table(table)
    return table


def _map_unsolved_table(folder: Path, mark: int) -> YieldTable:
    found = map_arrays(folder / BARE)
    if found.about["mark"] != mark:
        raise ValueError("the cached table was written at another revision than its blocks")
    splits, matches = tuple(found.about["splits"]), tuple(found.about["matches"])
    return YieldTable(**found.arrays, splits=splits, matches=matches, facts=NOTHING)


def _require_valid_table(table: YieldTable) -> None:
    """Raise ValueError unless every array has its type, its shape and rows that exist."""
    facts, lengths = table.facts, dict[str, int]()
    for name, (kind, shape) in COLUMNS.items():
        array, per = getattr(facts, name), name.partition("_")[0]
        rows = lengths.setdefault(per, len(array))
        if array.shape != (rows, *shape) or array.dtype != kind:
            raise ValueError(f"the cached column {name} has a wrong shape or type")
    inside = (
        (facts.view_group, table.groups),
        (facts.mark_view, lengths["view"]),
        (facts.pair_group, table.groups),
        (facts.pair_view, lengths["view"]),
        (table.split, len(table.splits)),
        (table.match, len(table.matches)),
    )
    if any(len(rows) and not 0 <= rows.min() <= rows.max() < count for rows, count in inside):
        raise ValueError("rows of the cached table refer to rows that do not exist")
    if any(len(getattr(table, name)) != table.groups for name in HEADS):
        raise ValueError("a column of the cached table has a wrong number of groups")


def _exclude_deleted_groups(block: CachedBlock, gone: Sequence[int]) -> CachedBlock:
    if not gone:
        return block
    live = np.ones(block.table.groups, bool)
    live[list(gone)] = False
    return CachedBlock(block.name, block.table, live)


def _list_deleted_rows(live: BoolArray) -> list[int]:
    gone: list[int] = np.flatnonzero(~live).tolist()
    return gone


def _log_failure(error: Exception) -> None:
    log.warning("a yield table cannot be kept or read, and is made again", error=str(error))

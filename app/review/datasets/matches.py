"""Matches of line files: which frames are of one match, and what each gets from the others."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from app.datasets.csv_text import read_rows
from app.datasets.file_tree import Limits
from app.datasets.json_text import read_json
from app.datasets.sn_calibration import LineFile
from app.errors import DatasetFormatError
from app.solving.match_model import FramePlace
from app.solving.match_position import NO_PLACES, Places
from app.solving.match_runs import guess_matches


@dataclass(frozen=True)
class MatchShare:
    """What a frame gets from the others of its match: their places. ``match`` is its name."""

    match: str
    others: Places


def read_matches(path: Path) -> dict[str, str]:
    """The match of each frame: a JSON object, or a CSV file with columns ``frame`` and ``match``.

    A frame is the stem of its line file, ``00002`` or ``folder/00002``.

    Raises:
        DatasetFormatError: The file is neither.
    """
    content = path.read_bytes()
    if path.suffix.lower() == ".json":
        value = read_json(content, str(path))
        if not isinstance(value, dict) or not all(isinstance(it, str) for it in value.values()):
            raise DatasetFormatError(str(path), None, None, "is not an object of frame: match")
        return dict(value)
    rows = read_rows(content, str(path), ("frame", "match"), Limits())
    return {row["frame"].strip(): row["match"].strip() for _, row in rows if "match" in row}


def shares_of(
    files: Sequence[LineFile], places: Sequence[FramePlace | None], named: Mapping[str, str] | None
) -> list[MatchShare]:
    """What each frame gets from the others of its match.

    Args:
        files: The frames.
        places: Where each alone puts its camera.
        named: Match by frame; a frame that is missing is alone. None: matches are guessed.
    """
    if named is None:
        order = sorted(range(len(files)), key=lambda index: files[index].stem)
        guessed = guess_matches([places[index] for index in order])
        match = {files[index].stem: str(run) for index, run in zip(order, guessed, strict=True)}
    else:
        match = {file.stem: named.get(file.stem, "") for file in files}
    members = defaultdict(list)
    for index, file in enumerate(files):
        members[match[file.stem]].append(index)
    shares = [MatchShare(match[file.stem], NO_PLACES) for file in files]
    for name, indices in members.items():
        if not name:
            continue
        known = {index: place for index in indices if (place := places[index]) is not None}
        all_ = Places(list(known.values()))
        row = {index: at for at, index in enumerate(known)}
        for index in indices:
            others = all_.without(row[index]) if index in row else all_
            shares[index] = MatchShare(name, others)
    return shares

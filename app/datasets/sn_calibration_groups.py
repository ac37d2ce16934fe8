"""sn-calibration as a dataset: each image a group of one view, with what match_info.json says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import closing
from pathlib import Path, PurePosixPath
from typing import Any

from app.datasets.archive import DEFAULT_LIMITS, Limits, open_tree
from app.datasets.match_info import METADATA, match_of, read_match_info
from app.datasets.report import Report
from app.datasets.sn_calibration import LineFile, line_files_of
from app.datasets.soccernet_v3 import SPLITS
from app.soccer.annotation import Extras
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Station, View


def read_sn_calibration(
    path: Path,
    size: ImageSize,
    report: Report,
    *,
    calibration: str = "given",
    limits: Limits = DEFAULT_LIMITS,
) -> Iterator[Group]:
    """Each frame as a group of one view, keyed by its stem.

    Its match comes from match_info.json, its split from a folder ``train``, ``valid``, ``test``
    or ``challenge``. Cameras that lie beside the lines are not read: import them as ``cameras``.
    """
    tree = open_tree(path, report, limits)
    if tree is None:
        return
    with closing(tree):
        names = tree.names()
        infos = read_match_info(tree, names, report)
        for file in line_files_of(tree, names, size, report):
            yield _group(file, infos.get(file.place, {}), calibration)


def _group(file: LineFile, info: Mapping[str, Any], calibration: str) -> Group:
    station = Station(file.stem, file.size, lines=file.lines, calibration=calibration)
    extras = Extras(lines=file.others, metadata={METADATA: dict(info)} if info else {})
    view = View(file.stem, station, media=file.media, extras=extras)
    match, folders = match_of(info), PurePosixPath(file.place).parts[:-1]
    split = next((part for part in reversed(folders) if part in SPLITS), "")
    name = PurePosixPath(file.stem).name
    label = f"{PurePosixPath(match).name} · frame {name}" if match else f"Frame {file.stem}"
    return Group(file.stem, (view,), match=match, split=split, label=label)

"""SoccerNet-v3D as released, read: Labels-v3D.json per match, and SNv3D.csv with its lists.

Labels bring lines, people and cameras; the table brings the annotated ball boxes and the split.
Either does alone. What was computed from them (JaC, 3D balls, errors) is computed again.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import PurePosixPath
from typing import Any

from app.datasets.camera_json import camera_from_json
from app.datasets.file_tree import DEFAULT_LIMITS, FileTree, Limits, Root, files_inside
from app.datasets.match_frames import MatchFrames
from app.datasets.report import Report
from app.datasets.soccernet_record import GAME, IMAGE
from app.datasets.soccernet_v3 import group_label
from app.datasets.soccernet_v3_reader import MatchReader
from app.datasets.soccernet_v3d import LABELS, TABLE
from app.datasets.soccernet_v3d_table import SnTable, TableRow, read_snv3d_table
from app.datasets.trees import opened_tree
from app.errors import DatasetFormatError
from app.plural import plural
from app.soccer.group import Group, Station, View

COMPUTED = (
    "calibration",
    "JaC",
    "calibrated_replays",
    "ball_3D",
    "rep_error",
    "optimized_error",
    "optimized_d",
    "verdict",
)
"""What Labels-v3D.json adds to an image's metadata; it is computed and never goes stale here."""


def read_soccernet_v3d(
    root: Root,
    report: Report,
    *,
    calibration: str = "given",
    limits: Limits = DEFAULT_LIMITS,
) -> Iterator[Group]:
    """The groups of every match below ``root``, with the released cameras as given ones.

    Args:
        root: Dataset folder, or any folder in it down to one match; or a zip of such a tree.
        report: Takes what had to be left out.
        calibration: What counts for a view that has a camera and lines.
        limits: Caps on what is read.
    """
    with opened_tree(root, report, limits) as tree:
        if tree is None:
            return
        names = tree.names()
        table = read_snv3d_table(tree, names, report, limits)
        folders = [name[: -len(LABELS)] for name in names if PurePosixPath(name).name == LABELS]
        if not folders and not table.rows:
            report.note(str(root), None, None, f"holds neither {LABELS} nor {TABLE}")
        reader = _Reader(table, calibration, report)
        matches = MatchReader(tree, names, report, limits, LABELS)
        for folder in folders:
            for group in matches.read_match(folder):
                yield reader.labelled(group, tree.shown(folder + LABELS))
        yield from reader.tabled(tree, names, limits)
        if unused := table.unused():
            count = plural(len(unused), "action")
            shown = ", ".join(unused[:5]) + (", ..." if len(unused) > 5 else "")
            report.remark(f"{count} of the split lists did not come: {shown}")


class _Reader:
    """Brings labels and table together."""

    def __init__(self, table: SnTable, calibration: str, report: Report):
        self._table, self._calibration, self._report = table, calibration, report
        self._seen: set[tuple[str, str]] = set()

    def labelled(self, group: Group, path: str) -> Group:
        """A group of Labels-v3D.json with its cameras, and what the table knows of it."""
        main = group.views[0].key
        self._seen.add((group.match, main))
        rows = self._table.rows.get(group.match, {}).get(main, {})
        for image in rows.keys() - {view.key for view in group.views}:
            self._report.note(path, image, None, f"is in {TABLE} and not here")
        views = tuple(self._view(view, rows.get(view.key), path) for view in group.views)
        split = self._table.split(group.match, main) or group.split
        return replace(group, views=views, split=split)

    def _view(self, view: View, row: TableRow | None, path: str) -> View:
        metadata = dict(view.extras.metadata)
        image = metadata[IMAGE]
        metadata[IMAGE] = {name: item for name, item in image.items() if name not in COMPUTED}
        if GAME in metadata:
            kept = {k: v for k, v in metadata[GAME].items() if k != "reconstructions"}
            metadata[GAME] = kept
        given = self._camera(image, view.key, path) or (row.camera if row else None)
        station = replace(view.station, given=given, calibration=self._calibration)
        balls = view.balls
        # The labels may hold the optimised box; the table always has the annotated one.
        if row is not None and row.ball is not None and len(balls) <= 1:
            occluded = bool(balls) and balls[0].occluded
            balls = (replace(row.ball, occluded=occluded),)
        extras = replace(view.extras, metadata=metadata)
        return replace(view, station=station, balls=balls, extras=extras)

    def _camera(self, image: Mapping[str, Any], record: str, path: str) -> Any:
        if image.get("calibration") is None:
            return None
        try:
            return camera_from_json(image["calibration"], path, record)
        except DatasetFormatError as error:
            where = f"calibration, {error.field}" if error.field else "calibration"
            self._report.note(path, record, where, f"{error.problem}; left out")
            return None

    def tabled(self, tree: FileTree, names: list[str], limits: Limits) -> Iterator[Group]:
        """The groups that stand in the table alone: balls and cameras, no lines."""
        for match, actions in self._table.rows.items():
            new = [main for main in actions if (match, main) not in self._seen]
            if not new:
                continue
            folder = f"{self._table.folder}{match}/"
            inside = files_inside(names, folder)
            frames = MatchFrames(tree, folder, inside, self._report)
            for main in new:
                self._report.read += 1
                group = self._group(match, main, actions[main], frames)
                if group is not None:
                    self._report.imported += 1
                    yield group

    def _group(
        self, match: str, main: str, rows: Mapping[str, TableRow], frames: MatchFrames
    ) -> Group | None:
        if main not in rows:
            problem = "has replays and no row of its own"
            self._report.note(f"{self._table.folder}{TABLE}", f"{match}/{main}", None, problem)
            return None
        ordered = sorted(rows.values(), key=lambda row: -1 if row.replay is None else row.replay)
        views = []
        for row in ordered:
            station = Station(
                f"{match}/{row.image}", row.size, given=row.camera, calibration=self._calibration
            )
            balls = (row.ball,) if row.ball else ()
            views.append(View(row.image, station, balls, frames.find(row.image)))
        return Group(
            key=f"{match}/{main}",
            views=tuple(views),
            match=match,
            split=self._table.split(match, main),
            label=group_label(match, main, {}),
        )

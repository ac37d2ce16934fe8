"""SoccerNet-v3 and v3D, written: one Labels-v3.json a match, and SNv3D.csv, the split lists and Labels-v3D.json as
released.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Any, TextIO

from app.errors import InputError
from app.formats.camera_json import camera_to_json
from app.formats.csv_text import CsvTableWriter, Value, format_number_list
from app.formats.export_record import ExportRecord, choose_ball_box
from app.formats.frame_names import frame_path_by_match, normalize_file_name
from app.formats.safe_path import resolve_inside
from app.formats.soccernet_v3 import (
    GAME,
    IMAGE,
    JOINED_LISTS,
    LABELS,
    LABELS_3D,
    MATCH_DEPTH,
    REST,
    SPLIT_FILES,
    TABLE,
    parse_image_numbers,
    record_to_json,
)
from app.json_text import json_text, replace_non_finite
from app.soccer.frames import Box
from app.soccer.group import Group, View
from app.soccer.solution import GAMMAS_PERCENT, BallFit


def parse_league_season_match(group: Group) -> tuple[str, str, str]:
    """League, season and match of a SoccerNet group.

    Raises:
        InputError: The group is from another kind of dataset.
    """
    parts = group.key.split("/")
    if len(parts) != MATCH_DEPTH + 1 or any(
        parse_image_numbers(view.key) is None for view in group.views
    ):
        raise InputError(
            f"group {group.key} is not from SoccerNet (league/season/match/7.png)",
            hint="Export it as cameras, sn-calibration or issia-3d instead.",
        )
    return parts[0], parts[1], parts[2]


def labels_frame_path(group: Group, view: View, split: str, suffix: str) -> str:
    """Where the frame of a view lies in an export: beside the labels of the group's match."""
    beside = replace(group, match="/".join(parse_league_season_match(group)))
    return frame_path_by_match(
        beside, replace(view, station=replace(view.station, shared=False)), split, suffix
    )


def write_soccernet_v3(root: Path, groups: Iterable[Group]) -> list[Path]:
    """Write ``<league>/<season>/<match>/Labels-v3.json`` for the groups, match by match.

    What the source held besides lines and balls is written as it came.

    Args:
        root: Existing folder.
        groups: Groups of SoccerNet; one run of a match is in memory at a time.

    Returns:
        The files written.

    Raises:
        InputError: A group is not from SoccerNet, or two of its match have one image.
        UnsafePathError: A key would leave ``root``.
    """
    writer = LabelsWriter(root, LABELS)
    for match, run in groupby(groups, key=lambda group: "/".join(parse_league_season_match(group))):
        members = list(run)
        writer.reserve_images(match, members)
        writer.write(match, labels_to_json(match, members))
    return list(writer.written)


class LabelsWriter:
    """Writes one labels file per match; a match that comes again is added to its file."""

    def __init__(self, root: Path, name: str):
        self._root, self._name = root, name
        self.written: dict[Path, None] = {}
        self._matches: dict[str, str] = {}
        self._images: dict[tuple[str, object], str] = {}

    def reserve_images(self, match: str, groups: Iterable[Group]) -> None:
        """Keep the images of groups of a match, of which the format has one by each number.

        Raises:
            InputError: An image of another group, or another match, has the same name.
        """
        other = self._matches.setdefault(normalize_file_name(match), match)
        if other != match:
            raise InputError(f"the matches {other} and {match} differ in case only; rename one")
        for group in groups:
            for view in group.views:
                whose = f"{group.key}, {view.key}"
                first = self._images.setdefault((match, parse_image_numbers(view.key)), whose)
                if first != whose:
                    raise InputError(
                        f"the images of two frames ({first} and {whose}) would have the same"
                        f" name in match {match} in SoccerNet's files",
                        hint="Export as coco, parquet, cameras or sn-calibration instead.",
                    )

    def write(self, match: str, labels: dict[str, Any]) -> None:
        """Write (or add to) the file of a match."""
        path = resolve_inside(self._root, f"{match}/{self._name}")
        if path in self.written:
            labels = _join_labels(json.loads(path.read_text(encoding="utf-8")), labels)
        path.parent.mkdir(parents=True, exist_ok=True)
        # Without indentation: with it, writing would take ten times as long.
        text = json_text(labels)
        path.write_text(text + "\n", encoding="utf-8")
        self.written[path] = None


def _join_labels(first: dict[str, Any], second: dict[str, Any]) -> dict[str, Any]:
    game = {**first[GAME]}
    for name, value in second[GAME].items():
        joins = isinstance(value, list) and isinstance(game.get(name), list)
        game[name] = [*game[name], *value] if joins and name in JOINED_LISTS else value
    images = {name: {**first[name], **second[name]} for name in ("actions", "replays")}
    return {**first, **second, GAME: game, **images}


def labels_to_json(match: str, groups: list[Group]) -> dict[str, Any]:
    """The object of one match's Labels-v3.json."""
    actions, replays = {}, {}
    kept: dict[str, Any] = {}
    for group in groups:
        main, *others = group.views
        kept = {**main.extras.metadata, **kept}
        names = [view.key for view in others]
        actions[main.key] = record_to_json(main, group.split) | {"linked_replays": names}
        for view in others:
            replays[view.key] = record_to_json(view, group.split) | {"linked_action": main.key}
    game = {"UrlLocal": match, **(kept.get(GAME) or {})}
    game |= {"list_actions": list(actions), "list_replays": list(replays)}
    return {**(kept.get(REST) or {}), GAME: game, "actions": actions, "replays": replays}


JAC_NAMES = tuple(f"JaC@{gamma / 100:g}" for gamma in GAMMAS_PERCENT)
COLUMNS = (
    "league",
    "season",
    "match",
    "main_action",
    "action",
    "replay",
    "img_w",
    "img_h",
    "is_ball",
    "ball_bbox",
    "calibration",
    *JAC_NAMES,
    "ball_3D",
    "rep_error",
    "optimized_error",
    "optimized_d",
    "set",
)


def write_soccernet_v3d(
    root: Path,
    records: Iterable[ExportRecord],
    *,
    everything: bool = False,
    boxes: str = "optimized",
) -> dict[str, int]:
    """Write the dataset's files below an existing folder.

    ``ball_bbox`` is the annotated box whatever ``boxes`` says, because the optimised one is
    defined by it: the square of side ``optimized_d`` around its centre. Of a ball that is a point
    it has no area. Labels-v3D.json holds the
    chosen box of the ball in the views that the 3D ball comes from, the annotated one in all
    others. Ball values stand in the rows of views in a valid pair, or in all rows
    with ``everything``, which also adds the column ``verdict``.

    Args:
        root: Existing folder.
        records: Groups of SoccerNet; one run of a match is in memory at a time.
        everything: Whether groups and views that failed a gate take part.
        boxes: Ball box of Labels-v3D.json, one of ``BOX_KINDS``.

    Returns:
        Counts: ``groups``, ``views``, ``balls`` (views in which the 3D ball holds).

    Raises:
        InputError: A group is not from SoccerNet, or two of its match have one image.
        UnsafePathError: A key would leave ``root``.
    """
    counts = {"groups": 0, "views": 0, "balls": 0}
    labels = LabelsWriter(root, LABELS_3D)
    with ExitStack() as stack:
        lists = {
            split: stack.enter_context((root / name).open("w", encoding="utf-8", newline="\n"))
            for split, name in SPLIT_FILES.items()
        }
        file = stack.enter_context((root / TABLE).open("w", encoding="utf-8", newline=""))
        table = CsvTableWriter(file, (*COLUMNS, *(("verdict",) if everything else ())))
        for match, run in groupby(
            records, key=lambda record: parse_league_season_match(record.group)
        ):
            members = list(run)
            for record in members:
                _add_rows(table, lists, record, everything, counts)
            name = "/".join(match)
            labels.reserve_images(name, (record.group for record in members))
            labels.write(name, _build_match_labels(name, members, everything, boxes))
    return counts


def _add_rows(
    table: CsvTableWriter,
    lists: Mapping[str, TextIO],
    record: ExportRecord,
    everything: bool,
    counts: dict[str, int],
) -> None:
    counts["groups"] += 1
    match = parse_league_season_match(record.group)[2]
    for view in record.group.views:
        fit = record.ball_fit(view, everything)
        verdict = (record.verdict_text,) if everything else ()
        table.add((*_list_row_values(record, view, fit), *verdict))
        counts["views"] += 1
        counts["balls"] += record.has_ball_3d(view)
        if record.split_of_view(view) in lists:
            lists[record.split_of_view(view)].write(f"{match}/{Path(view.key).stem}\n")


def _list_row_values(record: ExportRecord, view: View, fit: BallFit | None) -> Iterator[Value]:
    numbers = parse_image_numbers(view.key)
    assert numbers is not None, "split_key has checked it"
    action, replay = numbers
    camera = record.camera(view)
    box = _find_box_or_point(view)
    yield from parse_league_season_match(record.group)
    yield from (action, replay is None, None if replay is None else float(replay))
    yield from (view.size.width, view.size.height, box is not None)
    yield format_box(box) if box else None
    yield repr(replace_non_finite(camera_to_json(camera))) if camera else None
    yield from _get_view_jac(record, view) or (None,) * len(JAC_NAMES)
    yield f"[array({format_number_list(record.ball_point)})]" if fit and record.ball_point else None
    yield from (fit.error_px, fit.optimized_error_m) if fit else (None, None)
    yield fit.optimized_diameter_px if fit else None
    yield record.split_of_view(view) or None


def _find_box_or_point(view: View) -> Box | None:
    """The annotated box of a view's ball; of a point a box without area."""
    if view.ball is None or view.ball.center is None:
        return None
    x, y = view.ball.center
    return view.ball.box or Box(x, y, 0.0, 0.0)


def format_box(box: Box) -> str:
    """``[x, y, w, h]`` with every digit."""
    return format_number_list((box.x, box.y, box.width, box.height))


def _get_view_jac(record: ExportRecord, view: View) -> tuple[float, ...] | None:
    solved = record.view_solution(view)
    return solved.calibration.jac if solved else None


def _build_match_labels(
    match: str, records: list[ExportRecord], everything: bool, boxes: str
) -> dict[str, Any]:
    labels = labels_to_json(match, [_with_exported_boxes(record, boxes) for record in records])
    for record in records:
        main, *replays = record.group.views
        for view in record.group.views:
            images = labels["actions"] if view is main else labels["replays"]
            images[view.key][IMAGE] |= _collect_computed_fields(record, view, everything)
        calibrated = [view.key for view in replays if record.passes_camera_gates(view)]
        labels["actions"][main.key][IMAGE]["calibrated_replays"] = calibrated
    labels[GAME]["reconstructions"] = [
        record.group.views[0].key
        for record in records
        if sum(map(record.passes_camera_gates, record.group.views)) > 1
    ]
    return labels


def _with_exported_boxes(record: ExportRecord, kind: str) -> Group:
    """The group with the chosen ball box in the views that the 3D ball comes from."""
    group = record.group
    for view in group.views:
        # A view that fell out says nothing about the ball: its fit can lie anywhere.
        if view.ball is None or record.ball_fit(view, everything=False) is None:
            continue
        box = choose_ball_box(record, view, kind)
        if box is not None and box != view.ball.box:
            chosen = replace(view.ball, box=box, point=None)
            balls = tuple(chosen if ball is view.ball else ball for ball in view.balls)
            group = group.with_view(replace(view, balls=balls))
    return group


def _collect_computed_fields(record: ExportRecord, view: View, everything: bool) -> dict[str, Any]:
    """What stands beside the source's own metadata of an image."""
    values: dict[str, Any] = {}
    camera, jac, fit = (
        record.camera(view),
        _get_view_jac(record, view),
        record.ball_fit(view, everything),
    )
    if camera is not None:
        values["calibration"] = camera_to_json(camera)
    if jac is not None:
        values["JaC"] = {name: float(value) for name, value in zip(JAC_NAMES, jac, strict=True)}
    if fit is not None and record.ball_point is not None:
        values["ball_3D"] = [float(value) for value in record.ball_point]
        values["rep_error"] = fit.error_px
        values["optimized_error"] = fit.optimized_error_m
        values["optimized_d"] = fit.optimized_diameter_px
    if everything or record.override is not None:
        values["verdict"] = record.verdict_text
    return values

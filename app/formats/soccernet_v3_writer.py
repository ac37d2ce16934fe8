"""SoccerNet-v3, written: one Labels-v3.json a match."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Any

from app.errors import InputError
from app.formats.frame_names import fold_file_name, frame_path_by_match
from app.formats.safe_path import resolve_inside
from app.formats.soccernet_v3 import (
    GAME,
    JOINED_LISTS,
    LABELS,
    MATCH_DEPTH,
    REST,
    image_numbers,
    record_to_json,
)
from app.json_text import json_text
from app.soccer.group import Group, View


def split_key(group: Group) -> tuple[str, str, str]:
    """League, season and match of a SoccerNet group.

    Raises:
        InputError: The group is from another kind of dataset.
    """
    parts = group.key.split("/")
    if len(parts) != MATCH_DEPTH + 1 or any(
        image_numbers(view.key) is None for view in group.views
    ):
        raise InputError(
            f"group {group.key} is not from SoccerNet (league/season/match/7.png)",
            hint="Export it as cameras, sn-calibration or issia-3d instead.",
        )
    return parts[0], parts[1], parts[2]


def labels_frame_path(group: Group, view: View, split: str, suffix: str) -> str:
    """Where the frame of a view lies in an export: beside the labels of the group's match."""
    beside = replace(group, match="/".join(split_key(group)))
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
    for match, run in groupby(groups, key=lambda group: "/".join(split_key(group))):
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
        other = self._matches.setdefault(fold_file_name(match), match)
        if other != match:
            raise InputError(f"the matches {other} and {match} differ in case only; rename one")
        for group in groups:
            for view in group.views:
                whose = f"{group.key}, {view.key}"
                first = self._images.setdefault((match, image_numbers(view.key)), whose)
                if first != whose:
                    raise InputError(
                        f"the images of two frames ({first} and {whose}) would have one name in"
                        f" match {match}, and SoccerNet's files know one frame by each",
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

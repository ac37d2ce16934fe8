"""SoccerNet-v3: ``<league>/<season>/<match>/{Labels-v3.json, Frames-v3.zip}``."""

from __future__ import annotations

import json
import re
from bisect import bisect_left
from collections.abc import Iterable, Iterator
from contextlib import closing
from dataclasses import replace
from itertools import groupby
from pathlib import Path, PurePosixPath
from typing import Any

from app.datasets.archive import (
    DEFAULT_LIMITS,
    FileTree,
    Limits,
    check_name,
    open_tree,
    resolve_inside,
)
from app.datasets.json_text import read_json
from app.datasets.match_frames import MatchFrames
from app.datasets.report import Report
from app.datasets.soccernet_record import (
    GAME,
    IMAGE,
    REST,
    ImageRecord,
    record_from_json,
    record_to_json,
)
from app.errors import DatasetFormatError, InputError, UnsafePathError
from app.finite import json_text
from app.soccer.group import Group, Station, View

LABELS = "Labels-v3.json"
SPLITS = ("train", "valid", "test", "challenge")
MATCH_DEPTH = 3
"""League, season, match."""

_MATCH_NAME = re.compile(r"\d{4}-\d\d-\d\d - \d\d-\d\d (.{1,80}?) (\d{1,2}) - (\d{1,2}) (.{1,80})")
_GAME_TIME = re.compile(r"\s*(?:(\d)\s*-\s*)?(\d{1,3}:\d\d)\s*")
_IMAGE_NAME = re.compile(r"(\d+)(?:_(\d+))?\.[A-Za-z]+", re.ASCII)
_HALVES = {"1": "first half", "2": "second half", "3": "extra time", "4": "extra time"}
_LISTS = ("list_actions", "list_replays")
JOINED_LISTS = (*_LISTS, "reconstructions")
"""Lists of image names about the whole file, made anew when it is written."""


def read_soccernet_v3(
    root: Path, report: Report, limits: Limits = DEFAULT_LIMITS
) -> Iterator[Group]:
    """The groups of every match below ``root``: each action with its linked replays.

    A group's key is ``<league>/<season>/<match>/7.png``; its views are ``7.png`` (first) and its
    replays. Frames are found in Frames-v3.zip or loose and read later where they are.

    Args:
        root: Dataset folder, or any folder in it down to one match; or a zip of such a tree.
        report: Takes what had to be left out.
        limits: Caps on what is read.
    """
    tree = open_tree(root, report, limits)
    if tree is None:
        return
    with closing(tree):
        names = tree.names()
        folders = [name[: -len(LABELS)] for name in names if PurePosixPath(name).name == LABELS]
        if not folders:
            report.note(str(root), None, None, f"holds no {LABELS}")
        reader = MatchReader(tree, names, report, limits)
        for folder in folders:
            yield from reader.read_match(folder)


class MatchReader:
    """Reads match after match of one tree; ``file`` is the name of the labels in each."""

    def __init__(
        self,
        tree: FileTree,
        names: list[str],
        report: Report,
        limits: Limits,
        file: str = LABELS,
    ):
        self.tree, self.names, self.report, self.limits = tree, names, report, limits
        self.file = file
        self.seen: dict[str, str] = {}

    def read_match(self, folder: str) -> Iterator[Group]:
        """The groups of the labels in one folder (``""``, or with a slash at its end)."""
        path = self.tree.shown(folder + self.file)
        try:
            labels = self._labels(folder, path)
            match = _match_key(self.tree.path, folder, labels.get(GAME))
            if match in self.seen:
                problem = f"is a second file of match {match}; {self.seen[match]} is used"
                raise DatasetFormatError(path, None, None, problem)
        except DatasetFormatError as error:
            self.report.skip(error)
            return
        self.seen[match] = path
        inside = files_inside(self.names, folder)
        frames = MatchFrames(self.tree, folder, inside, self.report, self.limits)
        yield from _Match(match, labels, path, frames, self.report).groups()

    def _labels(self, folder: str, path: str) -> dict[str, Any]:
        content = self.tree.read_bytes(folder + self.file)
        limit = self.limits.file_bytes
        labels = read_json(content, path, double_encoded=True, max_bytes=limit)
        if not isinstance(labels, dict):
            raise DatasetFormatError(path, None, None, "is not an object")
        return labels


def files_inside(names: list[str], folder: str) -> set[str]:
    """Of sorted names, those below a folder, by their name from there on."""
    first = bisect_left(names, folder)
    last = bisect_left(names, folder + chr(0x10FFFF))
    return {name[len(folder) :] for name in names[first:last]}


def _match_key(root: Path, folder: str, game: Any) -> str:
    """``<league>/<season>/<match>`` from the folders, or as far as they go from the metadata."""
    parts = PurePosixPath(folder).parts
    if len(parts) >= MATCH_DEPTH:
        return "/".join(parts[-MATCH_DEPTH:])
    local = game.get("UrlLocal") if isinstance(game, dict) else None
    if isinstance(local, str) and len(_parts(local)) == MATCH_DEPTH:
        return "/".join(_parts(local))
    whole = (*root.resolve().parts[1:], *parts) if root.is_dir() else parts
    return "/".join(whole[-MATCH_DEPTH:]) or root.stem


def _parts(local: str) -> tuple[str, ...]:
    try:
        return PurePosixPath(check_name(local.strip().strip("/"))).parts
    except UnsafePathError:
        return ()


class _Match:
    """One Labels-v3.json on its way to groups."""

    def __init__(
        self, key: str, labels: dict[str, Any], path: str, frames: MatchFrames, report: Report
    ):
        self.key, self.path, self.frames, self.report = key, path, frames, report
        self.actions = self._images(labels, "actions")
        self.replays = self._images(labels, "replays")
        self.game = self._game(labels)
        self.missing: list[str] = []

    def _images(self, labels: dict[str, Any], name: str) -> dict[str, Any]:
        """The records by image name; what is no such mapping is reported and empty."""
        value = labels.get(name, {} if name == "replays" else None)
        if not isinstance(value, dict):
            self.note(None, name, "is missing or not an object")
            return {}
        sound = {}
        for image, record in value.items():
            if _IMAGE_NAME.fullmatch(image):
                sound[image] = record
            else:
                self.note(image[:80], None, "is not an image name such as 7.png or 7_1.png")
        return sound

    def _game(self, labels: dict[str, Any]) -> dict[str, Any]:
        """What else the file says about the game; the lists are made anew when it is written."""
        game = labels.get(GAME)
        rest = {k: v for k, v in labels.items() if k not in (GAME, "actions", "replays")}
        kept = {k: v for k, v in game.items() if k not in _LISTS} if isinstance(game, dict) else {}
        if game is not None and not isinstance(game, dict):
            self.note(None, GAME, "is not an object")
        return {GAME: kept} | ({REST: rest} if rest else {})

    def note(self, record: str | None, where: str | None, problem: str) -> None:
        self.report.note(self.path, record, where, problem)

    def groups(self) -> Iterator[Group]:
        links = self._links()
        for action, record in self.actions.items():
            self.report.read += 1
            group = self._group(action, record, links[action])
            if group is not None:
                self.report.imported += 1
                yield group
        self._note_missing_frames()

    def _links(self) -> dict[str, list[str]]:
        """Replays of each action, in the file's order; each replay once."""
        links: dict[str, list[str]] = {action: [] for action in self.actions}
        owner: dict[str, str] = {}
        for action, record in self.actions.items():
            for replay in self._linked_replays(action, record):
                if replay not in self.replays:
                    self.note(action, "linked_replays", f"names {replay}, which is not there")
                elif replay in owner:
                    where = f"names {replay}, which already belongs to {owner[replay]}"
                    self.note(action, "linked_replays", where)
                else:
                    owner[replay] = action
                    links[action].append(replay)
        for replay, record in self.replays.items():
            if replay not in owner:
                self._adopt(replay, record, links)
        return links

    def _linked_replays(self, action: str, record: Any) -> list[str]:
        value = record.get("linked_replays") if isinstance(record, dict) else None
        if value is None:
            return []
        names = [item for item in value if isinstance(item, str)] if isinstance(value, list) else []
        if not isinstance(value, list) or len(names) < len(value):
            self.note(action, "linked_replays", "is not a list of image names")
        return [name[:80] for name in names]

    def _adopt(self, replay: str, record: Any, links: dict[str, list[str]]) -> None:
        """A replay that no action lists still says itself which action it shows."""
        action = record.get("linked_action") if isinstance(record, dict) else None
        if isinstance(action, str) and action in links:
            links[action].append(replay)
        elif isinstance(action, str):
            self.note(replay, "linked_action", f"names {action[:80]}, which is not there")
        else:
            self.note(replay, "linked_action", "is missing, and no action links this replay")

    def _group(self, action: str, value: Any, replays: list[str]) -> Group | None:
        main = self._record(action, value)
        if main is None:
            return None
        main.extras = replace(main.extras, metadata={**main.extras.metadata, **self.game})
        others = [(replay, self._record(replay, self.replays[replay])) for replay in replays]
        views = [self._view(action, main)]
        views += [self._view(name, record) for name, record in others if record is not None]
        metadata = main.extras.metadata[IMAGE]
        return Group(
            key=f"{self.key}/{action}",
            views=tuple(views),
            match=self.key,
            split=_split(metadata.get("set")),
            label=group_label(self.key, action, metadata),
        )

    def _record(self, image: str, value: Any) -> ImageRecord | None:
        try:
            return record_from_json(value, self.path, image, self.report)
        except DatasetFormatError as error:
            self.report.skip(error)
            return None

    def _view(self, image: str, record: ImageRecord) -> View:
        station = Station(f"{self.key}/{image}", record.size, lines=record.lines)
        media = self.frames.find(image)
        if media is None:
            self.report.counts["views without frame"] += 1
            self.missing.append(image)
        return View(image, station, record.balls, media, extras=record.extras)

    def _note_missing_frames(self) -> None:
        """One sentence a match; labels without any frames are a legitimate dataset."""
        if self.missing and self.frames.some:
            shown = ", ".join(self.missing[:5]) + (", ..." if len(self.missing) > 5 else "")
            count = len(self.missing)
            images = "1 image has" if count == 1 else f"{count} images have"
            self.note(None, None, f"{images} no frame: {shown}")


def _split(value: Any) -> str:
    return value if isinstance(value, str) and value in SPLITS else ""


def group_label(match: str, action: str, metadata: dict[str, Any]) -> str:
    """What people read: teams, score and time of play.

    Example:
        >>> name = "england_epl/2014-2015/2015-02-21 - 18-00 Chelsea 1 - 1 Burnley"
        >>> group_label(name, "7.png", {"gameTime": "1 - 12:41"})
        'Chelsea 1 – 1 Burnley · 12:41 · first half'
    """
    folder = match.rsplit("/", 1)[-1]
    found = _MATCH_NAME.fullmatch(folder)
    teams = f"{found[1]} {found[2]} – {found[3]} {found[4]}" if found else folder
    time = _GAME_TIME.fullmatch(str(metadata.get("gameTime", "")))
    if time is None:
        return f"{teams} · {PurePosixPath(action).stem}"
    half = _HALVES.get(time[1] or str(metadata.get("half", "")).removesuffix(".0"))
    return " · ".join(part for part in (teams, time[2], half) if part)


def image_numbers(image: str) -> tuple[int, int | None] | None:
    """Action and replay number of an image name (``7_1.png``); None for any other name."""
    found = _IMAGE_NAME.fullmatch(image)
    if found is None:
        return None
    return int(found[1]), None if found[2] is None else int(found[2])


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


def write_soccernet_v3(root: Path, groups: Iterable[Group]) -> list[Path]:
    """Write ``<league>/<season>/<match>/Labels-v3.json`` for the groups, match by match.

    What the source held besides lines and balls is written as it came.

    Args:
        root: Existing folder.
        groups: Groups of SoccerNet; one run of a match is in memory at a time.

    Returns:
        The files written.

    Raises:
        InputError: A group is not from SoccerNet.
        UnsafePathError: A key would leave ``root``.
    """
    writer = LabelsWriter(root, LABELS)
    for match, members in groupby(groups, key=lambda group: "/".join(split_key(group))):
        writer.write(match, labels_to_json(match, list(members)))
    return list(writer.written)


class LabelsWriter:
    """Writes one labels file per match; a match that comes again is added to its file."""

    def __init__(self, root: Path, name: str):
        self._root, self._name = root, name
        self.written: dict[Path, None] = {}

    def write(self, match: str, labels: dict[str, Any]) -> None:
        """Write (or add to) the file of a match."""
        path = resolve_inside(self._root, f"{match}/{self._name}")
        if path in self.written:
            labels = _joined(json.loads(path.read_text(encoding="utf-8")), labels)
        path.parent.mkdir(parents=True, exist_ok=True)
        # Without indentation: with it, writing would take ten times as long.
        text = json_text(labels)
        path.write_text(text + "\n", encoding="utf-8")
        self.written[path] = None


def _joined(first: dict[str, Any], second: dict[str, Any]) -> dict[str, Any]:
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

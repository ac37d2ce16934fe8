"""SoccerNet-v3, read: ``<league>/<season>/<match>/{Labels-v3.json, Frames-v3.zip}``."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import PurePosixPath
from typing import Any

from app.errors import DatasetFormatError, UnsafePathError
from app.formats.file_tree import DEFAULT_LIMITS, FileTree, ImportLimits, Root, list_files_in_folder
from app.formats.frame_names import compose_name
from app.formats.json_reader import read_json
from app.formats.report import ReaderReport
from app.formats.safe_path import require_safe_path
from app.formats.soccernet_v3 import (
    GAME,
    IMAGE,
    IMAGE_LISTS,
    IMAGE_NAME,
    LABELS,
    MATCH_DEPTH,
    REST,
    ImageRecord,
    MatchFrameFinder,
    group_label,
    record_from_json,
)
from app.formats.split_names import read_split_name
from app.formats.trees import open_tree_context
from app.soccer.group import Group, Station, View
from app.wording import plural


def read_soccernet_v3(
    root: Root, report: ReaderReport, limits: ImportLimits = DEFAULT_LIMITS
) -> Iterator[Group]:
    """The groups of every match below ``root``: each action with its linked replays.

    A group's key is ``<league>/<season>/<match>/7.png``; its views are ``7.png`` (first) and its
    replays. Frames are found in Frames-v3.zip or loose and read later where they are.

    Args:
        root: Dataset folder, or any folder in it down to one match; or a zip of such a tree.
        report: Takes what had to be left out.
        limits: Caps on what is read.
    """
    with open_tree_context(root, report, limits) as tree:
        if tree is None:
            return
        names = tree.names()
        folders = [name[: -len(LABELS)] for name in names if PurePosixPath(name).name == LABELS]
        if not folders:
            report.add_problem_at(str(root), None, None, f"contains no {LABELS}")
        reader = MatchReader(tree, names, report, limits)
        for folder in folders:
            yield from reader.read_match(folder)


class MatchReader:
    """Reads match after match of one tree; ``file`` is the name of the labels in each."""

    def __init__(
        self,
        tree: FileTree,
        names: list[str],
        report: ReaderReport,
        limits: ImportLimits,
        file: str = LABELS,
    ):
        self.tree, self.names, self.report, self.limits = tree, names, report, limits
        self.file = file
        self.seen: dict[str, str] = {}

    def read_match(self, folder: str) -> Iterator[Group]:
        """The groups of the labels in one folder (``""``, or with a slash at its end)."""
        path = self.tree.shown(folder + self.file)
        try:
            labels = self._read_labels(folder, path)
            match = compose_name(_build_match_key(self.tree.path, folder, labels.get(GAME)))
            if match in self.seen:
                problem = f"is a second file of match {match}; {self.seen[match]} is used"
                raise DatasetFormatError(path, None, None, problem)
        except DatasetFormatError as error:
            self.report.add_problem(error)
            return
        self.seen[match] = path
        inside = list_files_in_folder(self.names, folder)
        frames = MatchFrameFinder(self.tree, folder, inside, self.report)
        yield from _MatchLabelsReader(match, labels, path, frames, self.report).groups()

    def _read_labels(self, folder: str, path: str) -> dict[str, Any]:
        content = self.tree.read_bytes(folder + self.file)
        limit = self.limits.file_bytes
        labels = read_json(content, path, double_encoded=True, max_bytes=limit, report=self.report)
        if not isinstance(labels, dict):
            raise DatasetFormatError(path, None, None, "is not an object")
        return labels


def _build_match_key(root: Root, folder: str, game: Any) -> str:
    """``<league>/<season>/<match>`` from the folders, or as far as they go from the metadata."""
    parts = PurePosixPath(folder).parts
    if len(parts) >= MATCH_DEPTH:
        return "/".join(parts[-MATCH_DEPTH:])
    local = game.get("UrlLocal") if isinstance(game, dict) else None
    if isinstance(local, str) and len(_split_safe_path(local)) == MATCH_DEPTH:
        return "/".join(_split_safe_path(local))
    whole = (*root.resolve().parts[1:], *parts) if root.is_dir() else parts
    return "/".join(whole[-MATCH_DEPTH:]) or root.stem


def _split_safe_path(local: str) -> tuple[str, ...]:
    try:
        return PurePosixPath(require_safe_path(local.strip().strip("/"))).parts
    except UnsafePathError:
        return ()


class _MatchLabelsReader:
    """One Labels-v3.json on its way to groups."""

    def __init__(
        self,
        key: str,
        labels: dict[str, Any],
        path: str,
        frames: MatchFrameFinder,
        report: ReaderReport,
    ):
        self.key, self.path, self.frames, self.report = key, path, frames, report
        self.actions = self._read_image_records(labels, "actions")
        self.replays = self._read_image_records(labels, "replays")
        self.game = self._read_game_fields(labels)
        self.missing: list[str] = []

    def _read_image_records(self, labels: dict[str, Any], name: str) -> dict[str, Any]:
        """The records by image name; what is no such mapping is reported and empty."""
        value = labels.get(name, {} if name == "replays" else None)
        if not isinstance(value, dict):
            self.report_problem(None, name, "is missing or not an object")
            return {}
        sound = {}
        for image, record in value.items():
            if IMAGE_NAME.fullmatch(image):
                sound[image] = record
            else:
                self.report_problem(
                    image[:80], None, "is not an image name such as 7.png or 7_1.png"
                )
        return sound

    def _read_game_fields(self, labels: dict[str, Any]) -> dict[str, Any]:
        """What else the file says about the game; the lists are made anew when it is written."""
        game = labels.get(GAME)
        rest = {k: v for k, v in labels.items() if k not in (GAME, "actions", "replays")}
        kept = (
            {k: v for k, v in game.items() if k not in IMAGE_LISTS}
            if isinstance(game, dict)
            else {}
        )
        if game is not None and not isinstance(game, dict):
            self.report_problem(None, GAME, "is not an object")
        return {GAME: kept} | ({REST: rest} if rest else {})

    def report_problem(self, record: str | None, where: str | None, problem: str) -> None:
        self.report.add_problem_at(self.path, record, where, problem)

    def groups(self) -> Iterator[Group]:
        links = self._replays_by_action()
        for action, record in self.actions.items():
            self.report.read += 1
            group = self._make_group(action, record, links[action])
            if group is not None:
                self.report.imported += 1
                yield group
        self._report_missing_frames()

    def _replays_by_action(self) -> dict[str, list[str]]:
        """Replays of each action, in the file's order; each replay once."""
        links: dict[str, list[str]] = {action: [] for action in self.actions}
        owner: dict[str, str] = {}
        for action, record in self.actions.items():
            for replay in self._find_linked_replays(action, record):
                if replay not in self.replays:
                    self.report_problem(
                        action,
                        "linked_replays",
                        f"names {replay}, which this file does not contain",
                    )
                elif replay in owner:
                    where = f"names {replay}, which already belongs to {owner[replay]}"
                    self.report_problem(action, "linked_replays", where)
                else:
                    owner[replay] = action
                    links[action].append(replay)
        for replay, record in self.replays.items():
            if replay not in owner:
                self._link_unlisted_replay(replay, record, links)
        return links

    def _find_linked_replays(self, action: str, record: Any) -> list[str]:
        value = record.get("linked_replays") if isinstance(record, dict) else None
        if value is None:
            return []
        names = [item for item in value if isinstance(item, str)] if isinstance(value, list) else []
        if not isinstance(value, list) or len(names) < len(value):
            self.report_problem(action, "linked_replays", "is not a list of image names")
        return [name[:80] for name in names]

    def _link_unlisted_replay(self, replay: str, record: Any, links: dict[str, list[str]]) -> None:
        """A replay that no action lists still says itself which action it shows."""
        action = record.get("linked_action") if isinstance(record, dict) else None
        if isinstance(action, str) and action in links:
            links[action].append(replay)
        elif isinstance(action, str):
            self.report_problem(
                replay,
                "linked_action",
                f"names the action {action[:80]}, which this file does not contain",
            )
        else:
            self.report_problem(
                replay, "linked_action", "is missing, and no action links this replay"
            )

    def _make_group(self, action: str, value: Any, replays: list[str]) -> Group | None:
        main = self._read_record(action, value)
        if main is None:
            return None
        main.extras = replace(main.extras, metadata={**main.extras.metadata, **self.game})
        others = [(replay, self._read_record(replay, self.replays[replay])) for replay in replays]
        views = [self._make_view(action, main)]
        views += [self._make_view(name, record) for name, record in others if record is not None]
        metadata = main.extras.metadata[IMAGE]
        return Group(
            key=f"{self.key}/{action}",
            views=tuple(views),
            match=self.key,
            split=self._read_split(metadata.get("set")),
            label=group_label(self.key, action, metadata),
        )

    def _read_split(self, value: Any) -> str:
        return read_split_name(value, self.report) if isinstance(value, str) else ""

    def _read_record(self, image: str, value: Any) -> ImageRecord | None:
        try:
            return record_from_json(value, self.path, image, self.report)
        except DatasetFormatError as error:
            self.report.add_problem(error)
            return None

    def _make_view(self, image: str, record: ImageRecord) -> View:
        station = Station(f"{self.key}/{image}", record.size, lines=record.lines)
        media = self.frames.find_frame(image)
        if media is None:
            self.report.counts["views without frame"] += 1
            self.missing.append(image)
        return View(image, station, record.balls, media, extras=record.extras)

    def _report_missing_frames(self) -> None:
        """One sentence a match; labels without any frames are a legitimate dataset."""
        if self.missing and self.frames.has_frames:
            shown = ", ".join(self.missing[:5]) + (", ..." if len(self.missing) > 5 else "")
            images = plural(len(self.missing), "image has", "images have")
            self.report_problem(None, None, f"{images} no frame file: {shown}")

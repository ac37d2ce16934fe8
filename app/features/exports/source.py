"""What an export writes: groups of a dataset as it is now or of a frozen version, and their images."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import groupby, islice
from pathlib import Path, PurePosixPath
from typing import Any, Protocol

from app.db.json_columns import Json
from app.db.session import Session
from app.errors import (
    ImageError,
    InputError,
    NotFoundError,
    OverloadedError,
    StorageError,
    TooLargeError,
)
from app.features.datasets.service import DatasetHead
from app.features.exports.queries import (
    count_left_out_groups,
    find_newest_entry_time,
    list_exported_groups,
)
from app.features.groups.state import GroupState, VerdictState, read_states
from app.features.groups.view_queries import ViewFileFields, list_view_file_fields
from app.features.versions.membership import (
    describe_frozen_version,
    describe_policy_settings,
    describe_version_settings,
)
from app.features.versions.queries import BATCH, VersionGroup, read_rows
from app.features.versions.service import (
    FrozenGroup,
    Version,
    read_frozen_groups,
    thaw_groups_without_annotations,
)
from app.formats.export_record import ExportRecord
from app.formats.frame_names import (
    FrameName,
    Outline,
    frame_path_by_match,
    identify_frame,
    normalize_file_name,
    with_export_key,
)
from app.formats.safe_path import resolve_inside
from app.media.files import read_media_size_and_crc, read_picture_header
from app.media.frames import EncodedPicture
from app.media.images import ImageHeader, read_header
from app.object_store.path import is_address, split_pinned_address
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Media, Station, View
from app.soccer.policy import Policy
from app.soccer.solution import SOLVER_VERSION

Facts = Mapping[str, Mapping[str, int]]
"""Size and checksum of frames by view, as they were when a version was frozen."""
Item = tuple[ExportRecord, Facts | None]
"""A record, and the facts about its frames where they were frozen with it."""


ReadPicture = Callable[[Media, int | None, bool], EncodedPicture]
"""From where a frame lies, its width (None: as it is) and whether it is mirrored."""
_SUFFIXES = {"image/jpeg": ".jpg", "image/png": ".png", "image/webp": ".webp"}


class ExportSource(Protocol):
    """What an export reads."""

    @property
    def dataset(self) -> str:
        """Name of the dataset."""

    @property
    def count(self) -> int:
        """Number of groups."""

    @property
    def date(self) -> str:
        """The date that the manifest gives."""

    @property
    def version(self) -> str | None:
        """Name of the version, or None for the dataset as it is."""

    @property
    def licence(self) -> str | None:
        """Licence text, where there is one of its own."""

    @property
    def policy(self) -> Policy:
        """The policy that judges it."""

    def settings(self) -> dict[str, Any]:
        """The settings that determined the content, for the manifest."""

    def stamp(self) -> dict[str, Json]:
        """Further values of the source for the manifest."""

    def items(self) -> Iterator[Item]:
        """Its groups, streamed."""

    def outlines(self) -> Iterator[Outline]:
        """The same groups with what names their files."""


class LiveSource:
    """The accepted groups of a dataset, or all of them, in a session's snapshot.

    Args:
        session: Any session.
        dataset: The dataset.
        everything: All of them.
        unless_rejected: Also those that nobody accepted; what is rejected, its reader leaves out.
    """

    version = None
    licence = None
    tracks: Mapping[str, str] | None = None

    def __init__(
        self,
        session: Session,
        dataset: DatasetHead,
        everything: bool,
        unless_rejected: bool = False,
    ):
        self._session, self._found, self._everything = session, dataset, everything
        self._groups = "all" if everything else "not rejected" if unless_rejected else "accepted"
        everything = everything or unless_rejected
        self._ids = list_exported_groups(session, dataset.id, everything)
        self.dataset, self.count = dataset.name, len(self._ids)
        self.dataset_id, self.policy = dataset.id, dataset.policy
        self.left_out = {} if everything else count_left_out_groups(session, dataset.id)

    @property
    def date(self) -> str:
        """Time of the newest thing that was said about the dataset; freezing it says nothing."""
        return str(find_newest_entry_time(self._session, self._found.id))

    def settings(self) -> dict[str, Any]:
        """Policy, solver, and which groups."""
        return {
            **describe_policy_settings(self._found.policy, SOLVER_VERSION),
            "groups": self._groups,
        }

    def stamp(self) -> dict[str, Json]:
        """Nothing: the records say everything."""
        return {}

    def items(self) -> Iterator[Item]:
        """Groups in the order of the dataset."""
        for start in range(0, self.count, BATCH):
            ids = self._ids[start : start + BATCH]
            for state in read_states(self._session, ids, markings=False):
                yield _build_current_record(state), None

    def outlines(self) -> Iterator[Outline]:
        """The same groups with what names their files."""
        for start in range(0, self.count, BATCH):
            views = list_view_file_fields(self._session, self._ids[start : start + BATCH])
            for _, run in groupby(views, key=lambda view: view.group_id):
                yield _make_bare_group(list(run)), {}

    def require_any_group(self) -> None:
        """Raise InputError where there is nothing to export."""
        if not self.count:
            raise _nothing_to_export_error(self._found, self.left_out, self._groups != "accepted")


class VersionSource:
    """The groups of a frozen version, as they were."""

    def __init__(self, session: Session, version: Version):
        self._session, self._version = session, version
        self.dataset, self.version = version.dataset, version.name
        self.dataset_id, self.policy = version.dataset_id, version.policy
        self.tracks = version.tracks
        self.date, self.licence = version.created, version.licence or None
        self.count = int(version.counts["groups"])

    def settings(self) -> dict[str, Any]:
        """Policy and solver as they were frozen, and which groups."""
        return describe_version_settings(self._version)

    def stamp(self) -> dict[str, Json]:
        """Hash, note, counts and changelog, and who is not in it and why."""
        return describe_frozen_version(self._session, self._version)

    def items(self) -> Iterator[Item]:
        """Groups by match and key."""
        batch: list[VersionGroup] = []
        for row in read_rows(self._session, self._version.id, members=True):
            batch.append(row)
            if len(batch) == BATCH:
                yield from self._build_frozen_items(batch)
                batch = []
        yield from self._build_frozen_items(batch)

    def outlines(self) -> Iterator[Outline]:
        """The same groups with what names their files."""
        rows = read_rows(self._session, self._version.id, members=True)
        while batch := list(islice(rows, BATCH)):
            groups = thaw_groups_without_annotations(self._session, self._version, batch)
            for row, group in zip(batch, groups, strict=True):
                yield replace(group, split=row.split), row.splits or {}

    def _build_frozen_items(self, rows: list[VersionGroup]) -> Iterator[Item]:
        for item in read_frozen_groups(self._session, self._version, rows):
            frames = item.row.frames or {}
            facts = {key: frame["facts"] for key, frame in frames.items() if "facts" in frame}
            yield make_export_record_of_frozen_group(item), facts


def make_export_record_of_frozen_group(item: FrozenGroup) -> ExportRecord:
    """A group of a version as writers get it."""
    verdict = item.row.verdict or {"state": "unreviewed", "reason": None}
    return ExportRecord(
        group=replace(item.group, split=item.row.split),
        solution=item.solution,
        verdict=verdict["state"],
        reason=describe_verdict_reason(
            verdict["state"],
            verdict["reason"],
            verdict.get("note"),
            verdict.get("override"),
        ),
        override=verdict.get("override"),
        splits=item.row.splits or {},
    )


def _make_bare_group(views: list[ViewFileFields]) -> Group:
    """A group of views without lines and balls."""
    first = views[0]
    return Group(
        first.group, tuple(_make_bare_view(item) for item in views), first.match, split=first.split
    )


def _make_bare_view(item: ViewFileFields) -> View:
    size = ImageSize(item.width, item.height)
    station = Station(item.station, size, shared=item.shared, flipped=item.flipped)
    return View(item.key, station, media=item.media)


def _build_current_record(state: GroupState) -> ExportRecord:
    verdict, solution = state.verdict, state.solution
    # A group that passes overrides nothing, whatever failed when it was accepted.
    override = None if solution is not None and solution.passes else verdict.override
    return ExportRecord(
        group=state.group,
        solution=solution,
        verdict=_format_verdict(verdict),
        reason=describe_verdict_reason(verdict.state, verdict.reason, verdict.note, override),
        override=override,
    )


def _format_verdict(verdict: VerdictState) -> str:
    """The verdict; an accepted group that changed since says so, as it is not accepted now."""
    stale = verdict.stale and verdict.state == "accepted"
    return f"{verdict.state} (stale)" if stale else verdict.state


def describe_verdict_reason(
    state: str, reason: str | None, note: str | None, override: str | None
) -> str | None:
    """Why it was rejected, or why it was accepted against a gate."""
    if state == "rejected":
        return f"{reason}: {note}" if note else reason
    if override is not None:
        return f"overrides {override}: {note}"
    return None


def _nothing_to_export_error(
    dataset: DatasetHead, left_out: Mapping[str, int], everything: bool
) -> InputError:
    if everything:
        return InputError(
            f'dataset "{dataset.name}" contains no groups, so there is nothing to export'
        )
    if left_out:
        reasons = ", ".join(f"{count} {reason}" for reason, count in left_out.items())
        return InputError(f'no accepted group of "{dataset.name}" can be exported ({reasons})')
    return InputError(
        f'no group has been accepted in "{dataset.name}" yet, so there is nothing to export'
    )


@dataclass(frozen=True)
class _PlacedPicture:
    """A picture that was placed: its path in the export, its frame, its group and view."""

    path: str
    frame: Hashable
    whose: str


class ExportImageWriter:
    """Puts the frames of groups into an export.

    Attributes:
        media: Size and checksum of each frame, for the manifest.
        missing: Frames that could not be had, with the reason.
        placed: Where the frames of the newest group are, by view; relative to the export.
        unchecked: How many frames were placed of which nothing was known when they were frozen.
        other_size: How many frames were placed whose size is not that of their annotations.
    """

    def __init__(
        self, root: Path, images: str, read: ReadPicture, layout: FrameName = frame_path_by_match
    ):
        self.media: list[Mapping[str, Any]] = []
        self.missing: list[str] = []
        self.placed: dict[str, str] = {}
        self.unchecked = 0
        self.other_size = 0
        self._root, self._images, self._read = root, images, read
        self._layout = layout
        self._splits: Mapping[str, str] = {}
        self._names: Mapping[str, str] = {}
        self._written: dict[str, _PlacedPicture] = {}

    def add(
        self,
        group: Group,
        frozen: Mapping[str, Mapping[str, int]] | None = None,
        splits: Mapping[str, str] | None = None,
        names: Mapping[str, str] | None = None,
    ) -> None:
        """Note the frames of a group, and place them when images are asked for.

        Args:
            group: The group.
            frozen: What was known of its frames when it was frozen, by view; another frame than
                that is missing.
            splits: Split by view, where views of one group are split.
            names: Keys by which views are called, where not by their own (``ExportKeyAssigner``).
        """
        self.placed, self._splits, self._names = {}, splits or {}, names or {}
        for view in group.views:
            if view.media is None:
                self._note_missing(group, view, "no picture came with it")
            else:
                then = None if frozen is None else frozen.get(view.key, {})
                self._add_view(group, view, view.media, then)

    def _add_view(
        self, group: Group, view: View, media: Media, frozen: Mapping[str, int] | None
    ) -> None:
        facts = read_media_size_and_crc(media) if frozen is None else frozen
        if facts:
            self.media.append({"group": group.key, "view": view.key, **facts})
        elif is_address(media.path):
            _, kind, value = split_pinned_address(media.path)
            self.media.append(
                {"group": group.key, "view": view.key, **({kind: value} if kind else {})}
            )
        if self._images == "none":
            return
        if frozen and frozen != read_media_size_and_crc(media, whole="crc32" in frozen):
            self._note_missing(group, view, "not the file that was frozen")
            return
        try:
            self._place_picture(group, view, media)
        except (NotFoundError, ImageError, TooLargeError, StorageError, OverloadedError) as error:
            self._note_missing(group, view, error.message)
            return
        # The address of a frame in an object store says which it is.
        self.unchecked += frozen is not None and not frozen and not is_address(media.path)

    @property
    def present_count(self) -> int:
        """How many pictures lie in the export, looked up there."""
        return sum((self._root / item.path).is_file() for item in self._written.values())

    def _note_missing(self, group: Group, view: View, why: str) -> None:
        """Name a frame that was wanted and cannot be had."""
        if self._images != "none":
            self.missing.append(f"{group.key}, {view.key}: {why}")

    def _place_picture(self, group: Group, view: View, media: Media) -> None:
        is_file = media.member is None and media.frame is None and not is_address(media.path)
        if self._images == "link" and is_file and self._can_link_to_file(view, media):
            if not Path(media.path).is_file():
                raise NotFoundError(f"the image file {PurePosixPath(media.path).name} is missing")
            target = self._prepare_picture_path(
                group, view, PurePosixPath(media.path).suffix.lower()
            )
            if target is not None:
                target.symlink_to(media.path)
                self._note_size(view, read_picture_header(media))
            return
        picture = self._read_picture(media, view.station.flipped)
        target = self._prepare_picture_path(group, view, _SUFFIXES[picture.kind])
        if target is not None:
            target.write_bytes(picture.data)
            with suppress(ImageError):
                self._note_size(view, read_header(picture.data))

    def _read_picture(self, media: Media, flipped: bool) -> EncodedPicture:
        """A picture; once more where the machine ended the process that made it."""
        try:
            return self._read(media, None, flipped)
        except OverloadedError:
            # Where it ends again the picture may be the reason: the others are exported.
            return self._read(media, None, flipped)

    def _note_size(self, view: View, header: ImageHeader | None) -> None:
        size = None if header is None else ImageSize(header.width, header.height)
        self.other_size += size is not None and size != view.size

    def _can_link_to_file(self, view: View, media: Media) -> bool:
        """Whether a link to its file shows a frame as it was annotated: a mirrored picture is
        turned right, and one that EXIF turns would lie on its side where EXIF is not read."""
        header = read_picture_header(media)
        return not view.station.flipped and (header is None or header.orientation == 1)

    def _prepare_picture_path(self, group: Group, view: View, suffix: str) -> Path | None:
        """Where a frame goes, in folders that are there; None where it lies there already.

        Raises:
            InputError: Another frame has its name.
        """
        called = with_export_key(view, self._names.get(view.key))
        path = self._layout(group, called, self._splits.get(view.key, group.split), suffix)
        whose = f"{group.key}, {view.key}"
        first = self._written.get(normalize_file_name(path))
        if first is not None and (first.frame, first.path) != (identify_frame(group, view), path):
            raise InputError(
                f"the pictures of two frames ({first.whose} and {whose}) would both be called {path}",
                hint="Export without pictures, or rename one of the views in the source.",
            )
        self.placed[view.key] = path
        if first is not None:
            return None
        target = resolve_inside(self._root, path)
        self._written[normalize_file_name(path)] = _PlacedPicture(
            path, identify_frame(group, view), whose
        )
        target.parent.mkdir(parents=True, exist_ok=True)
        return target

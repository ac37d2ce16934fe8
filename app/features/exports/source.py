"""Where an export comes from: a dataset as it is now, or a frozen version of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import groupby, islice
from typing import Any, Protocol

from app.db.json_columns import Json
from app.db.session import Session
from app.errors import InputError
from app.features.datasets.service import DatasetHead
from app.features.exports.queries import exported_groups, left_out_groups, newest_entry_time
from app.features.groups.state import GroupState, VerdictState, read_states
from app.features.groups.view_queries import ViewFileFields, view_file_fields
from app.features.versions.membership import policy_settings, version_settings, version_stamp
from app.features.versions.queries import BATCH, VersionGroup, read_rows
from app.features.versions.service import FrozenGroup, Version, thaw, thaw_outlines
from app.formats.export_record import ExportRecord
from app.formats.frame_names import Outline
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Station, View
from app.soccer.policy import Policy
from app.soccer.solution import SOLVER_VERSION

Facts = Mapping[str, Mapping[str, int]]
"""Size and checksum of frames by view, as they were when a version was frozen."""
Item = tuple[ExportRecord, Facts | None]
"""A record, and the facts about its frames where they were frozen with it."""


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
        """What decided what is in it, for the manifest."""

    def stamp(self) -> dict[str, Json]:
        """What else the manifest says of it."""

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
        self._ids = exported_groups(session, dataset.id, everything)
        self.dataset, self.count = dataset.name, len(self._ids)
        self.dataset_id, self.policy = dataset.id, dataset.policy
        self.left_out = {} if everything else left_out_groups(session, dataset.id)

    @property
    def date(self) -> str:
        """Time of the newest thing that was said about the dataset; freezing it says nothing."""
        return str(newest_entry_time(self._session, self._found.id))

    def settings(self) -> dict[str, Any]:
        """Policy, solver, and which groups."""
        return {**policy_settings(self._found.policy, SOLVER_VERSION), "groups": self._groups}

    def stamp(self) -> dict[str, Json]:
        """Nothing: the records say everything."""
        return {}

    def items(self) -> Iterator[Item]:
        """Groups in the order of the dataset."""
        for start in range(0, self.count, BATCH):
            ids = self._ids[start : start + BATCH]
            for state in read_states(self._session, ids, markings=False):
                yield _live_record(state), None

    def outlines(self) -> Iterator[Outline]:
        """The same groups with what names their files."""
        for start in range(0, self.count, BATCH):
            views = view_file_fields(self._session, self._ids[start : start + BATCH])
            for _, run in groupby(views, key=lambda view: view.group_id):
                yield _outline_of_views(list(run)), {}

    def require_some(self) -> None:
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
        return version_settings(self._version)

    def stamp(self) -> dict[str, Json]:
        """Hash, note, counts and changelog, and who is not in it and why."""
        return version_stamp(self._session, self._version)

    def items(self) -> Iterator[Item]:
        """Groups by match and key."""
        batch: list[VersionGroup] = []
        for row in read_rows(self._session, self._version.id, members=True):
            batch.append(row)
            if len(batch) == BATCH:
                yield from self._thaw_rows(batch)
                batch = []
        yield from self._thaw_rows(batch)

    def outlines(self) -> Iterator[Outline]:
        """The same groups with what names their files."""
        rows = read_rows(self._session, self._version.id, members=True)
        while batch := list(islice(rows, BATCH)):
            groups = thaw_outlines(self._session, self._version, batch)
            for row, group in zip(batch, groups, strict=True):
                yield replace(group, split=row.split), row.splits or {}

    def _thaw_rows(self, rows: list[VersionGroup]) -> Iterator[Item]:
        for item in thaw(self._session, self._version, rows):
            frames = item.row.frames or {}
            facts = {key: frame["facts"] for key, frame in frames.items() if "facts" in frame}
            yield frozen_record(item), facts


def frozen_record(item: FrozenGroup) -> ExportRecord:
    """A group of a version as writers get it."""
    verdict = item.row.verdict or {"state": "unreviewed", "reason": None}
    return ExportRecord(
        group=replace(item.group, split=item.row.split),
        solution=item.solution,
        verdict=verdict["state"],
        reason=verdict_reason(
            verdict["state"],
            verdict["reason"],
            verdict.get("note"),
            verdict.get("override"),
        ),
        override=verdict.get("override"),
        splits=item.row.splits or {},
    )


def _outline_of_views(views: list[ViewFileFields]) -> Group:
    """A group of views without lines and balls."""
    first = views[0]
    return Group(
        first.group, tuple(_bare_view(item) for item in views), first.match, split=first.split
    )


def _bare_view(item: ViewFileFields) -> View:
    size = ImageSize(item.width, item.height)
    station = Station(item.station, size, shared=item.shared, flipped=item.flipped)
    return View(item.key, station, media=item.media)


def _live_record(state: GroupState) -> ExportRecord:
    verdict = state.verdict
    return ExportRecord(
        group=state.group,
        solution=state.solution,
        verdict=_verdict_text(verdict),
        reason=verdict_reason(verdict.state, verdict.reason, verdict.note, verdict.override),
        override=verdict.override,
    )


def _verdict_text(verdict: VerdictState) -> str:
    """The verdict; an accepted group that changed since says so, as it is not accepted now."""
    stale = verdict.stale and verdict.state == "accepted"
    return f"{verdict.state} (stale)" if stale else verdict.state


def verdict_reason(
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
            f'dataset "{dataset.name}" holds no groups, so there is nothing to export'
        )
    if left_out:
        reasons = ", ".join(f"{count} {reason}" for reason, count in left_out.items())
        return InputError(f'no accepted group of "{dataset.name}" can be exported ({reasons})')
    return InputError(
        f'no group has been accepted in "{dataset.name}" yet, so there is nothing to export'
    )

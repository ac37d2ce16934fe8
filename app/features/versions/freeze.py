"""Freeze: a dataset as it is now becomes a version that never changes.

Content goes in first, in short transactions, under keys that follow from it; the rows and the
version's own row come last, in one. Killed anywhere and started again it ends in the same state.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from app.db.json_columns import Json, compress_json
from app.db.log import NewLogEntry, append_entries
from app.db.session import Session, now
from app.db.store import Store
from app.errors import ConflictError, InputError
from app.features.datasets.service import (
    DatasetHead,
    join_licences,
    read_dataset_head,
    require_valid_name,
)
from app.features.findings.queries import (
    GroupDismissals,
    findings_from_rows,
    read_import_findings_and_dismissals,
)
from app.features.groups.queries import read_groups
from app.features.solutions.queries import (
    filter_stored_calibration_keys,
    read_calibration_bodies,
    read_current_solution_bodies,
)
from app.features.tracks.service import collect_accepted_tracks, list_accepted_tracks
from app.features.versions.frozen_queries import (
    CALIBRATION,
    SOLUTION,
    TRACK,
    compress_text,
    decode_frozen_json,
    filter_stored_frozen_keys,
    find_frame_files,
    freeze_annotations,
    insert_frozen,
)
from app.features.versions.membership import RULES, Candidate, read_candidates, require_solved
from app.features.versions.queries import BATCH, has_version, insert_version
from app.features.versions.service import (
    Version,
    collect_calibration_keys,
    find_next_version_name,
    hash_version,
    read_version,
)
from app.formats.manifest import read_software_version
from app.json_text import canonical_json_text, digest_content, quote_text
from app.media.files import read_media_size_and_crc
from app.progress import ReportProgress
from app.soccer.codec import policy_to_json
from app.soccer.finding import Finding
from app.soccer.group import Group, strip_and_check_note
from app.soccer.solution import SOLVER_VERSION
from app.soccer.split import Split, Splitter

MAX_LICENCE = 100_000
NO_SPLIT = "none"
"""What counts call groups and views that are in no split, or in two."""


@dataclass(frozen=True)
class FreezeRequest:
    """What to freeze.

    Attributes:
        name: Of the version; unique in its dataset. None: the next free of v1, v2, ...
        note: What a reader of the list should know.
        licence: Text under which the version is passed on; empty: the terms of its sources.
        groups: ``accepted``: what people accepted and the policy passes, or a person overrode;
            ``passing``: whatever the policy passes, unless a person rejected or deferred it, or its
            ball cannot be used and nobody accepted it in spite of that.
    """

    name: str | None = None
    note: str = ""
    licence: str = ""
    split: Split = field(default_factory=Split)
    groups: str = "accepted"

    def check(self) -> None:
        """Raise InputError where it says something impossible."""
        self.split.check()
        if self.name is not None:
            require_valid_name(self.name, "a version")
        if self.groups not in RULES:
            raise InputError(
                f'groups must be "{RULES[0]}" or "{RULES[1]}", not {quote_text(self.groups)}',
                pointer="/groups",
            )
        strip_and_check_note(self.note)
        if len(self.licence) > MAX_LICENCE:
            raise InputError(f"a licence has at most {MAX_LICENCE} characters", pointer="/licence")


@dataclass(frozen=True)
class FreezePlan:
    """What a freeze would do: how many groups enter, in which split, and why the others do not.

    Attributes:
        splits: How many of the groups would be in each split; ``none``: in no split, or in two.
        left_out: Why the other groups do not enter.
        unsolved: How many of the groups that enter have to be solved first.
        tracks: How many accepted tracks of the ball enter.
        stale_tracks: Names of the accepted ones that do not, for groups have changed since.
        views: How many views of these groups would be in each split; ``none``: in no split.
        unknown_cameras: Test cameras of the split that no view of these groups is from.
    """

    groups: int
    splits: Mapping[str, int]
    left_out: Mapping[str, int]
    unsolved: int
    tracks: int = 0
    stale_tracks: tuple[str, ...] = ()
    views: Mapping[str, int] = field(default_factory=dict)
    unknown_cameras: tuple[str, ...] = ()


def plan_freeze(
    store: Store, dataset: str | int, request: FreezeRequest, *, strict: bool = False
) -> FreezePlan:
    """The plan of ``freeze_dataset``; saves nothing.

    Args:
        store: The database.
        dataset: Name or id.
        request: What would be frozen.
        strict: Refuse what ``freeze_dataset`` would refuse: no group, or groups that are not solved.

    Raises:
        InputError: The request says something impossible, or no view is from a test camera.
        ConflictError: The name is taken.
    """
    request.check()
    with store.read() as session:
        found = read_dataset_head(session, dataset)
        _require_unused_name(session, found, request.name)
        candidates = read_candidates(session, found.id, request.groups)
        tracks = list_accepted_tracks(session, found)
    if strict:
        require_solved(candidates, found.name)
        _require_any_member(found, candidates, request.groups)
    splitter = Splitter.of(request.split, {item.match for item in candidates})
    members = [item for item in candidates if item.why is None]
    cameras = {view for item in members for view in item.views}
    if members:
        _require_view_of_test_camera(request.split, cameras)
    sides, views = Counter[str](), Counter[str]()
    for item in members:
        side = splitter.split_of_group(item.match, item.split, item.views) or NO_SPLIT
        sides[side] += 1
        by_view = splitter.splits_by_view(item.views) or {}
        views.update(by_view.get(view, side) for view in item.views)
    return FreezePlan(
        groups=len(members),
        splits=dict(sorted(sides.items())),
        left_out=_count_reasons(candidates),
        unsolved=sum(item.unsolved for item in candidates),
        tracks=sum(not track.stale for track in tracks),
        stale_tracks=tuple(track.key for track in tracks if track.stale),
        views=dict(sorted(views.items())),
        unknown_cameras=_find_unknown_cameras(request.split, cameras),
    )


def freeze_dataset(
    store: Store,
    dataset: str | int,
    request: FreezeRequest,
    *,
    actor: str,
    progress: ReportProgress | None = None,
) -> Version:
    """Freeze a dataset as it is in one snapshot.

    Args:
        store: The database.
        dataset: Name or id.
        request: Name, note, licence, split, and which groups enter.
        actor: Who freezes.
        progress: Called after each batch; an error that it raises ends the freeze.

    Raises:
        InputError: The request says something impossible, or no group would be in the version.
        ConflictError: The name is taken, or groups that would enter are not solved.
    """
    request.check()
    with store.read() as session:
        found = read_dataset_head(session, dataset)
        _require_unused_name(session, found, request.name)
        candidates = read_candidates(session, found.id, request.groups)
        require_solved(candidates, found.name)
        _require_any_member(found, candidates, request.groups)
        run = _FreezeRun(store, session, found, request, candidates, progress)
        rows = run.freeze_groups()
        run.freeze_tracks()
    values = run.make_version_columns(rows, actor)
    with store.write() as session:
        _require_unused_name(session, found, request.name)
        name = request.name or find_next_version_name(session, found.id)
        return _save_version(session, {**values, "name": name}, rows)


class _FreezeRun:
    """One freeze under way: rows of the version, and content brought into the database."""

    def __init__(
        self,
        store: Store,
        session: Session,
        dataset: DatasetHead,
        request: FreezeRequest,
        candidates: Sequence[Candidate],
        progress: ReportProgress | None,
    ):
        self._store, self._session, self._dataset = store, session, dataset
        self._request, self._candidates, self._progress = request, candidates, progress
        self._splitter = Splitter.of(request.split, {item.match for item in candidates})
        self._views: dict[str, int] = {}
        self._balls: dict[str, int] = {}
        self._cameras: set[str] = set()
        self._tracks: dict[str, str] = {}

    def freeze_groups(self) -> list[dict[str, Any]]:
        """The rows of all groups, in their order; content is frozen on the way."""
        rows: list[dict[str, Any]] = []
        for start in range(0, len(self._candidates), BATCH):
            batch = self._candidates[start : start + BATCH]
            members = self._freeze_members([item.id for item in batch if item.why is None])
            for position, item in enumerate(batch, start):
                member = members.get(item.id, {})
                dismissed = member.pop("dismissed", [])
                rows.append({**_build_version_row(item, position, dismissed), **member})
            if self._progress is not None:
                self._progress(start + len(batch), len(self._candidates))
        _require_view_of_test_camera(self._request.split, self._cameras)
        return rows

    def freeze_tracks(self) -> None:
        """Freeze the tracks that people accepted and whose groups have not changed since, each with all
        that it was computed from."""
        found = collect_accepted_tracks(self._session, self._dataset)
        texts = {stretch: canonical_json_text(value) for stretch, value in found.items()}
        self._tracks = {key: TRACK + digest_content(text.encode()) for key, text in texts.items()}
        self._store_new_content({self._tracks[key]: text for key, text in texts.items()}, {}, set())

    def make_version_columns(self, rows: Sequence[Mapping[str, Any]], actor: str) -> dict[str, Any]:
        """Columns of the version itself."""
        request, dataset = self._request, self._dataset
        return {
            "dataset_id": dataset.id,
            "note": strip_and_check_note(request.note) or "",
            "licence": request.licence.strip() or join_licences(self._collect_matches(rows)),
            "created": now(),
            "actor": actor,
            "hash": hash_version(dataset.policy, SOLVER_VERSION, rows, self._tracks),
            "tracks": canonical_json_text(self._tracks) if self._tracks else None,
            "groups": request.groups,
            "policy": canonical_json_text(policy_to_json(dataset.policy)),
            "policy_hash": dataset.policy.hash,
            "solver_version": SOLVER_VERSION,
            "software_version": read_software_version(),
            "split": canonical_json_text(request.split.to_plain_values()),
            "counts": canonical_json_text(self._make_counts(rows)),
        }

    def _collect_matches(self, rows: Sequence[Mapping[str, Any]]) -> set[str]:
        return {row["match"] for row in rows if row["member"]}

    def _freeze_members(self, ids: Sequence[int]) -> dict[int, dict[str, Any]]:
        """What the rows of members hold besides what every row has."""
        if not ids:
            return {}
        stored = read_groups(self._session, ids)
        solutions = read_current_solution_bodies(self._session, ids, self._dataset.policy.hash)
        noticed, dismissals = read_import_findings_and_dismissals(self._session, ids)
        texts: dict[str, str] = {}
        bodies: dict[str, bytes] = {}
        names: set[str] = set()
        rows = {}
        for number, item in stored.items():
            annotations, body = freeze_annotations(item.group), solutions[number]
            key, solved = SOLUTION + digest_content(body), decode_frozen_json(body)
            texts.update(annotations.texts)
            bodies[key] = body
            names |= collect_calibration_keys(solved)
            rows[number] = self._build_member_columns(item.group, annotations.key, key, solved)
            if number in dismissals:
                own = findings_from_rows(noticed[number], item.inputs_hash)
                found = [*(_finding_from_json(value) for value in solved["findings"]), *own]
                rows[number]["dismissed"] = _select_dismissed_findings(found, dismissals[number])
        self._store_new_content(texts, bodies, names)
        return rows

    def _build_member_columns(
        self, group: Group, annotations: str, solution: str, solved: Json
    ) -> dict[str, Any]:
        views = [view.key for view in group.views]
        splits = self._splitter.splits_by_view(views)
        split = self._splitter.split_of_group(group.match, group.split, views)
        self._cameras.update(views)
        for view in solved["views"]:
            side = (splits or {}).get(view["view"], split) or NO_SPLIT
            self._views[side] = self._views.get(side, 0) + 1
            # As ``soccer.ball_boxes.has_ball_3d``: what every format counts as a ball.
            ball = solved["ball"] is not None and view["included"]
            self._balls[side] = self._balls.get(side, 0) + bool(ball)
        frames = find_frame_files(group, _collect_media_facts_by_view(group))
        return {
            "split": split,
            "splits": None if splits is None else canonical_json_text(splits),
            "said": annotations,
            "solution": solution,
            "ball": canonical_json_text(solved["ball"]["point"]) if solved["ball"] else None,
            "frames": None if frames is None else compress_json(frames),
        }

    def _store_new_content(
        self, texts: Mapping[str, str], bodies: Mapping[str, bytes], names: set[str]
    ) -> None:
        """Bring what is not frozen yet into the database, in a transaction of its own."""
        known = filter_stored_frozen_keys(
            self._session, self._dataset.id, {*texts, *bodies, *names}
        )
        fresh: dict[str, bytes | None] = dict.fromkeys(names - known)
        fresh |= {key: body for key, body in bodies.items() if key not in known}
        fresh |= {key: compress_text(text) for key, text in texts.items() if key not in known}
        if fresh:
            with self._store.write() as session:
                gone = self._read_deleted_calibrations(session, names - known)
                insert_frozen(session, self._dataset.id, {**fresh, **gone})

    def _read_deleted_calibrations(self, session: Session, names: set[str]) -> dict[str, bytes]:
        """Calibrations that somebody deleted since the snapshot, as they are in it."""
        keys = {name.removeprefix(CALIBRATION) for name in names}
        gone = keys - filter_stored_calibration_keys(session, keys)
        bodies = read_calibration_bodies(self._session, gone) if gone else {}
        return {CALIBRATION + key: body for key, body in bodies.items()}

    def _make_counts(self, rows: Sequence[Mapping[str, Any]]) -> Json:
        members = [row for row in rows if row["member"]]
        groups: dict[str, int] = {}
        for row in members:
            side = row["split"] or NO_SPLIT
            groups[side] = groups.get(side, 0) + 1
        splits = {
            side: {
                "groups": groups.get(side, 0),
                "views": self._views.get(side, 0),
                "balls": self._balls.get(side, 0),
            }
            for side in sorted({*groups, *self._views})
        }
        return {
            "groups": len(members),
            "views": sum(self._views.values()),
            "balls": sum(self._balls.values()),
            "overrides": sum(bool(item.overrides_failed_gate) for item in self._candidates),
            "splits": splits,
            "left_out": _count_reasons(self._candidates),
            **({"tracks": len(self._tracks)} if self._tracks else {}),
        }


def _build_version_row(item: Candidate, position: int, dismissed: Json) -> dict[str, Any]:
    """What every row has; that of a member is completed.

    Findings that people dismissed are a part of what they decided; a group without any has the
    verdict, and the version the hash, that it always had.
    """
    verdict = item.verdict
    if dismissed:
        nothing = dict.fromkeys(("reason", "note", "override"))
        verdict = {**({"state": "unreviewed", **nothing} if verdict is None else verdict)}
        verdict["dismissed"] = dismissed
    nothing = dict.fromkeys(("splits", "said", "solution", "ball", "frames"))
    return {
        **nothing,
        "position": position,
        "key": item.key,
        "match": item.match,
        "member": item.why is None,
        "why": item.why,
        "split": item.split,
        "verdict": None if verdict is None else canonical_json_text(verdict),
    }


def _finding_from_json(value: Json) -> Finding:
    """A finding as far as a dismissal asks, from the body of a solution."""
    names = ("kind", "sentence", "view", "marking", "suggested", "number")
    return Finding(**{name: value.get(name) for name in names})


def _select_dismissed_findings(findings: Sequence[Finding], dismissals: GroupDismissals) -> Json:
    """What of a group's findings was dismissed, without people and times."""
    pairs = zip(findings, dismissals.find_dismissals(findings), strict=True)
    return [
        {
            "kind": finding.kind,
            "view": finding.view,
            "marking": finding.marking,
            "suggested": finding.suggested,
            "number": finding.number,
            "note": dismissal.note,
        }
        for finding, dismissal in pairs
        if dismissal is not None
    ]


def _collect_media_facts_by_view(group: Group) -> dict[str, dict[str, int]]:
    return {
        view.key: read_media_size_and_crc(view.media, whole=True)
        for view in group.views
        if view.media is not None
    }


def _count_reasons(candidates: Iterable[Candidate]) -> dict[str, int]:
    counts: dict[str, int] = {}
    for item in candidates:
        if item.why is not None:
            counts[item.why] = counts.get(item.why, 0) + 1
    return dict(sorted(counts.items()))


def _find_unknown_cameras(split: Split, cameras: Container[str]) -> tuple[str, ...]:
    if split.kind != "camera":
        return ()
    return tuple(name for name in split.test_cameras if name not in cameras)


def _require_view_of_test_camera(split: Split, cameras: Container[str]) -> None:
    unknown = _find_unknown_cameras(split, cameras)
    if unknown and unknown == split.test_cameras:
        raise InputError(
            f"no view of the version is from a test camera ({', '.join(unknown)})",
            pointer="/split/test_cameras",
        )


def _require_unused_name(session: Session, dataset: DatasetHead, name: str | None) -> None:
    if name is not None and has_version(session, dataset.id, name):
        raise ConflictError(
            f'"{dataset.name}" has a version "{name}" already',
            hint="A version never changes; choose another name.",
        )


def _require_any_member(dataset: DatasetHead, candidates: Sequence[Candidate], rule: str) -> None:
    if any(item.why is None for item in candidates):
        return
    reasons = ", ".join(f"{count} {reason}" for reason, count in _count_reasons(candidates).items())
    hint = None
    if rule == "accepted":
        hint = "Accept groups first, or freeze with groups=passing what the policy alone passes."
    raise InputError(
        f'no group of "{dataset.name}" can be in the version ({reasons or "it has no groups"})',
        hint=hint,
    )


def _save_version(
    session: Session, values: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]
) -> Version:
    identity = insert_version(session, values, rows)
    body = {"version": identity, "name": values["name"], "hash": values["hash"]}
    entry = NewLogEntry("freeze", values["actor"], values["created"], body, values["dataset_id"])
    append_entries(session, [entry])
    return read_version(session, identity)

"""Version diff: what changed from one frozen version to another, and the changelog from that."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any, Literal

from app.db.json_columns import Json, parse_json_column
from app.db.session import Session
from app.db.store import Store
from app.errors import InputError
from app.features.versions.queries import iterate_version_group_state_rows
from app.features.versions.service import Version, read_version
from app.soccer.codec import policy_to_json
from app.wording import plural

MOST_NAMED = 5
"""Tracks that a sentence names."""
NEW, GONE = "not in the dataset", "no longer in the dataset"


@dataclass(frozen=True)
class MembershipChange:
    """A group that came into the newer version, or that left it; ``why`` it was not in the older one, or is
    not in the newer one."""

    group: str
    why: str


@dataclass(frozen=True)
class BallMove:
    """A 3D ball that lies elsewhere; pitch frame, metres."""

    group: str
    metres: float
    before: tuple[float, float, float]
    after: tuple[float, float, float]


@dataclass(frozen=True)
class ChangedGroup:
    """A group of both versions: ``what`` of annotations, verdict, split and ball is another; of one that is in
    neither, but was judged, its verdict."""

    group: str
    what: tuple[str, ...]


@dataclass(frozen=True)
class ChangedTrack:
    """A track of the ball that was ``added``, ``dropped`` or ``changed``."""

    stretch: str
    what: Literal["added", "dropped", "changed"]


@dataclass(frozen=True)
class ChangedSetting:
    """A value of the policy, the solver or the split that differs."""

    name: str
    before: Json
    after: Json


@dataclass(frozen=True)
class VersionDiff:
    """Everything that differs; groups by match and key, moves by how far."""

    older: Version
    newer: Version
    added: tuple[MembershipChange, ...]
    dropped: tuple[MembershipChange, ...]
    moved: tuple[BallMove, ...]
    changed: tuple[ChangedGroup, ...]
    settings: tuple[ChangedSetting, ...]
    unchanged: int
    tracks: tuple[ChangedTrack, ...] = ()

    def to_values(self, most: int | None = None) -> dict[str, Any]:
        """Everything as plain values; each list with at most so many, all are counted."""
        lists = {
            name: [asdict(item) for item in getattr(self, name)[:most]]
            for name in ("added", "dropped", "moved", "changed", "settings", "tracks")
        }
        counts = {name: len(getattr(self, name)) for name in lists}
        return {
            "older": {"id": self.older.id, "name": self.older.name, "hash": self.older.hash},
            "newer": {"id": self.newer.id, "name": self.newer.name, "hash": self.newer.hash},
            "same": self.older.hash == self.newer.hash,
            "counts": {**counts, "unchanged": self.unchanged},
            "lines": describe_diff(self),
            **lists,
        }


def diff_versions(store: Store, older: int, newer: int) -> VersionDiff:
    """The differences between two versions of the same dataset.

    Raises:
        NotFoundError: There is no such version.
        InputError: They belong to two datasets.
    """
    with store.read() as session:
        return compute_version_diff(
            session, read_version(session, older), read_version(session, newer)
        )


def compute_version_diff(session: Session, older: Version, newer: Version) -> VersionDiff:
    """``diff_versions`` within a session."""
    if older.dataset_id != newer.dataset_id:
        raise InputError("the two versions belong to two datasets", pointer="/against")
    before, after = (
        {row.key: row for row in iterate_version_group_state_rows(session, item.id)}
        for item in (older, newer)
    )
    both = [key for key, row in after.items() if row.member and _is_member(before, key)]
    changes = (_compare_group(before[key], after[key]) for key in both)
    judged = (
        ChangedGroup(key, ("verdict",))
        for key, row in after.items()
        if key in before
        and not (row.member or before[key].member)
        and row.verdict != before[key].verdict
    )
    changed = [*(change for change in changes if change.what), *judged]
    moved = [
        move for key in both if (move := _compute_ball_move(before[key], after[key])) is not None
    ]
    touched = {item.group for item in changed} | {item.group for item in moved}
    return VersionDiff(
        older=older,
        newer=newer,
        added=_find_membership_changes(after, before, NEW),
        dropped=_find_membership_changes(before, after, GONE),
        moved=tuple(sorted(moved, key=lambda item: -item.metres)),
        changed=tuple(changed),
        settings=tuple(_iterate_changed_settings(older, newer)),
        unchanged=len({*both} - touched),
        tracks=_compare_tracks(older.tracks, newer.tracks),
    )


def make_version_changelog(store: Store, version_id: int) -> list[str]:
    """What changed since the version before, in sentences."""
    with store.read() as session:
        return read_changelog(session, read_version(session, version_id))


def read_changelog(session: Session, version: Version) -> list[str]:
    """``make_version_changelog`` within a session."""
    if version.previous is None:
        counts = version.counts
        groups, balls = _format_group_count(counts["groups"]), plural(counts["balls"], "ball")
        return [f"First version: {groups}, {balls} in views."]
    return describe_diff(
        compute_version_diff(session, read_version(session, version.previous), version)
    )


def describe_diff(diff: VersionDiff) -> list[str]:
    """A diff in sentences."""
    lines = [f"Since {diff.older.name}:"]
    for items, verb, when in ((diff.added, "added", "before"), (diff.dropped, "dropped", "now")):
        if items:
            lines.append(
                f"{_format_group_count(len(items))} {verb} ({when}: {_format_reasons(items)})."
            )
    for what, count in sorted(Counter(w for item in diff.changed for w in item.what).items()):
        lines.append(f"{_format_group_count(count)} with {_CHANGES[what]}.")
    if diff.moved:
        metres = [item.metres for item in diff.moved]
        lines.append(
            f"{plural(len(metres), 'ball')} moved, by {median(metres):.3f} m in the median and "
            f"{metres[0]:.3f} m at most."
        )
    for what in ("added", "dropped", "changed"):
        named = [item.stretch for item in diff.tracks if item.what == what]
        if named:
            more = ", …" if len(named) > MOST_NAMED else ""
            names = ", ".join(named[:MOST_NAMED])
            lines.append(f"{plural(len(named), 'track')} of the ball {what} ({names}{more}).")
    lines += [
        f"{item.name}: {_format_setting(item.before)} before, {_format_setting(item.after)} now."
        for item in diff.settings
    ]
    return lines if len(lines) > 1 else [f"Nothing changed since {diff.older.name}."]


_CHANGES = {
    "annotations": "other annotations",
    "verdict": "another verdict",
    "split": "another split",
    "ball": "a 3D ball that is there now or is gone",
}


def _is_member(rows: dict[str, Any], key: str) -> bool:
    return key in rows and bool(rows[key].member)


def _find_membership_changes(
    there: dict[str, Any], elsewhere: dict[str, Any], absent: str
) -> tuple[MembershipChange, ...]:
    """Members of one version that are none of the other."""
    return tuple(
        MembershipChange(key, elsewhere[key].why if key in elsewhere else absent)
        for key, row in there.items()
        if row.member and not _is_member(elsewhere, key)
    )


def _format_setting(value: Any) -> str:
    """A setting as people write it: in words, and by name where it holds several values."""
    if value is None:
        return "not set"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, dict):
        rest = [
            f"{name.replace('_', ' ')} {_format_setting(value[name])}"
            for name in value
            if name != "kind"
        ]
        kind, named = value.get("kind"), ", ".join(rest)
        kind_name = str(kind or "")
        return (f"{kind_name} ({named})" if kind_name and rest else kind_name or named) or "none"
    if isinstance(value, list):
        return ", ".join(map(_format_setting, value)) or "none"
    return str(value)


def _compare_group(before: Any, after: Any) -> ChangedGroup:
    differ = {
        "annotations": before.said != after.said,
        "verdict": before.verdict != after.verdict,
        "split": (before.split, before.splits) != (after.split, after.splits),
        "ball": (before.ball is None) != (after.ball is None),
    }
    return ChangedGroup(after.key, tuple(name for name, differs in differ.items() if differs))


def _compare_tracks(older: Mapping[str, str], newer: Mapping[str, str]) -> tuple[ChangedTrack, ...]:
    found = []
    for key in sorted({*older, *newer}):
        if key not in older:
            found.append(ChangedTrack(key, "added"))
        elif key not in newer:
            found.append(ChangedTrack(key, "dropped"))
        elif older[key] != newer[key]:
            found.append(ChangedTrack(key, "changed"))
    return tuple(found)


def _compute_ball_move(before: Any, after: Any) -> BallMove | None:
    if before.ball is None or after.ball is None or before.ball == after.ball:
        return None
    then, now = _parse_point(before.ball), _parse_point(after.ball)
    return BallMove(after.key, math.dist(then, now), then, now)


def _parse_point(text: str) -> tuple[float, float, float]:
    x, y, z = parse_json_column(text)
    return x, y, z


def _iterate_changed_settings(older: Version, newer: Version) -> Iterable[ChangedSetting]:
    pairs = [
        (
            _flatten_policy(policy_to_json(older.policy)),
            _flatten_policy(policy_to_json(newer.policy)),
        )
    ]
    pairs.append(({"solver": older.solver_version}, {"solver": newer.solver_version}))
    pairs.append(({"groups": older.groups}, {"groups": newer.groups}))
    pairs.append(
        ({"split": older.split.to_plain_values()}, {"split": newer.split.to_plain_values()})
    )
    for before, after in pairs:
        for name in sorted({*before, *after}):
            if before.get(name) != after.get(name):
                yield ChangedSetting(name, before.get(name), after.get(name))


def _flatten_policy(policy: Json) -> dict[str, Json]:
    part = {f"calibration.{name}": value for name, value in policy["calibration"].items()}
    rest = {name: value for name, value in policy.items() if name != "calibration"}
    return {f"policy {name}": value for name, value in {**rest, **part}.items()}


def _format_reasons(items: Sequence[MembershipChange]) -> str:
    counts = Counter(item.why for item in items)
    return ", ".join(f"{count} {why}" for why, count in sorted(counts.items()))


def _format_group_count(count: int) -> str:
    return plural(count, "group")

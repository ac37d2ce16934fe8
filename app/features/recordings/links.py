"""Links: a replay, the live shot that it shows again, and which frame of one is which of the other.

People link instants; from them follows the map of the times, ``live = offset + speed * replay``, both in seconds after
the first frame of their shot.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from app.canonical import canonical, digest_of
from app.config import Settings
from app.db.json_columns import parse
from app.db.session import Session
from app.db.store import Store
from app.errors import ConflictError, InputError, NotFoundError
from app.features.audit.audit_events import add_audit_event
from app.features.groups.state import require_etag
from app.features.recordings.link_queries import (
    delete_link,
    find_link,
    insert_link,
    list_link_rows,
    update_link,
)
from app.features.recordings.service import frame_seconds, need_recording
from app.geometry.arrays import FloatArray
from app.plural import plural
from app.soccer.choices import LinkOutcome, LinkSource
from app.tracking.time_map import TimeMap, map_of_instants

MAX_INSTANTS = 100
"""Of a link; ten make a map as good as it gets."""
MAX_LINKS = 10_000
"""Of a recording."""


@dataclass(frozen=True)
class LinkedShot:
    """One side of a link.

    Attributes:
        recording: Id of its recording.
        name: Name of its recording.
        first, last: Numbers of its frames.
    """

    recording: int
    name: str
    first: int
    last: int

    @property
    def frames(self) -> range:
        """Numbers of its frames."""
        return range(self.first, self.last + 1)


@dataclass(frozen=True)
class Instant:
    """One instant of the match in both shots.

    Attributes:
        live, replay: Frames that show it.
        residual: Live frames by which the map puts the frame of the replay later; None without a map.
    """

    live: int
    replay: int
    residual: float | None = None


@dataclass(frozen=True)
class LinkPiece:
    """A part of a replay that runs at one speed.

    Attributes:
        first, last: Frames of the replay in which it begins and ends.
        first_s, last_s: The same, seconds after the first frame of the replay.
        offset_s, speed: ``live = offset + speed * replay``, seconds after the first frames of the shots.
        speed_sigma: Standard deviation of the speed.
    """

    first: int
    last: int
    first_s: float
    last_s: float
    offset_s: float
    speed: float
    speed_sigma: float


@dataclass(frozen=True)
class LinkMap:
    """Which time of the live shot each time of a replay shows.

    Attributes:
        outcome: ``none``: nothing is known; ``offset``: the speed is assumed; ``linked``: offset and speed are known,
            or those of all pieces; ``unobservable``: they cannot be told.
        found_by: From what: ``instants`` of people, or the ``ball``.
        reason: Why there is no map of one offset and speed.
        offset_s, speed: ``live = offset + speed * replay``, seconds after the first frames of the shots.
        offset_sigma_s, speed_sigma: Their standard deviations.
        sigma_s: Standard deviation of the live time of the middle of the replay, seconds.
        miss_m: Median distance of the ball's rays, where it was found by them.
        pieces: Where the speed changes.
    """

    outcome: LinkOutcome
    found_by: LinkSource | None = None
    reason: str | None = None
    offset_s: float | None = None
    speed: float | None = None
    offset_sigma_s: float | None = None
    speed_sigma: float | None = None
    sigma_s: float | None = None
    miss_m: float | None = None
    pieces: tuple[LinkPiece, ...] = ()

    @property
    def is_usable(self) -> bool:
        """Whether it says a live time for each time of the replay."""
        return self.outcome in ("offset", "linked")

    def live(self, times: FloatArray) -> FloatArray:
        """Live times of times of the replay, seconds after the first frames, shape (N,)."""
        pieces = tuple(
            TimeMap(None, one.offset_s, one.speed, first=one.first_s, last=one.last_s)
            for one in self.pieces
        )
        return TimeMap(None, self.offset_s, self.speed, pieces=pieces).live(times)


@dataclass(frozen=True)
class ShotLink:
    """A link as it stands.

    Attributes:
        live: The live shot.
        replay: The shot that shows it again.
        instants: What people linked, by the frames of the replay.
        assumed_speed: Speed of the replay while one instant is linked; None: that of the live shot.
        map: What follows from them.
    """

    id: int
    dataset_id: int
    live: LinkedShot
    replay: LinkedShot
    instants: tuple[Instant, ...]
    assumed_speed: float | None
    map: LinkMap
    actor: str
    created: str
    etag: str


def list_links(store: Store, recording_id: int) -> list[ShotLink]:
    """The links of a recording, in which it has the live shot or the replay.

    Raises:
        NotFoundError: There is no such recording.
    """
    with store.read() as session:
        need_recording(session, recording_id)
        return [_link(row) for row in list_link_rows(session, recording_id)]


def get_link(store: Store, recording_id: int, link_id: int) -> ShotLink:
    """A link of a recording.

    Raises:
        NotFoundError: The recording has no such link.
    """
    with store.read() as session:
        return _link(need_link(session, recording_id, link_id))


def need_link(session: Session, recording_id: int, link_id: int) -> Any:
    row = find_link(session, link_id)
    if row is None or recording_id not in (row.live_id, row.replay_id):
        raise NotFoundError(f"recording {recording_id} has no link {link_id}")
    return row


def add_link(
    store: Store,
    live: tuple[int, int, int],
    replay: tuple[int, int, int],
    *,
    actor: str,
) -> ShotLink:
    """Link a replay to a live shot, without an instant; the same two again are the same link.

    Args:
        store: The database.
        live: Id of the recording, first and last frame.
        replay: The same of the replay.
        actor: Who links them.

    Raises:
        ConflictError: A recording is not indexed yet.
        InputError: A shot is outside of its recording, both overlap, or they are of two datasets.
        NotFoundError: There is no such recording.
    """
    with store.write() as session:
        sides = [
            _require_shot(session, *side, pointer=f"/{name}")
            for name, side in (("live", live), ("replay", replay))
        ]
        if sides[0].dataset_id != sides[1].dataset_id:
            raise InputError(
                f'"{sides[0].name}" and "{sides[1].name}" are recordings of two datasets',
                hint="Add the recording of the replay to the dataset of the live one.",
                pointer="/replay/recording",
            )
        if live[0] == replay[0] and live[1] <= replay[2] and replay[1] <= live[2]:
            raise InputError(
                f"frames {live[1]} to {live[2]} and {replay[1]} to {replay[2]} overlap: a shot is no "
                "replay of itself",
                pointer="/replay",
            )
        rows = list_link_rows(session, live[0])
        number = next((row.id for row in rows if _sides(row) == (live, replay)), None)
        if number is None:
            if len(rows) >= MAX_LINKS:
                raise InputError(f"a recording has at most {MAX_LINKS:,} links")
            number = insert_link(
                session,
                actor,
                dataset_id=sides[0].dataset_id,
                **{f"live_{name}": value for name, value in zip(_SIDE, live, strict=True)},
                **{f"replay_{name}": value for name, value in zip(_SIDE, replay, strict=True)},
                instants="[]",
                assumed_speed=None,
                map=canonical(asdict(LinkMap("none"))),
            )
            _note(session, actor, "replay linked", find_link(session, number))
        found = _link(find_link(session, number))
        session.respond(found)
    return found


_SIDE = ("id", "first", "last")


def _sides(row: Any) -> tuple[tuple[int, int, int], tuple[int, int, int]]:
    return (row.live_id, row.live_first, row.live_last), (
        row.replay_id,
        row.replay_first,
        row.replay_last,
    )


def _require_shot(session: Session, recording: int, first: int, last: int, pointer: str) -> Any:
    row = need_recording(session, recording)
    if row.facts is None:
        raise ConflictError(
            f'"{row.name}" is not indexed yet', hint="Wait for the job that does it."
        )
    frames = parse(row.facts)["frames"]
    if not first <= last < frames:
        raise InputError(
            f'"{row.name}" has {plural(frames, "frame")}, and no shot from {first} to {last}',
            pointer=pointer,
        )
    return row


def _note(session: Session, actor: str, did: str, row: Any) -> None:
    what = {"link": row.id, "live": row.live_name, "replay": row.replay_name}
    frames = {"live_first": row.live_first, "replay_first": row.replay_first}
    add_audit_event(session, actor, did, row.dataset_id, **what, **frames)


def set_instants(
    store: Store,
    recording_id: int,
    link_id: int,
    instants: Sequence[tuple[int, int]],
    assumed_speed: float | None,
    if_match: str | None,
    *,
    actor: str,
) -> ShotLink:
    """Replace the instants of a link, and find its map from them.

    Args:
        store: The database.
        recording_id: One of its recordings.
        link_id: Which.
        instants: Live frame and frame of the replay of each.
        assumed_speed: Speed of the replay while one instant is linked; None: that of the live shot.
        if_match: ETag of the link that the change builds on; None: whatever it is.
        actor: Who changes it.

    Raises:
        ConflictError: An index is gone, or of an older version.
        InputError: An instant is outside of its shot, or a frame of the replay has two.
        NotFoundError: The recording has no such link.
        StaleRevisionError: Somebody else was faster.
    """
    with store.write() as session:
        row = need_link(session, recording_id, link_id)
        if if_match is not None:
            require_etag(_etag(row), if_match, "this link")
        live, replay = _shots(row)
        pairs = _sound(instants, live, replay)
        made, residuals = _map_of(store.settings, row, pairs, assumed_speed)
        kept = [[*pair, off] for pair, off in zip(pairs, residuals, strict=True)]
        values = {
            "instants": canonical(kept),
            "assumed_speed": assumed_speed,
            "map": canonical(asdict(made)),
        }
        if any(getattr(row, name) != value for name, value in values.items()):
            update_link(session, link_id, **values, revision=row.revision + 1)
            _note(session, actor, "instants linked", row)
        found = _link(find_link(session, link_id))
        session.respond(found)
    return found


def remove_link(store: Store, recording_id: int, link_id: int, *, actor: str) -> None:
    """Remove a link with its instants; groups that were taken of it stay.

    Raises:
        NotFoundError: The recording has no such link.
    """
    with store.write() as session:
        row = need_link(session, recording_id, link_id)
        delete_link(session, link_id)
        _note(session, actor, "link removed", row)
        session.respond(None)


def _sound(
    instants: Sequence[tuple[int, int]], live: LinkedShot, replay: LinkedShot
) -> list[tuple[int, int]]:
    """The instants by the frames of the replay."""
    if len(instants) > MAX_INSTANTS:
        raise InputError(f"a link has at most {MAX_INSTANTS} instants", pointer="/instants")
    for number, (of_live, of_replay) in enumerate(instants):
        for name, frame, shot in (("live", of_live, live), ("replay", of_replay, replay)):
            if frame not in shot.frames:
                raise InputError(
                    f"instant {number + 1} is at frame {frame}; the {name} shot has the frames "
                    f"{shot.first} to {shot.last}",
                    pointer=f"/instants/{number}/{name}",
                )
    pairs = sorted(instants, key=lambda pair: (pair[1], pair[0]))
    for one, other in pairwise(pairs):
        if one[1] == other[1]:
            raise InputError(
                f"frame {one[1]} of the replay is linked twice, to the live frames {one[0]} and "
                f"{other[0]}",
                hint="Remove one of the two.",
                pointer="/instants",
            )
    return pairs


def shot_seconds(settings: Settings, sha256: str | None, shot: LinkedShot) -> FloatArray:
    """When the frames of a shot are shown, seconds after its first one, shape (N,)."""
    if sha256 is None:
        raise ConflictError(f'"{shot.name}" is not indexed yet', hint="Index it again.")
    seconds = frame_seconds(settings, sha256)[shot.first : shot.last + 1]
    return np.asarray(seconds - seconds[0])


def step_of(seconds: FloatArray) -> float:
    """Usual time between two frames, seconds."""
    steps = np.diff(seconds)
    return float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.04


def _map_of(
    settings: Settings,
    row: Any,
    pairs: Sequence[tuple[int, int]],
    assumed_speed: float | None,
) -> tuple[LinkMap, list[float | None]]:
    """The map of instants, and the residual of each in live frames."""
    live, replay = _shots(row)
    times = shot_seconds(settings, row.replay_sha256, replay)
    live_times = shot_seconds(settings, row.live_sha256, live)
    given = np.array(
        [(live_times[one - live.first], times[other - replay.first]) for one, other in pairs]
    ).reshape(-1, 2)
    step = step_of(live_times)
    made = described(
        map_of_instants(given, step, assumed_speed), replay, times, "instants" if pairs else None
    )
    if not made.is_usable:
        return made, [None] * len(pairs)
    return made, ((made.live(given[:, 1]) - given[:, 0]) / step).tolist()


def described(
    made: TimeMap, replay: LinkedShot, times: FloatArray, found_by: LinkSource | None
) -> LinkMap:
    """A map as it is kept and shown.

    Args:
        made: Of seconds after the first frames of the shots.
        replay: The replay.
        times: Of its frames, seconds after its first one, shape (N,).
        found_by: From what it was found.
    """
    frames = np.searchsorted(times, [[one.first, one.last] for one in made.pieces])
    pieces = tuple(
        LinkPiece(
            replay.first + int(ends[0]),
            min(replay.first + int(ends[1]), replay.last),
            one.first,
            one.last,
            float(one.offset or 0.0),
            float(one.speed or 0.0),
            _sigma(one)[1] or 0.0,
        )
        for one, ends in zip(made.pieces, frames, strict=True)
    )
    outcome: LinkOutcome = "linked"
    if made.reason is not None and not pieces:
        known = made.by_hand and made.offset is not None
        outcome = "offset" if known else "none" if found_by is None else "unobservable"
    if outcome in ("none", "unobservable"):
        return LinkMap(outcome, found_by, made.reason, miss_m=made.miss)
    whole = not pieces
    return LinkMap(
        outcome,
        found_by,
        made.reason,
        made.offset if whole else None,
        made.speed if whole else None,
        *(_sigma(made) if whole else (None, None)),
        made.sigma_at(float(times[-1]) / 2) if whole else None,
        made.miss,
        pieces,
    )


def _sigma(made: TimeMap) -> tuple[float | None, float | None]:
    if made.covariance is None:
        return None, None
    offset, speed = np.sqrt(np.maximum(made.covariance.diagonal(), 0.0)).tolist()
    return offset, speed


def _shots(row: Any) -> tuple[LinkedShot, LinkedShot]:
    return (
        LinkedShot(row.live_id, row.live_name, row.live_first, row.live_last),
        LinkedShot(row.replay_id, row.replay_name, row.replay_first, row.replay_last),
    )


def _etag(row: Any) -> str:
    content = f"{row.instants} {row.assumed_speed} {row.map}"
    return f'"{row.revision}-{digest_of(content.encode())[:12]}"'


def _link(row: Any) -> ShotLink:
    live, replay = _shots(row)
    stored = parse(row.map)
    made = LinkMap(**{**stored, "pieces": tuple(LinkPiece(**one) for one in stored["pieces"])})
    return ShotLink(
        id=int(row.id),
        dataset_id=int(row.dataset_id),
        live=live,
        replay=replay,
        instants=tuple(Instant(*one) for one in parse(row.instants)),
        assumed_speed=row.assumed_speed,
        map=made,
        actor=row.actor,
        created=row.created,
        etag=_etag(row),
    )

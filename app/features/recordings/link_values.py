"""What a link is: its two shots, its instants, and the map of their times, as they are kept and shown."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from app.db.json_columns import parse_json_column
from app.formats.csv_text import format_csv_line
from app.geometry.arrays import FloatArray
from app.json_text import digest_content
from app.soccer.choices import LinkOutcome, LinkSource
from app.tracking.time_map import TimeMap


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
class ConstantSpeedPiece:
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
class RayMiss:
    """How far a ray of the ball misses those of the live shot.

    Attributes:
        frame: Of the replay.
        miss_m: Metres.
    """

    frame: int
    miss_m: float


@dataclass(frozen=True)
class LinkTimeMap:
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
        misses: Of the ball's rays, by frame of the replay.
        ball_reason: Why the ball did not tell the times, where instants do.
        turned: Whether the ball's rays would meet once the cameras of the replay are turned by half a turn of the pitch.
        too_close: Whether several instants are too close together to tell the speed, which is assumed.
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
    pieces: tuple[ConstantSpeedPiece, ...] = ()
    misses: tuple[RayMiss, ...] = ()
    ball_reason: str | None = None
    turned: bool = False
    too_close: bool = False

    @property
    def is_usable(self) -> bool:
        """Whether it says a live time for each time of the replay."""
        return self.outcome in ("offset", "linked")

    def to_live_times(self, times: FloatArray) -> FloatArray:
        """Live times of times of the replay, seconds after the first frames, shape (N,)."""
        pieces = tuple(
            TimeMap(None, one.offset_s, one.speed, first=one.first_s, last=one.last_s)
            for one in self.pieces
        )
        return TimeMap(None, self.offset_s, self.speed, pieces=pieces).to_live_times(times)

    def sigma_at(self, time: float, last: float) -> float | None:
        """Standard deviation of the live time of a time of the replay, seconds; None where it is not known.

        Args:
            time, last: Of a frame and of the last frame of the replay, seconds after its first one.
        """
        offset, speed, at_middle = self.offset_sigma_s, self.speed_sigma, self.sigma_s
        if offset is None or speed is None or at_middle is None or last <= 0:
            return at_middle
        middle = last / 2
        both = (at_middle**2 - offset**2 - (speed * middle) ** 2) / (2 * middle)
        return float(np.sqrt(max(offset**2 + 2 * both * time + (speed * time) ** 2, 0.0)))


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
    map: LinkTimeMap
    actor: str
    created: str
    etag: str


def format_links_csv(found: Iterable[ShotLink]) -> str:
    """Links as CSV: a row for each, or for each piece of one whose speed changes."""
    columns = (
        *("link", "live", "live_first", "live_last", "replay", "replay_first", "replay_last"),
        *("outcome", "found_by", "first", "last", "offset_s", "speed", "offset_sigma_s"),
        *("speed_sigma", "instants"),
    )
    lines = [format_csv_line(columns)]
    for one in found:
        live, replay, how = one.live, one.replay, one.map
        head = (one.id, live.name, live.first, live.last, replay.name, replay.first, replay.last)
        pieces: list[tuple[int | float | None, ...]] = [
            (piece.first, piece.last, piece.offset_s, piece.speed, None, piece.speed_sigma)
            for piece in how.pieces
        ]
        whole = (replay.first, replay.last, how.offset_s, how.speed)
        for piece in pieces or [(*whole, how.offset_sigma_s, how.speed_sigma)]:
            lines.append(
                format_csv_line((*head, how.outcome, how.found_by, *piece, len(one.instants)))
            )
    return "".join(lines)


def make_link_time_map(
    made: TimeMap, replay: LinkedShot, times: FloatArray, found_by: LinkSource | None
) -> LinkTimeMap:
    """A map as it is kept and shown.

    Args:
        made: Of seconds after the first frames of the shots.
        replay: The replay.
        times: Of its frames, seconds after its first one, shape (N,).
        found_by: From what it was found.
    """
    frames = np.searchsorted(times, [[one.first, one.last] for one in made.pieces])
    pieces = tuple(
        ConstantSpeedPiece(
            replay.first + int(ends[0]),
            min(replay.first + int(ends[1]), replay.last),
            one.first,
            one.last,
            float(one.offset or 0.0),
            float(one.speed or 0.0),
            _compute_offset_speed_sigma(one)[1] or 0.0,
        )
        for one, ends in zip(made.pieces, frames, strict=True)
    )
    outcome: LinkOutcome = "linked"
    if made.reason is not None and not pieces:
        known = made.by_hand and made.offset is not None
        outcome = "offset" if known else "none" if found_by is None else "unobservable"
    if outcome in ("none", "unobservable"):
        return LinkTimeMap(outcome, found_by, made.reason, miss_m=made.miss)
    whole = not pieces
    return LinkTimeMap(
        outcome,
        found_by,
        made.reason,
        made.offset if whole else None,
        made.speed if whole else None,
        *(_compute_offset_speed_sigma(made) if whole else (None, None)),
        made.sigma_at(float(times[-1]) / 2) if whole else None,
        made.miss,
        pieces,
        too_close=made.too_close,
    )


def _compute_offset_speed_sigma(made: TimeMap) -> tuple[float | None, float | None]:
    if made.covariance is None:
        return None, None
    offset, speed = np.sqrt(np.maximum(made.covariance.diagonal(), 0.0)).tolist()
    return offset, speed


def parse_linked_shots(row: Any) -> tuple[LinkedShot, LinkedShot]:
    """The live shot and the replay of the row of a link."""
    return (
        LinkedShot(row.live_id, row.live_name, row.live_first, row.live_last),
        LinkedShot(row.replay_id, row.replay_name, row.replay_first, row.replay_last),
    )


def make_link_etag(row: Any) -> str:
    """The ETag of the row of a link."""
    content = f"{row.instants} {row.assumed_speed} {row.map}"
    return f'"{row.revision}-{digest_content(content.encode())[:12]}"'


def build_link_from_row(row: Any) -> ShotLink:
    """The link of a row."""
    live, replay = parse_linked_shots(row)
    stored, instants = (
        parse_json_column(row.map),
        tuple(Instant(*one) for one in parse_json_column(row.instants)),
    )
    # Maps of earlier versions do not say it.
    stored.setdefault("too_close", stored["outcome"] == "offset" and len(instants) > 1)
    parts = {
        "pieces": tuple(ConstantSpeedPiece(**one) for one in stored["pieces"]),
        "misses": tuple(RayMiss(**one) for one in stored.get("misses", ())),
    }
    made = LinkTimeMap(**{**stored, **parts})
    return ShotLink(
        id=int(row.id),
        dataset_id=int(row.dataset_id),
        live=live,
        replay=replay,
        instants=instants,
        assumed_speed=row.assumed_speed,
        map=made,
        actor=row.actor,
        created=row.created,
        etag=make_link_etag(row),
    )

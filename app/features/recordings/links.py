"""Links: a replay, the live shot that it shows again, and which frame of one is which of the other.

People link instants; from them follows the map of the times, ``live = offset + speed * replay``, both in seconds after
the first frame of their shot.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from itertools import pairwise
from typing import Any

import numpy as np

from app.config import Settings
from app.db.session import Session
from app.db.store import Store
from app.errors import ConflictError, InputError, NotFoundError
from app.features.audit.service import add_audit_event
from app.features.groups.state import require_etag
from app.features.recordings.index import read_frame_times
from app.features.recordings.link_values import (
    LinkedShot,
    LinkTimeMap,
    ShotLink,
    build_link_from_row,
    make_link_etag,
    make_link_time_map,
    parse_linked_shots,
)
from app.features.recordings.queries import (
    RecordingRow,
    delete_link,
    find_link,
    insert_link,
    list_link_rows,
    update_link,
)
from app.features.recordings.service import build_recording_from_row, require_recording
from app.geometry.arrays import FloatArray
from app.json_text import canonical_json_text
from app.tracking.time_map import fit_map_to_instants
from app.wording import plural

MAX_INSTANTS = 100
"""Of a link; ten make a map as good as it gets."""
MAX_LINKS = 10_000
"""Of a recording."""


def list_links(store: Store, recording_id: int) -> list[ShotLink]:
    """The links whose live shot or replay lies in a recording.

    Raises:
        NotFoundError: There is no such recording.
    """
    with store.read() as session:
        require_recording(session, recording_id)
        return [build_link_from_row(row) for row in list_link_rows(session, recording_id)]


def get_link(store: Store, recording_id: int, link_id: int) -> ShotLink:
    """A link of a recording.

    Raises:
        NotFoundError: The recording has no such link.
    """
    with store.read() as session:
        return build_link_from_row(require_link(session, recording_id, link_id))


def require_link(session: Session, recording_id: int, link_id: int) -> Any:
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
            _require_shot(session, store.settings, *side, pointer=f"/{name}")
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
                f"frames {live[1]} to {live[2]} and {replay[1]} to {replay[2]} overlap: a shot"
                " cannot be the replay of itself",
                pointer="/replay",
            )
        rows = list_link_rows(session, live[0])
        number = next(
            (row.id for row in rows if _get_live_and_replay_frames(row) == (live, replay)), None
        )
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
                map=canonical_json_text(asdict(LinkTimeMap("none"))),
            )
            log_link_event(session, actor, "replay linked", find_link(session, number))
        found = build_link_from_row(find_link(session, number))
        session.respond(found)
    return found


_SIDE = ("id", "first", "last")


def _get_live_and_replay_frames(row: Any) -> tuple[tuple[int, int, int], tuple[int, int, int]]:
    return (row.live_id, row.live_first, row.live_last), (
        row.replay_id,
        row.replay_first,
        row.replay_last,
    )


def _require_shot(
    session: Session, settings: Settings, recording: int, first: int, last: int, pointer: str
) -> RecordingRow:
    row = require_recording(session, recording)
    found = build_recording_from_row(row, settings)
    if found.frames is None:
        found.require_readable()
    frames = found.frames or 0
    if not first <= last < frames:
        raise InputError(
            f'"{row.name}" has {plural(frames, "frame")}, so it has no shot from frame {first}'
            f" to frame {last}",
            pointer=pointer,
        )
    return row


def log_link_event(session: Session, actor: str, did: str, row: Any) -> None:
    """Write into the log what somebody did to a link."""
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
        StaleRevisionError: It was changed meanwhile.
    """
    with store.read() as session:
        seen = require_link(session, recording_id, link_id)
    if if_match is not None:
        require_etag(make_link_etag(seen), if_match, "this link")
    # The map takes a while: others write meanwhile. It depends on the shots alone, which stay as they are.
    pairs = _validate_instants(instants, *parse_linked_shots(seen))
    made, residuals = _compute_link_time_map(store.settings, seen, pairs, assumed_speed)
    with store.write() as session:
        row = require_link(session, recording_id, link_id)
        if if_match is not None:
            require_etag(make_link_etag(row), if_match, "this link")
        if (row.live_sha256, row.replay_sha256) != (seen.live_sha256, seen.replay_sha256):
            raise ConflictError(
                "the file of a recording has changed since then", hint="Link the shots again."
            )
        if save_link_time_map(session, row, pairs, made, residuals, assumed_speed=assumed_speed):
            log_link_event(session, actor, "instants linked", row)
        found = build_link_from_row(find_link(session, link_id))
        session.respond(found)
    return found


def save_link_time_map(
    session: Session,
    row: Any,
    pairs: Sequence[tuple[int, int]],
    made: LinkTimeMap,
    residuals: Sequence[float | None],
    **more: Any,
) -> bool:
    """Keep the instants of a link and its map; returns whether anything is another."""
    kept = [[*pair, off] for pair, off in zip(pairs, residuals, strict=True)]
    values = {
        "instants": canonical_json_text(kept),
        "map": canonical_json_text(asdict(made)),
        **more,
    }
    if all(getattr(row, name) == value for name, value in values.items()):
        return False
    update_link(session, row.id, **values, revision=row.revision + 1)
    return True


def remove_link(store: Store, recording_id: int, link_id: int, *, actor: str) -> None:
    """Remove a link with its instants; groups that were taken of it stay.

    Raises:
        NotFoundError: The recording has no such link.
    """
    with store.write() as session:
        row = require_link(session, recording_id, link_id)
        delete_link(session, link_id)
        log_link_event(session, actor, "link removed", row)
        session.respond(None)


def _validate_instants(
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


def read_shot_times(settings: Settings, sha256: str | None, shot: LinkedShot) -> FloatArray:
    """When the frames of a shot are shown, seconds after its first one, shape (N,)."""
    if sha256 is None:
        raise ConflictError(f'"{shot.name}" is not indexed yet', hint="Index it again.")
    seconds = read_frame_times(settings, sha256)[shot.first : shot.last + 1]
    return np.asarray(seconds - seconds[0])


def compute_frame_interval(seconds: FloatArray) -> float:
    """Usual time between two frames, seconds."""
    steps = np.diff(seconds)
    return float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.04


def _compute_link_time_map(
    settings: Settings,
    row: Any,
    pairs: Sequence[tuple[int, int]],
    assumed_speed: float | None,
) -> tuple[LinkTimeMap, list[float | None]]:
    """The map of instants, and the residual of each in live frames."""
    _, replay = parse_linked_shots(row)
    live_times, times = read_link_times(settings, row)
    given = compute_instant_times(row, pairs, live_times, times)

    def name_frame(seconds: float) -> str:
        return f"frame {replay.first + int(np.abs(times - seconds).argmin())}"

    found = fit_map_to_instants(
        given, compute_frame_interval(live_times), assumed_speed, float(times[-1]), name_frame
    )
    made = make_link_time_map(found, replay, times, "instants" if pairs else None)
    return made, compute_link_residuals(made, given, live_times)


def read_link_times(settings: Settings, row: Any) -> tuple[FloatArray, FloatArray]:
    """When the frames of the live shot and of the replay are shown, seconds after the first ones."""
    live, replay = parse_linked_shots(row)
    return (
        read_shot_times(settings, row.live_sha256, live),
        read_shot_times(settings, row.replay_sha256, replay),
    )


def compute_instant_times(
    row: Any, pairs: Sequence[tuple[int, int]], live: FloatArray, replay: FloatArray
) -> FloatArray:
    """Live and replay time of instants, from the times of the frames, shape (N, 2)."""
    given = [(live[one - row.live_first], replay[two - row.replay_first]) for one, two in pairs]
    return np.array(given).reshape(-1, 2)


def compute_link_residuals(
    made: LinkTimeMap, given: FloatArray, live: FloatArray
) -> list[float | None]:
    """Live frames by which a map puts instants later, from their times and those of the live frames."""
    if not made.is_usable:
        return [None] * len(given)
    residuals: list[float | None] = (
        (made.to_live_times(given[:, 1]) - given[:, 0]) / compute_frame_interval(live)
    ).tolist()
    return residuals

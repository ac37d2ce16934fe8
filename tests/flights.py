"""A ball in flight for tests: kicked, bouncing and rolling before the four static cameras of ``rigs``."""

from __future__ import annotations

from dataclasses import asdict
from functools import cache
from pathlib import Path

import numpy as np

from app.db.json_columns import compress_json
from app.db.session import Session, now
from app.db.store import Store
from app.features.imports.ingest import import_groups
from app.features.solutions.service import solve_dataset
from app.features.tracks.codec import TrackInputs, inputs_to_json, make_track, track_to_json
from app.features.tracks.queries import insert_track
from app.features.tracks.service import TrackSummary, list_tracks, make_tracks
from app.features.tracks.stretches import gather_stretches
from app.formats.export_formats import WriteOptions, write_format
from app.formats.export_record import ExportRecord
from app.formats.manifest import Manifest, write_manifest
from app.formats.output import open_output_folder
from app.formats.tracks_writer import TrackRecord
from app.json_text import canonical_json_text
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import ImagePoint
from app.soccer.group import Group, Station, View
from app.soccer.pitch import Pitch
from app.soccer.policy import PAPER
from app.solving.solve import solve_group
from app.tracking.ball_track import BallMeasurements, BallTrack
from tests.cameras import SIZE
from tests.rigs import TRUTH

FIRST, KICK, RATE, GRASS = 100, 15, 25.0, -0.113
"""Number of the first frame, frames until the kick, frames a second, and the centre of a ball that lies."""
GRAVITY = 9.81


def places(count: int = 90) -> np.ndarray:
    """Where the ball is in each frame: it rolls, is kicked, bounces once, and rolls; shape (N, 3)."""
    found = np.empty((count, 3))
    x, y = -12.0, -6.0
    up = 6.5
    landing = 2 * up / GRAVITY
    second = 0.6 * landing
    for frame in range(count):
        t = frame / RATE
        since = t - KICK / RATE
        if since <= 0:
            found[frame] = x + 3.0 * t, y, GRASS
            continue
        start = x + 3.0 * KICK / RATE
        if since <= landing:
            height = up * since - GRAVITY / 2 * since**2
            found[frame] = start + 11.0 * since, y + 4.0 * since, GRASS - height
            continue
        after = since - landing
        ground = start + 11.0 * landing, y + 4.0 * landing
        flown = min(after, second)
        height = max(0.0, 0.6 * up * flown - GRAVITY / 2 * flown**2)
        found[frame] = ground[0] + 7.0 * after, ground[1] + 2.5 * after, GRASS - height
    return found


@cache
def flight_groups(count: int = 90, noise_px: float = 0.3, match: str = "rig") -> tuple[Group, ...]:
    """The frames of the flight as the cameras show them, which are given as they are."""
    stations = {key: Station(key, SIZE, shared=True, given=camera) for key, camera in TRUTH.items()}
    generator = np.random.default_rng(4)
    seen = {
        key: camera.project(places(count)) + generator.normal(0, noise_px, (count, 2))
        for key, camera in TRUTH.items()
    }
    groups = []
    for frame in range(count):
        views = tuple(
            View(key, stations[key], (BallAnnotation(point=ImagePoint(*pixels[frame].tolist())),))
            for key, pixels in seen.items()
            if (pixels[frame] >= 0).all() and (pixels[frame] < (SIZE.width, SIZE.height)).all()
        )
        groups.append(Group(str(FIRST + frame), views, match=match))
    return tuple(groups)


def add_flight(store: Store, name: str = "flight", count: int = 40) -> int:
    """A dataset of frames of the flight, solved and tracked; returns the id of its track."""
    import_groups(store, name, flight_groups(count), source="test", actor="local")
    solve_dataset(store, name)
    make_tracks(store, name, None, "local", lambda *_: None)
    (track,) = list_tracks(store, name)
    return track.id


def write_flight_export(out: Path) -> BallTrack:
    """A Parquet export of a frozen version of the flight, with its track, as the review floor writes it."""
    records = [
        ExportRecord(item, solve_group(item, PAPER), "accepted") for item in flight_groups(60)
    ]
    (stretch,) = gather_stretches(records, PAPER)
    track = make_track(TrackInputs.of(stretch))
    kept = [TrackRecord(stretch.key, track, stretch.pitch, stretch.rate, verdict="accepted")]
    with open_output_folder(out) as root:
        counts = write_format(root, records, WriteOptions("parquet", kept=kept))
        stamp = {"frozen": {"hash": "6f1ed002ab559585" * 4}}
        manifest = Manifest("flight", "parquet", "2030-01-01", counts, version="v1", stamp=stamp)
        write_manifest(root, manifest)
    return track


def insert_bare_track(session: Session, dataset_id: int, key: str) -> int:
    """A stretch of one frame that has no track; returns its id."""
    frames, times = np.array([FIRST]), np.array([FIRST / RATE])
    nothing = BallTrack.make_empty_track(frames, times, "one measurement")
    empty = np.zeros(0)
    measured = BallMeasurements(np.zeros(0, dtype=np.int64), empty, (), np.zeros((0, 2)), empty, ())
    summary = TrackSummary(1, {"gap": 1}, {}, 0, 0, None, None, None, nothing.reason, RATE, {})
    values = {
        "dataset_id": dataset_id,
        "key": key,
        "match": key,
        "first": FIRST,
        "last": FIRST,
        "inputs": compress_json(inputs_to_json(TrackInputs(frames, times, Pitch(), measured))),
        "body": compress_json(track_to_json(nothing)),
        "summary": canonical_json_text(asdict(summary)),
        "corrections": "[]",
        "revision": 0,
        **dict.fromkeys(("stamp", "digest", "actor"), "none"),
        **dict.fromkeys(("verdict", "note", "judged_by", "judged_at")),
        "created": now(),
    }
    return insert_track(session, values)

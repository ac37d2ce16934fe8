"""Tracking files of other tools: TRACAB's (``.dat`` with XML), and the Common Data Format's tracking."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from app.finite import json_text
from app.formats.tracks_writer import TrackRecord, track_folders

DATA, METADATA, CDF = "tracab.dat", "tracab_metadata.xml", "tracking.jsonl"
ZERO = datetime(1970, 1, 1, tzinfo=UTC)
"""Where times count from: no dataset says when its match was played."""
CDF_LIMITS = 65.0, 42.5
"""Farthest x and y that the Common Data Format has room for, metres."""


def write_tracab(root: Path, records: Iterable[TrackRecord]) -> dict[str, int]:
    """Write ``tracab.dat`` and ``tracab_metadata.xml`` of each track, the ball alone.

    Centimetres from the centre spot, x along the pitch, y across it away from the main stand, height
    up; speed in metres a second. Frames in gaps are left out: the format has no missing ball. It has
    nobody in possession either, so that ``H`` stands there. A rate that is not a whole number is rounded.

    Returns:
        Counts: ``tracks``, ``frames`` and ``balls``.

    Source: TRACAB's file specification as kloppy reads it (``TracabDatParser``).
    """
    counts = {"tracks": 0, "frames": 0, "balls": 0}
    for folder, record in track_folders(root, records):
        track, lines = record.track, []
        speed = np.linalg.norm(track.velocity, axis=1)
        for row in np.flatnonzero(record.has_position).tolist():
            x, y, z = np.rint(100 * track.position[row] * (1, -1, -1)).astype(int).tolist()
            alive = "Dead" if track.mode[row] == "out" else "Alive"
            lines.append(f"{track.frames[row]}::{x},{y},{z},{speed[row]:.2f},H,{alive};:\n")
        (folder / DATA).write_text("".join(lines), encoding="ascii")
        (folder / METADATA).write_text(_tracab_metadata(record), encoding="utf-8")
        counts["tracks"] += 1
        counts["frames"] += len(track.frames)
        counts["balls"] += len(lines)
    return counts


def write_cdf(root: Path, records: Iterable[TrackRecord]) -> dict[str, int]:
    """Write ``tracking.jsonl`` of each track: a JSON object a frame, the ball alone.

    Metres from the centre spot, x along the pitch, y across it away from the main stand, z up. Frames in
    gaps, and with a ball beyond what the format has room for, are left out: its validator takes no null.
    Frames count from 0, the first that is written; times of the stretch from 1970-01-01; both teams
    have no players.

    Returns:
        Counts: ``tracks``, ``frames`` and ``balls``.

    Source: Common Data Format 0.3.2 (arXiv 2505.15820), tracking.
    """
    counts = {"tracks": 0, "frames": 0, "balls": 0}
    for folder, record in track_folders(root, records):
        lines = [f"{json_text(line)}\n" for line in _cdf_lines(record)]
        (folder / CDF).write_text("".join(lines), encoding="utf-8")
        counts["tracks"] += 1
        counts["frames"] += len(record.track.frames)
        counts["balls"] += len(lines)
    return counts


def _tracab_metadata(record: TrackRecord) -> str:
    pitch, frames = record.pitch, record.track.frames
    return (
        '<?xml version="1.0" encoding="utf-8"?>\n'
        '<TracabMetaData sVersion="1.0">\n'
        f' <match iId={quoteattr(record.key)} dtDate="{ZERO:%Y-%m-%d %H:%M:%S}"'
        f' iFrameRateFps="{round(record.rate)}"'
        f' fPitchXSizeMeters="{pitch.length:.2f}" fPitchYSizeMeters="{pitch.width:.2f}"'
        f' fTrackingAreaXSizeMeters="{pitch.length + 20:.2f}"'
        f' fTrackingAreaYSizeMeters="{pitch.width + 20:.2f}">\n'
        f'  <period iId="1" iStartFrame="{frames[0]}" iEndFrame="{frames[-1]}"/>\n'
        " </match>\n"
        "</TracabMetaData>\n"
    )


def _cdf_lines(record: TrackRecord) -> Iterator[dict[str, Any]]:
    track = record.track
    nobody = {side: {"id": side, "players": list[Any]()} for side in ("home", "away")}
    there = record.has_position & (np.abs(np.nan_to_num(track.position[:, :2])) <= CDF_LIMITS).all(
        axis=1
    )
    rows = np.flatnonzero(there).tolist()
    for row in rows:
        x, y, z = (track.position[row] * (1, -1, -1)).tolist()
        yield {
            "frame_id": int(track.frames[row] - track.frames[rows[0]]),
            "timestamp": _timestamp(float(track.times[row])),
            "period": "first_half",
            "match": {"id": record.key},
            "teams": nobody,
            "ball": {"x": x, "y": y, "z": max(z, 0.0), "status": track.mode[row] != "out"},
        }


def _timestamp(seconds: float) -> str:
    return (ZERO + timedelta(seconds=seconds)).isoformat(timespec="milliseconds")

"""Ball runs as they are stored: from a row of the database to a value, and as columns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from app.db.json_columns import (
    Json,
    compress_json,
    decompress_json,
    parse_json_column,
    translate_shape_errors_to_damage,
)
from app.soccer.annotation import BallAnnotation
from app.soccer.codec import digest_json
from app.soccer.frames import Box, ImagePoint
from app.tracking.ball_run import BallClick, BallRun, FollowedBall

_COLUMNS = {"x": 3, "y": 3, "diameter": 3, "sigma_px": 3, "confidence": 3}
_STATES = {"f": "followed", "u": "uncertain"}
ACCEPTING, REMOVING = "accepting", "removing"
"""What is being done to a run: with the revision that the request for it named."""


@dataclass(frozen=True)
class StoredRun:
    """A run as it stands.

    Attributes:
        run: Its frames.
        confirmed: Uncertain frames that a person said are right.
        accepted_by: Who accepted it; None: nobody.
        stale: Whether the video is another one by now.
        sha256: Of the video that it is of.
        groups: What accepting did: views that got the ball (``placed``, also those that were made since), that had one already (``kept``), and that could
            not be edited (``refused``); after an attempt to take it back those that it is still in. While it is
            accepted or taken back, the revision of before is there as ``accepting`` or ``removing``.
    """

    id: int
    dataset_id: int
    recording: int
    run: BallRun
    confirmed: tuple[int, ...]
    accepted_by: str | None
    stale: bool
    sha256: str
    groups: Mapping[str, int]
    actor: str
    created: str
    etag: str

    @property
    def ball_source_name(self) -> str:
        """What balls that come from it say they come from."""
        return f"ball run {self.id}"

    @property
    def trusted_balls(self) -> dict[int, FollowedBall]:
        """The balls that accepting it stands for, by frame: all but uncertain ones that nobody confirmed."""
        sure = {*self.confirmed, *(click.frame for click in self.run.clicks)}
        return {
            ball.frame: ball
            for ball in self.run.balls
            if ball.state == "followed" or ball.frame in sure
        }

    def make_annotation(self, ball: FollowedBall) -> BallAnnotation:
        """What views that show a frame of it get."""
        box = Box.square(ImagePoint(ball.x, ball.y), ball.diameter)
        return BallAnnotation(box=box, predicted_by=self.ball_source_name)


def build_run_from_row(row: Any, sha256: str | None) -> StoredRun:
    """The run of a row.

    Args:
        row: Of the table.
        sha256: Of its recording's video as it is now.
    """
    return StoredRun(
        id=int(row.id),
        dataset_id=int(row.dataset_id),
        recording=int(row.recording_id),
        run=run_from_json(decompress_json(row.body)),
        confirmed=tuple(parse_json_column(row.confirmed)),
        accepted_by=row.accepted_by,
        stale=row.sha256 != sha256,
        sha256=row.sha256,
        groups=parse_json_column(row.groups),
        actor=row.actor,
        created=row.created,
        etag=make_run_etag(row.id, row.revision, row.created),
    )


def make_run_etag(run_id: int, revision: int, created: str) -> str:
    """The entity tag of a run at a revision."""
    return f'"{digest_json([run_id, revision, created])[:16]}"'


def run_to_columns(run: BallRun) -> dict[str, Any]:
    """The columns of the table that hold a run."""
    return {"first": run.first, "last": run.last, "body": compress_json(run_to_json(run))}


def run_to_json(run: BallRun) -> Json:
    """A run as columns: the same place is the same frame."""
    columns = {
        name: [round(float(getattr(ball, name)), digits) for ball in run.balls]
        for name, digits in _COLUMNS.items()
    }
    return {
        "clicks": [asdict(click) for click in run.clicks],
        "before": run.before,
        "after": run.after,
        "frame": [ball.frame for ball in run.balls],
        **columns,
        "state": "".join(ball.state[0] for ball in run.balls),
    }


def run_from_json(value: Mapping[str, Any]) -> BallRun:
    """Back from ``run_to_json``.

    Raises:
        DamagedError: It is not what was written.
    """
    with translate_shape_errors_to_damage():
        rows = zip(
            value["frame"],
            *(value[name] for name in _COLUMNS),
            (_STATES[letter] for letter in value["state"]),
            strict=True,
        )
        return BallRun(
            tuple(BallClick(**click) for click in value["clicks"]),
            tuple(FollowedBall(*row) for row in rows),
            value["before"],
            value["after"],
        )

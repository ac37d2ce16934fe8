"""The tables of recordings, films of a match from which groups are taken, of links between their shots, of
the cameras of shots and of runs of the ball."""

from __future__ import annotations

from sqlalchemy import ForeignKey, Index, LargeBinary, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from app.db.session import Base


class RecordingModel(Base):
    """A recording, its shots (JSON), and what was found when it was indexed last.

    The file stays where it is, at ``path``; ``stamp`` is its size and time of change when it was
    indexed. ``facts`` (JSON) and ``sha256`` are null until then, except for the ``problem`` in ``facts``
    that kept it from being indexed. ``revision`` counts the changes of
    ``shots``. ``clocks`` (JSON) are readings of the clock of the match; null: nobody read it.
    """

    __tablename__ = "recording"
    __table_args__ = (
        UniqueConstraint("dataset_id", "name", name="recording_name"),
        UniqueConstraint("dataset_id", "path", name="recording_path"),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    dataset_id: Mapped[int] = mapped_column(ForeignKey("dataset.id"))
    name: Mapped[str]
    path: Mapped[str]
    stamp: Mapped[str | None]
    sha256: Mapped[str | None]
    facts: Mapped[str | None]
    shots: Mapped[str]
    revision: Mapped[int]
    actor: Mapped[str]
    created: Mapped[str]
    clocks: Mapped[str | None]


class ShotCamerasModel(Base):
    """The cameras of a stretch of a recording, one for each frame.

    They lie in the recordings of the home under ``digest``, the sha256 of that file; ``summary`` (JSON) counts
    them. ``before`` and ``before_summary`` are those that they took the place of. ``sha256`` is that of the video.
    """

    __tablename__ = "shot_cameras"
    __table_args__ = (UniqueConstraint("recording_id", "first", name="shot_cameras_first"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    dataset_id: Mapped[int] = mapped_column(ForeignKey("dataset.id"))
    recording_id: Mapped[int] = mapped_column(ForeignKey("recording.id", ondelete="CASCADE"))
    first: Mapped[int]
    last: Mapped[int]
    sha256: Mapped[str]
    digest: Mapped[str]
    summary: Mapped[str]
    before: Mapped[str | None]
    before_summary: Mapped[str | None]
    revision: Mapped[int]
    actor: Mapped[str]
    created: Mapped[str]


class ShotLinkModel(Base):
    """A replay and the live shot that it shows again, both as they were when they were linked.

    ``instants`` is JSON: pairs of a live frame and the frame of the replay that shows the same instant. ``map``
    (JSON) is what was found from them. ``revision`` counts the changes.
    """

    __tablename__ = "shot_link"
    __table_args__ = (Index("shot_link_live", "live_id"), Index("shot_link_replay", "replay_id"))

    id: Mapped[int] = mapped_column(primary_key=True)
    dataset_id: Mapped[int] = mapped_column(ForeignKey("dataset.id"))
    live_id: Mapped[int] = mapped_column(ForeignKey("recording.id", ondelete="CASCADE"))
    live_first: Mapped[int]
    live_last: Mapped[int]
    replay_id: Mapped[int] = mapped_column(ForeignKey("recording.id", ondelete="CASCADE"))
    replay_first: Mapped[int]
    replay_last: Mapped[int]
    instants: Mapped[str]
    assumed_speed: Mapped[float | None]
    map: Mapped[str]
    revision: Mapped[int]
    actor: Mapped[str]
    created: Mapped[str]


class BallRunModel(Base):
    """Clicks on a ball, followed through the frames of a recording.

    ``body`` (compressed JSON) has the frames as columns, ``confirmed`` (JSON) are uncertain ones that a person said
    are right. ``accepted_by`` is who accepted the run, null: nobody, and ``groups`` (JSON) counts what that did.
    ``sha256`` is that of the video.
    """

    __tablename__ = "ball_run"
    __table_args__ = (Index("ball_run_recording", "recording_id", "first"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    dataset_id: Mapped[int] = mapped_column(ForeignKey("dataset.id"))
    recording_id: Mapped[int] = mapped_column(ForeignKey("recording.id", ondelete="CASCADE"))
    sha256: Mapped[str]
    first: Mapped[int]
    last: Mapped[int]
    groups: Mapped[str]
    confirmed: Mapped[str]
    body: Mapped[bytes] = mapped_column(LargeBinary)
    accepted_by: Mapped[str | None]
    revision: Mapped[int]
    actor: Mapped[str]
    created: Mapped[str]

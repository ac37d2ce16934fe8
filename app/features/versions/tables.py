"""Tables of frozen versions: rows that are written once and never change.

A version is sealed by its own row, which comes last: triggers refuse another group for it from
then on, every UPDATE, and every DELETE but the one that takes the whole dataset away.
"""

from __future__ import annotations

from sqlalchemy import ForeignKey, LargeBinary, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from app.db.session import Base


class VersionModel(Base):
    """A frozen version; ``policy``, ``split`` and ``counts`` are canonical JSON.

    ``tracks`` (the same) has the keys of frozen tracks by their stretches; None: it has no tracks.

    ``hash`` covers annotations, verdicts, splits, policy and solver version, and nothing else:
    the same on every machine. ``previous`` is the id of the version frozen before.
    """

    __tablename__ = "version"
    __table_args__ = (UniqueConstraint("dataset_id", "name", name="version_name"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    dataset_id: Mapped[int] = mapped_column(ForeignKey("dataset.id", ondelete="CASCADE"))
    name: Mapped[str]
    note: Mapped[str]
    licence: Mapped[str]
    created: Mapped[str]
    actor: Mapped[str]
    hash: Mapped[str]
    groups: Mapped[str]
    policy: Mapped[str]
    policy_hash: Mapped[str]
    solver_version: Mapped[str]
    software_version: Mapped[str]
    split: Mapped[str]
    counts: Mapped[str]
    previous: Mapped[int | None]
    tracks: Mapped[str | None]


class VersionGroupModel(Base):
    """One group of the dataset as a version has it, or the reason why it is not in it.

    Attributes:
        position: Place by match and key, from 0; the same on every machine.
        member: Whether the group is in the version; ``why`` says why not.
        split: Of the group; ``splits`` (JSON) by view where the views differ.
        verdict: JSON of what was decided, without who and when; None: nobody decided.
        said: Key of the frozen annotations; ``solution`` of the frozen solution.
        ball: JSON of the 3D ball.
        frames: Where the frames lie and what they weigh (compressed JSON); not in the hash.
    """

    __tablename__ = "version_group"
    __table_args__ = (UniqueConstraint("version_id", "key", name="version_group_key"),)

    version_id: Mapped[int] = mapped_column(
        ForeignKey("version.id", ondelete="CASCADE", deferrable=True, initially="DEFERRED"),
        primary_key=True,
    )
    position: Mapped[int] = mapped_column(primary_key=True)
    key: Mapped[str]
    match: Mapped[str]
    member: Mapped[bool]
    why: Mapped[str | None]
    split: Mapped[str]
    splits: Mapped[str | None]
    verdict: Mapped[str | None]
    said: Mapped[str | None]
    solution: Mapped[str | None]
    ball: Mapped[str | None]
    frames: Mapped[bytes | None] = mapped_column(LargeBinary)


class VersionCheckModel(Base):
    """What came of verifying a version the last time; ``report`` (JSON) as ``VerifyReport`` has it.

    ``problem`` says why nothing came of it, where it could not be done; then ``report`` is None.
    """

    __tablename__ = "version_check"

    version_id: Mapped[int] = mapped_column(
        ForeignKey("version.id", ondelete="CASCADE"), primary_key=True
    )
    at: Mapped[str]
    actor: Mapped[str]
    solver_version: Mapped[str]
    report: Mapped[str | None]
    problem: Mapped[str | None]


class FrozenModel(Base):
    """Content under a key that follows from it; versions of one dataset share it.

    ``said:``, ``station:``, ``track:`` and ``solution:`` with the digest of the content, ``calibration:``
    with the key that the solver gives it. The body of a calibration, most of what there is, stays
    NULL while the calibration is where the solver keeps it; a trigger saves it from deletion.
    """

    __tablename__ = "frozen"

    dataset_id: Mapped[int] = mapped_column(
        ForeignKey("dataset.id", ondelete="CASCADE"), primary_key=True
    )
    key: Mapped[str] = mapped_column(primary_key=True)
    body: Mapped[bytes | None] = mapped_column(LargeBinary)

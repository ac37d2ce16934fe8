"""Export: what people accepted (or everything), as a folder or zip with a manifest."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from sqlalchemy import ColumnElement, func, not_, or_, select
from sqlalchemy.orm import Session

from app.datasets.export_record import BOX_KINDS, ExportRecord
from app.datasets.issia import MATCH as ISSIA
from app.datasets.issia_3d import write_issia_3d
from app.datasets.manifest import LICENCES, UNKNOWN_LICENCE, Manifest, write_manifest
from app.datasets.output import output_tree
from app.datasets.per_view import write_camera_files, write_sn_calibration
from app.datasets.soccernet_v3 import write_soccernet_v3
from app.datasets.soccernet_v3d import write_soccernet_v3d
from app.errors import InputError
from app.review.datasets import Dataset, read_dataset
from app.review.export_images import ExportImages
from app.review.state import GroupState, VerdictState, read_states
from app.sample.fixture import LEAGUES
from app.soccer.group import Group
from app.soccer.solution import SOLVER_VERSION
from app.store.codecs import policy_to_json
from app.store.models import LogModel, QueueModel
from app.store.session import Store

FORMATS = ("soccernet-v3d", "issia-3d", "cameras", "sn-calibration", "soccernet-v3")
IMAGES = ("none", "copy", "link")
_BATCH = 200

Progress = Callable[[int, int], None]
"""Called with the number of groups done and the number that are exported."""


@dataclass(frozen=True)
class ExportReport:
    """What was written.

    Attributes:
        counts: As the format counts: groups, views, balls, cameras ...
        left_out: Accepted groups that are not in it, by reason: ``stale`` (changed after the
            verdict), ``failing`` (a gate, and nobody overrode it), ``unsolved``.
        missing_images: Frames that could not be copied, with the reason.
    """

    out: Path
    format: str
    counts: Mapping[str, int]
    left_out: Mapping[str, int] = field(default_factory=dict)
    missing_images: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Options:
    format: str
    everything: bool
    boxes: str
    images: str

    def check(self, out: Path) -> None:
        for name, value, choices in (
            ("format", self.format, FORMATS),
            ("boxes", self.boxes, BOX_KINDS),
            ("images", self.images, IMAGES),
        ):
            if value not in choices:
                raise InputError(
                    f'"{value}" is not possible for {name}; {", ".join(choices)} are',
                    pointer=f"/{name}",
                )
        if self.images == "link" and out.suffix.lower() == ".zip":
            raise InputError("a zip cannot hold links; export a folder or copy the images")


def export(
    store: Store,
    dataset: str | int,
    format: str,  # noqa: A002
    out: Path,
    *,
    everything: bool = False,
    boxes: str = "optimized",
    images: str = "none",
    progress: Progress | None = None,
) -> ExportReport:
    """Write a dataset's accepted groups, or all groups, in a format that consumers read.

    Accepted means: the newest verdict accepts the group as it is now, and the policy passes it
    or a person overrode the gate with a reason. All is read from one snapshot of the database.

    Args:
        store: The database.
        dataset: Name or id.
        format: One of ``FORMATS``.
        out: Folder, or file that ends in .zip; appears whole or not at all.
        everything: Every group, whatever its verdict.
        boxes: ``optimized``, ``annotated`` or ``exact``; which ball box Labels-v3D.json holds. No
            other format has a place for a chosen box, and its manifest names none.
        images: ``none``, ``copy`` or ``link`` (folders only).
        progress: Called as groups are written.

    Raises:
        InputError: Nothing to export, or the groups do not fit the format.
        StorageError: The disk refuses.
    """
    options = _Options(format, everything, boxes, images)
    options.check(out)
    with store.read() as session:
        found = read_dataset(session, dataset)
        ids = _ids(session, found.id, everything)
        left_out = {} if everything else _left_out(session, found.id)
        if not ids:
            raise _nothing(found, left_out, everything)
        with output_tree(out) as root:
            frames = ExportImages(root, images, store.settings)
            run = _Run(session, ids, options, frames, progress)
            counts = run.write(root)
            _require_content(found, format, counts)
            write_manifest(root, run.manifest(found, counts))
    return ExportReport(out, format, counts, left_out, tuple(frames.missing))


class _Run:
    """One export under way: streams records to a writer and notes what the manifest says."""

    def __init__(
        self,
        session: Session,
        ids: list[int],
        options: _Options,
        images: ExportImages,
        progress: Progress | None,
    ):
        self._session, self._ids, self._options = session, ids, options
        self._images, self._progress = images, progress
        self._licences: set[str] = set()

    def write(self, root: Path) -> dict[str, int]:
        """Write the format's files; returns its counts."""
        records, everything = self._records(), self._options.everything
        match self._options.format:
            case "soccernet-v3d":
                return write_soccernet_v3d(
                    root, records, everything=everything, boxes=self._options.boxes
                )
            case "issia-3d":
                return write_issia_3d(root, records, everything=everything)
            case "cameras":
                return write_camera_files(root, records)
            case "sn-calibration":
                return write_sn_calibration(root, records)
            case _:
                write_soccernet_v3(root, (record.group for record in records))
                return {"groups": len(self._ids)}

    def manifest(self, dataset: Dataset, counts: Mapping[str, int]) -> Manifest:
        """What the manifest says of this export."""
        settings = {
            "policy": policy_to_json(dataset.policy),
            "policy_hash": dataset.policy.hash,
            "solver_version": SOLVER_VERSION,
            "groups": "all" if self._options.everything else "accepted",
            "images": self._options.images,
            **self._boxes(),
        }
        return Manifest(
            dataset=dataset.name,
            format=self._options.format,
            date=_newest(self._session, dataset.id),
            counts=counts,
            settings=settings,
            licence=" ".join(sorted(self._licences)) or UNKNOWN_LICENCE,
            media=tuple(self._images.media),
        )

    def _boxes(self) -> dict[str, str]:
        """Which ball box stands where, for the format that holds a chosen one."""
        if self._options.format != "soccernet-v3d":
            return {}
        # optimized_d is defined around the centre of the annotated box.
        return {"boxes": self._options.boxes, "ball_bbox": "annotated"}

    def _records(self) -> Iterator[ExportRecord]:
        for start in range(0, len(self._ids), _BATCH):
            batch = self._ids[start : start + _BATCH]
            for place, state in enumerate(read_states(self._session, batch), start + 1):
                self._licences.add(LICENCES.get(_origin(state.group), UNKNOWN_LICENCE))
                self._images.add(state.group)
                yield _record(state)
                if self._progress is not None:
                    self._progress(place, len(self._ids))


def _record(state: GroupState) -> ExportRecord:
    return ExportRecord(
        group=state.group,
        solution=state.solution,
        verdict=_verdict(state.verdict),
        reason=_reason(state.verdict),
    )


def _verdict(verdict: VerdictState) -> str:
    """The verdict; an accepted group that changed since says so, as it is not accepted now."""
    stale = verdict.stale and verdict.state == "accepted"
    return f"{verdict.state} (stale)" if stale else verdict.state


def _reason(verdict: VerdictState) -> str | None:
    """Why it was rejected, or why it was accepted against a gate."""
    if verdict.state == "rejected":
        return f"{verdict.reason}: {verdict.note}" if verdict.note else verdict.reason
    if verdict.override is not None:
        return f"overrides {verdict.override}: {verdict.note}"
    return None


def _origin(group: Group) -> str:
    """Whose data a group is, for the licence text."""
    parts = group.match.split("/")
    if parts[0] in LEAGUES:
        return "sample"
    if group.match == ISSIA:
        return "issia"
    return "soccernet" if len(parts) == 3 else ""


def _ids(session: Session, dataset_id: int, everything: bool) -> list[int]:
    where = [QueueModel.dataset_id == dataset_id]
    if not everything:
        where += [
            QueueModel.status == "accepted",
            _CURRENT,
            QueueModel.solved.is_(True),
            _QUALIFIES,
        ]
    statement = select(QueueModel.group_id).where(*where).order_by(QueueModel.number)
    return list(session.scalars(statement))


def _left_out(session: Session, dataset_id: int) -> dict[str, int]:
    """Accepted groups that are not exported, counted by the first reason that holds."""
    reasons: dict[str, list[ColumnElement[bool]]] = {
        "stale": [not_(_CURRENT)],
        "unsolved": [_CURRENT, not_(QueueModel.solved)],
        "failing": [_CURRENT, QueueModel.solved.is_(True), not_(_QUALIFIES)],
    }
    counts = {}
    for reason, where in reasons.items():
        statement = select(func.count()).where(
            QueueModel.dataset_id == dataset_id, QueueModel.status == "accepted", *where
        )
        counts[reason] = int(session.execute(statement).scalar_one())
    return {reason: count for reason, count in counts.items() if count}


def _nothing(dataset: Dataset, left_out: Mapping[str, int], everything: bool) -> InputError:
    if everything:
        return InputError(
            f'dataset "{dataset.name}" holds no groups, so there is nothing to export'
        )
    if left_out:
        reasons = ", ".join(f"{count} {reason}" for reason, count in left_out.items())
        return InputError(f'no accepted group of "{dataset.name}" can be exported ({reasons})')
    return InputError(
        f'nobody has accepted a group of "{dataset.name}" yet, so there is nothing to export'
    )


def _require_content(dataset: Dataset, format: str, counts: Mapping[str, int]) -> None:  # noqa: A002
    """Raises InputError where a format has no place for anything that the groups hold."""
    count, what = _CONTENT.get(format, ("groups", "group"))
    if not counts[count]:
        raise InputError(
            f'no group of "{dataset.name}" has a {what} for {format}, so there is nothing to export'
        )


def _newest(session: Session, dataset_id: int) -> str:
    """Time of the newest thing that was said about the dataset."""
    statement = select(func.max(LogModel.at)).where(LogModel.dataset_id == dataset_id)
    return str(session.execute(statement).scalar_one())


_CONTENT = {
    "cameras": ("cameras", "camera"),
    "issia-3d": ("groups", "ball"),
    "sn-calibration": ("frames", "frame"),
}
"""What a format consists of: the name of its count, and the word for one."""

_CURRENT = not_(QueueModel.stale)
_QUALIFIES = or_(QueueModel.passes.is_(True), QueueModel.override.is_not(None))

"""Evaluations that are kept: their tables, figures and frames, and what changed between two."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from app.db.json_columns import Json
from app.db.session import Session
from app.db.store import Store
from app.errors import InputError, NotFoundError
from app.evaluation.comparison import (
    FIELDS,
    Difference,
    FrameComparison,
    compare_frames,
    compare_tables,
    differing_pins,
)
from app.evaluation.result import NUMBERS, Figure, FrameResult, Table
from app.features.audit.audit_events import add_audit_event
from app.features.datasets.service import read_dataset_head
from app.features.predictions import evaluation_queries as frame_rows
from app.features.predictions.evaluation_queries import (
    FrameCondition,
    dataset_evaluations,
    delete_evaluation,
    find_evaluation,
    read_figure,
)
from app.features.predictions.evaluation_queries import StoredEvaluation as StoredEvaluation
from app.features.solutions.codec import from_json

MAX_PAGE = 500


@dataclass(frozen=True)
class FrameQuery:
    """Which frames of a run, in which order.

    Attributes:
        field: Frames whose field (of ``result.NUMBERS``) lies in [low, high); None: all.
        missing: Frames without a value in ``field`` instead.
        sort: Field, descending with ``-desc``; empty: as they stand in the dataset.
    """

    field: str | None = None
    low: float | None = None
    high: float | None = None
    missing: bool = False
    match: str | None = None
    sort: str = ""


@dataclass(frozen=True)
class FramePage:
    """Frames of a run; ``next`` is the place of the next page, None at the end."""

    items: list[FrameResult]
    next: int | None
    total: int


@dataclass(frozen=True)
class RunComparison:
    """Two runs of one dataset.

    Attributes:
        same_truth: Whether their numbers can be compared.
        differs: Pins in which they differ: those that make it another truth, and the version of
            the software.
    """

    first: StoredEvaluation
    second: StoredEvaluation
    same_truth: bool
    differs: tuple[str, ...]
    numbers: list[Difference]
    frames: FrameComparison


def list_evaluations(store: Store, dataset: str | int) -> list[StoredEvaluation]:
    """The runs of a dataset, the newest first."""
    with store.read() as session:
        found = read_dataset_head(session, dataset)
        return dataset_evaluations(session, found.id)


def get_evaluation(store: Store, evaluation_id: int) -> StoredEvaluation:
    """A run by its id.

    Raises:
        NotFoundError: There is none.
    """
    with store.read() as session:
        return read_evaluation(session, evaluation_id)


def remove_evaluation(store: Store, evaluation_id: int, *, actor: str) -> None:
    """Delete a run.

    Raises:
        NotFoundError: There is none.
    """
    with store.write() as session:
        found = read_evaluation(session, evaluation_id)
        delete_evaluation(session, evaluation_id)
        add_audit_event(
            session, actor, "evaluation deleted", found.dataset_id, evaluation=evaluation_id
        )
        session.respond(None)


def tables_of(evaluation: StoredEvaluation) -> list[Table]:
    """The tables of a run as values."""
    return read_tables(evaluation.tables)


def read_tables(values: Iterable[Json]) -> list[Table]:
    """Tables from JSON."""
    return [from_json(Table, value) for value in values]


def get_figure(store: Store, evaluation_id: int, name: str) -> Figure:
    """One figure of a run.

    Raises:
        NotFoundError: There is no such run, or it has no such figure.
    """
    with store.read() as session:
        known = read_evaluation(session, evaluation_id).figures
        value = read_figure(session, evaluation_id, name)
    if value is None:
        raise NotFoundError(
            f'evaluation {evaluation_id} has no figure "{name}"',
            hint=f"It has {', '.join(known)}.",
        )
    return from_json(Figure, value)


def list_frames(
    store: Store, evaluation_id: int, query: FrameQuery, limit: int = 50, offset: int = 0
) -> FramePage:
    """A page of the frames behind a number.

    Raises:
        NotFoundError: There is no such run.
        InputError: The query, the limit or the place is impossible.
    """
    if not 1 <= limit <= MAX_PAGE:
        raise InputError(f"a page has 1 to {MAX_PAGE} frames", pointer="/limit")
    where = _conditions(query)
    sort = _checked_field(query.sort.removesuffix("-desc"), "/sort") if query.sort else None
    descending = query.sort.endswith("-desc")
    with store.read() as session:
        read_evaluation(session, evaluation_id)
        total = frame_rows.count_frame_rows(session, evaluation_id, where)
        rows = frame_rows.read_frame_rows(
            session,
            evaluation_id,
            where,
            sort=sort,
            descending=descending,
            limit=limit,
            offset=offset,
        )
        items = [FrameResult(**row) for row in rows]
    more = offset + len(items) < total
    return FramePage(items, offset + len(items) if more else None, total)


def compare(store: Store, first_id: int, second_id: int, field: str = "error_m") -> RunComparison:
    """What changed from one run to another of the same dataset.

    Raises:
        NotFoundError: A run does not exist.
        InputError: They belong to different datasets, or the field has no difference.
    """
    if field not in FIELDS:
        raise InputError(f"frames are compared by {', '.join(FIELDS)}", pointer="/field")
    with store.read() as session:
        first, second = read_evaluation(session, first_id), read_evaluation(session, second_id)
        if first.dataset_id != second.dataset_id:
            raise InputError("the two runs belong to different datasets", pointer="/with")
        frames = [
            [FrameResult(**row) for row in frame_rows.read_frame_rows(session, item.id)]
            for item in (first, second)
        ]
    differs = differing_pins(first.pins, second.pins)
    return RunComparison(
        first,
        second,
        set(differs) <= {"software_version"},
        differs,
        compare_tables(tables_of(first), tables_of(second)),
        compare_frames(frames[0], frames[1], field),
    )


def read_evaluation(session: Session, evaluation_id: int) -> StoredEvaluation:
    """``get_evaluation`` in a transaction that is open already."""
    found = find_evaluation(session, evaluation_id)
    if found is None:
        raise NotFoundError(f"there is no evaluation {evaluation_id}")
    return found


def _conditions(query: FrameQuery) -> list[FrameCondition]:
    where = [] if query.match is None else [frame_rows.is_of_match(query.match)]
    if query.field is not None:
        field = _checked_field(query.field, "/field")
        where.append(
            frame_rows.lacks(field)
            if query.missing
            else frame_rows.lies_in(field, query.low, query.high)
        )
    return where


def _checked_field(field: str, pointer: str) -> str:
    """A field of frames; raises InputError where they have none of that name."""
    if field not in NUMBERS:
        known = ", ".join(NUMBERS)
        raise InputError(
            f'frames have no field "{field}"', hint=f"Fields: {known}.", pointer=pointer
        )
    return field

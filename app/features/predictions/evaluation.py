"""Stored evaluations: their tables, figures and frames, comparisons, tracks, and export to a folder."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

from app.db.json_columns import Json
from app.db.session import Session
from app.db.store import Store
from app.errors import InputError, NotFoundError
from app.evaluation.comparison import (
    FIELDS,
    CellDifference,
    FrameComparison,
    compare_frames,
    compare_tables,
    list_differing_settings,
)
from app.evaluation.result import (
    NUMBERS,
    Chart,
    Evaluation,
    FrameResult,
    Table,
    figure_to_csv,
    figure_to_png,
    table_to_csv,
)
from app.evaluation.track_scores import GroundTruthTrack, evaluate_tracks
from app.features.audit.service import add_audit_event
from app.features.datasets.service import DatasetHead, read_dataset_head
from app.features.predictions import queries as frame_rows
from app.features.predictions.frames import describe_ground_truth
from app.features.predictions.queries import (
    FrameCondition,
    PredictionSet,
    delete_evaluation,
    find_evaluation,
    list_evaluations_of_dataset,
    read_chart,
    read_predicted_tracks,
)
from app.features.predictions.queries import StoredEvaluation as StoredEvaluation
from app.features.solutions.codec import from_json, solution_json_text, to_json
from app.features.tracks.codec import track_from_json
from app.features.tracks.service import collect_accepted_tracks
from app.features.versions.frozen_queries import decode_frozen_json, read_frozen
from app.features.versions.service import Version
from app.formats.safe_path import resolve_inside
from app.formats.tracks_writer import make_track_folder_name
from app.json_text import json_text, quote_text
from app.soccer.codec import digest_json
from app.soccer.solution import SOLVER_VERSION

MAX_PAGE = 500


FIGURE_ENDINGS = ("csv", "json", "png")
Fetch = Callable[[str, str, Path], object]
"""Writes ``tables`` or ``figures`` of a name with its ending to a file."""


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
    numbers: list[CellDifference]
    frames: FrameComparison


def list_evaluations(store: Store, dataset: str | int) -> list[StoredEvaluation]:
    """The runs of a dataset, the newest first."""
    with store.read() as session:
        found = read_dataset_head(session, dataset)
        return list_evaluations_of_dataset(session, found.id)


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


def parse_run_tables(evaluation: StoredEvaluation) -> list[Table]:
    """The tables of a run as values."""
    return parse_tables(evaluation.tables)


def parse_tables(values: Iterable[Json]) -> list[Table]:
    """Tables from JSON."""
    return [from_json(Table, value) for value in values]


def get_chart(store: Store, evaluation_id: int, name: str) -> Chart:
    """One figure of a run.

    Raises:
        NotFoundError: There is no such run, or it has no such figure.
    """
    with store.read() as session:
        known = read_evaluation(session, evaluation_id).figures
        value = read_chart(session, evaluation_id, name)
    if value is None:
        raise NotFoundError(
            f'evaluation {evaluation_id} has no figure "{name}"',
            hint=f"It has {', '.join(known)}.",
        )
    return from_json(Chart, value)


def list_frames(
    store: Store, evaluation_id: int, query: FrameQuery, limit: int = 50, offset: int = 0
) -> FramePage:
    """A page of the frames behind a number.

    Raises:
        NotFoundError: There is no such run.
        InputError: The query, the limit or the place is impossible.
    """
    if not 1 <= limit <= MAX_PAGE:
        raise InputError(f"limit must be 1 to {MAX_PAGE} frames", pointer="/limit")
    where = _build_frame_conditions(query)
    sort = _validate_field(query.sort.removesuffix("-desc"), "/sort") if query.sort else None
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


def compare_runs(
    store: Store, first_id: int, second_id: int, field: str = "error_m"
) -> RunComparison:
    """The comparison of two runs on the same dataset.

    Raises:
        NotFoundError: A run does not exist.
        InputError: They belong to different datasets, or the field has no difference.
    """
    if field not in FIELDS:
        raise InputError(
            f"frames cannot be compared by {quote_text(field)}; use one of {', '.join(FIELDS)}",
            pointer="/field",
        )
    with store.read() as session:
        first, second = read_evaluation(session, first_id), read_evaluation(session, second_id)
        if first.dataset_id != second.dataset_id:
            raise InputError("the two runs belong to different datasets", pointer="/with")
        frames = [
            [FrameResult(**row) for row in frame_rows.read_frame_rows(session, item.id)]
            for item in (first, second)
        ]
    differs = list_differing_settings(first.pins, second.pins)
    return RunComparison(
        first,
        second,
        set(differs) <= {"software_version"},
        differs,
        compare_tables(parse_run_tables(first), parse_run_tables(second)),
        compare_frames(frames[0], frames[1], field),
    )


def read_evaluation(session: Session, evaluation_id: int) -> StoredEvaluation:
    """``get_evaluation`` in a transaction that is open already."""
    found = find_evaluation(session, evaluation_id)
    if found is None:
        raise NotFoundError(f"there is no evaluation {evaluation_id}")
    return found


def _build_frame_conditions(query: FrameQuery) -> list[FrameCondition]:
    where = [] if query.match is None else [frame_rows.match_condition(query.match)]
    if query.field is not None:
        field = _validate_field(query.field, "/field")
        where.append(
            frame_rows.ball_without_number_condition(field)
            if query.missing
            else frame_rows.between_condition(field, query.low, query.high)
        )
    return where


def _validate_field(field: str, pointer: str) -> str:
    """A field of frames; raises InputError where they have none of that name."""
    if field not in NUMBERS:
        known = ", ".join(NUMBERS)
        raise InputError(
            f'frames have no field "{field}"', hint=f"Fields: {known}.", pointer=pointer
        )
    return field


def write_evaluation(store: Store, evaluation: StoredEvaluation, out: Path) -> None:
    """Write everything of an evaluation into a folder.

    Raises:
        InputError: The folder cannot be written.
    """
    tables = {f"{table.name}.csv": table for table in parse_run_tables(evaluation)}
    # Its three files come one after the other.
    figure = lru_cache(maxsize=1)(partial(get_chart, store, evaluation.id))

    def write_figure_file(kind: str, name: str, file: Path) -> None:
        if kind == "tables":
            file.write_text(table_to_csv(tables[name]), encoding="utf-8")
            return
        title, _, ending = name.rpartition(".")
        file.write_bytes(_render_figure(figure(title), ending))

    frames = (vars(frame) for frame in _read_frames(store, evaluation.id))
    write_evaluation_parts(out, evaluation_to_values(evaluation), frames, write_figure_file)


def write_evaluation_parts(
    out: Path, values: Mapping[str, Any], frames: Iterable[Mapping[str, Any]], fetch: Fetch
) -> None:
    """Write an evaluation, wherever its parts come from, into a folder.

    Args:
        out: The folder; made where it is missing.
        values: As ``evaluation_to_values`` has them.
        frames: What came of each frame.
        fetch: Writes a table or figure.

    Raises:
        InputError: The folder cannot be written.
        UnsafePathError: A name leads out of it.
    """
    tables = [f"{table['name']}.csv" for table in values["tables"]]
    figures = [f"{name}.{ending}" for name in values["figures"] for ending in FIGURE_ENDINGS]
    try:
        out.mkdir(parents=True, exist_ok=True)
        text = json_text(values, indent=2) + "\n"
        (out / "evaluation.json").write_text(text, encoding="utf-8")
        for kind, names in (("tables", tables), ("figures", figures)):
            for name in names:
                fetch(kind, name, resolve_inside(out, name))
        with (out / "frames.jsonl").open("w", encoding="utf-8") as file:
            for frame in frames:
                file.write(json_text(frame, ascii_=True) + "\n")
    except OSError as error:
        raise InputError(f"the evaluation cannot be written to {out} ({error.strerror})") from error


def _render_figure(figure: Chart, ending: str) -> bytes:
    """A figure as the content of a file: ``csv``, ``json`` or ``png``."""
    if ending == "png":
        return figure_to_png(figure)
    text = figure_to_csv(figure) if ending == "csv" else solution_json_text(to_json(figure)) + "\n"
    return text.encode()


def evaluation_to_values(evaluation: StoredEvaluation) -> dict[str, Any]:
    """An evaluation as plain values."""
    return {**vars(evaluation), "figures": list(evaluation.figures)}


def _read_frames(store: Store, evaluation_id: int) -> Iterator[FrameResult]:
    place: int | None = 0
    while place is not None:
        page = list_frames(store, evaluation_id, FrameQuery(), MAX_PAGE, place)
        yield from page.items
        place = page.next


def evaluate_stored_tracks(
    session: Session, dataset: DatasetHead, version: Version | None, predictions: PredictionSet
) -> tuple[Evaluation, dict[str, Json]]:
    """The evaluation of stored tracks, and the pins of its truth.

    Args:
        session: Any session.
        dataset: Whose tracks are the truth.
        version: Whose tracks are; None: those that people accepted and that are not stale.
        predictions: A set of tracks.

    Raises:
        InputError: There is no true track, or nothing that is predicted is of an instant of one.
    """
    if version is None:
        values = collect_accepted_tracks(session, dataset)
        pins = describe_ground_truth(
            dataset.policy, SOLVER_VERSION, digest_json(values), "accepted"
        )
    else:
        bodies = read_frozen(session, version.dataset_id, version.tracks.values())
        values = {key: decode_frozen_json(bodies[name]) for key, name in version.tracks.items()}
        pins = describe_ground_truth(
            version.policy, version.solver_version, version.hash, version.groups, version
        )
    if not values:
        where = f'the version "{version.name}"' if version else f'"{dataset.name}"'
        raise InputError(
            f"{where} has no accepted ball track",
            hint="Make and accept its tracks (stale ones do not count), then freeze a version.",
            pointer="/version",
        )
    truth = [_parse_true_track(key, value) for key, value in sorted(values.items())]
    return evaluate_tracks(truth, read_predicted_tracks(session, predictions.id)), pins


def _parse_true_track(key: str, value: Json) -> GroundTruthTrack:
    track = track_from_json(value["track"])
    return GroundTruthTrack(
        key,
        make_track_folder_name(key),
        track.frames,
        track.times,
        track.position,
        track.state,
        track.mode,
        tuple((event.kind, event.time_s) for event in track.events),
    )

"""An evaluation as a folder: tables, figures and frames as CSV, JSON and PNG."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

from app.db.store import Store
from app.errors import InputError
from app.evaluation.figure_png import figure_png
from app.evaluation.result import Figure, FrameResult, figure_csv, table_csv
from app.features.predictions.evaluation import (
    MAX_PAGE,
    FrameQuery,
    get_figure,
    list_frames,
    tables_of,
)
from app.features.predictions.evaluation_queries import StoredEvaluation
from app.features.solutions.codec import dumps, to_json
from app.finite import json_text
from app.formats.safe_path import resolve_inside

FIGURE_ENDINGS = ("csv", "json", "png")

Fetch = Callable[[str, str, Path], object]
"""Writes ``tables`` or ``figures`` of a name with its ending to a file."""


def write_evaluation(store: Store, evaluation: StoredEvaluation, out: Path) -> None:
    """Write everything of an evaluation into a folder.

    Raises:
        InputError: The folder cannot be written.
    """
    tables = {f"{table.name}.csv": table for table in tables_of(evaluation)}
    # Its three files come one after the other.
    figure = lru_cache(maxsize=1)(partial(get_figure, store, evaluation.id))

    def fetch(kind: str, name: str, file: Path) -> None:
        if kind == "tables":
            file.write_text(table_csv(tables[name]), encoding="utf-8")
            return
        title, _, ending = name.rpartition(".")
        file.write_bytes(_figure_as(figure(title), ending))

    frames = (vars(frame) for frame in _frames(store, evaluation.id))
    write_parts(out, evaluation_values(evaluation), frames, fetch)


def write_parts(
    out: Path, values: Mapping[str, Any], frames: Iterable[Mapping[str, Any]], fetch: Fetch
) -> None:
    """Write an evaluation, wherever its parts come from, into a folder.

    Args:
        out: The folder; made where it is missing.
        values: As ``evaluation_values`` has them.
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
        raise InputError(f"{out} cannot hold the evaluation ({error.strerror})") from error


def _figure_as(figure: Figure, ending: str) -> bytes:
    """A figure as the content of a file: ``csv``, ``json`` or ``png``."""
    if ending == "png":
        return figure_png(figure)
    text = figure_csv(figure) if ending == "csv" else dumps(to_json(figure)) + "\n"
    return text.encode()


def evaluation_values(evaluation: StoredEvaluation) -> dict[str, Any]:
    """An evaluation as plain values."""
    return {**vars(evaluation), "figures": list(evaluation.figures)}


def _frames(store: Store, evaluation_id: int) -> Iterator[FrameResult]:
    place: int | None = 0
    while place is not None:
        page = list_frames(store, evaluation_id, FrameQuery(), MAX_PAGE, place)
        yield from page.items
        place = page.next

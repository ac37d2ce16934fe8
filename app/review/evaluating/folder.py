"""An evaluation as a folder: tables, figures and frames as CSV, JSON and PNG."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from app.errors import InputError
from app.evaluation.figure_csv import figure_csv, table_csv
from app.evaluation.figure_png import figure_png
from app.evaluation.result import FrameResult
from app.finite import json_text
from app.review.evaluating.evaluation import (
    MAX_PAGE,
    FrameQuery,
    get_figure,
    list_frames,
    tables_of,
)
from app.store.evaluations import StoredEvaluation
from app.store.store import Store
from app.store.value_codec import dumps, to_json


def write_evaluation(store: Store, evaluation: StoredEvaluation, out: Path) -> None:
    """Write everything of an evaluation into a folder.

    Raises:
        InputError: The folder cannot be written.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        text = json_text(evaluation_values(evaluation), indent=2)
        (out / "evaluation.json").write_text(text + "\n", encoding="utf-8")
        for table in tables_of(evaluation):
            (out / f"{table.name}.csv").write_text(table_csv(table), encoding="utf-8")
        for name in evaluation.figures:
            figure = get_figure(store, evaluation.id, name)
            (out / f"{name}.csv").write_text(figure_csv(figure), encoding="utf-8")
            (out / f"{name}.json").write_text(dumps(to_json(figure)) + "\n", encoding="utf-8")
            (out / f"{name}.png").write_bytes(figure_png(figure))
        with (out / "frames.jsonl").open("w", encoding="utf-8") as file:
            for frame in _frames(store, evaluation.id):
                file.write(json_text(vars(frame), ascii_=True) + "\n")
    except OSError as error:
        raise InputError(f"{out} cannot hold the evaluation ({error.strerror})") from error


def evaluation_values(evaluation: StoredEvaluation) -> dict[str, Any]:
    """An evaluation as plain values."""
    return {**vars(evaluation), "figures": list(evaluation.figures)}


def _frames(store: Store, evaluation_id: int) -> Iterator[FrameResult]:
    place: int | None = 0
    while place is not None:
        page = list_frames(store, evaluation_id, FrameQuery(), MAX_PAGE, place)
        yield from page.items
        place = page.next

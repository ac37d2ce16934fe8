"""What an importer read, what it imported, and what it had to leave out and why."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from app.errors import DatasetFormatError, InputError, ReviewError

MAX_PROBLEMS = 10_000
"""Problems kept with their sentence; beyond, they are only counted."""

MAX_REMARKS = 200
"""Sentences that are kept."""


@dataclass
class ReaderReport:
    """Filled by a reader while it runs.

    Attributes:
        read: Records (groups, frames, cameras) that the files hold.
        imported: Records that were handed on.
        problems: One error per thing that was left out, each with file, record and field.
        counts: What else there was, by name: ``persons``, ``views without frame``.
        dropped: Problems beyond ``MAX_PROBLEMS``.
        remarks: What was decided for the files where they leave it open, a sentence each; nothing
            was left out by it.
    """

    read: int = 0
    imported: int = 0
    problems: list[DatasetFormatError] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)
    dropped: int = 0
    remarks: list[str] = field(default_factory=list)

    def add_problem(self, error: DatasetFormatError) -> None:
        """Note that something was left out; the reader goes on."""
        if len(self.problems) < MAX_PROBLEMS:
            self.problems.append(error)
        else:
            self.dropped += 1

    def add_problem_at(
        self, path: str, record: str | None, where: str | None, problem: str
    ) -> None:
        """The same from its parts."""
        self.add_problem(DatasetFormatError(path, record, where, problem))

    def add_problems_of(self, other: ReaderReport) -> None:
        """Note what another reader left out."""
        for error in other.problems:
            self.add_problem(error)
        self.dropped += other.dropped

    def add_remark(self, sentence: str) -> None:
        """Say once what was decided, or what there is besides."""
        if sentence not in self.remarks and len(self.remarks) < MAX_REMARKS:
            self.remarks.append(sentence)

    def make_refusal_error(self, nothing: str) -> ReviewError:
        """Why nothing was read: the first problem, else ``nothing``, a sentence."""
        return self.problems[0] if self.problems else InputError(nothing)


def list_first_problems(reports: Sequence[ReaderReport], most: int) -> dict[str, Any]:
    """What readers left out: ``problems``, at most so many, and how many ``more_problems`` there are."""
    every = [problem for report in reports for problem in report.problems]
    dropped = sum(report.dropped for report in reports)
    return {
        "problems": [
            {
                "file": Path(item.path).name,
                "record": item.record,
                "field": item.field,
                "problem": item.problem,
            }
            for item in every[:most]
        ],
        "more_problems": max(len(every) - most, 0) + dropped,
    }

"""Accepted truth: frames whose ball was once a prediction, which flatters what predicted it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from app.evaluation.frame import Frame
from app.evaluation.table import Table

WARNED = ("detection", "localization", "boxes")
"""Tables whose numbers it flatters."""


@dataclass(frozen=True)
class AcceptedTruth:
    """How many frames of a run have a ball that a person accepted from a prediction.

    Attributes:
        frames: From any set.
        own: From the very set that is evaluated.
        of: Frames with the box that is the truth.
    """

    frames: int
    own: int
    of: int

    @staticmethod
    def count(frames: Sequence[Frame], boxes: str, name: str | None) -> AcceptedTruth:
        """Count over frames that have a box of that kind; ``name`` is that of the evaluated set."""
        judged = [frame.predicted_by for frame in frames if boxes in frame.boxes]
        return AcceptedTruth(
            sum(map(bool, judged)),
            sum(source == name for source in judged if source),
            len(judged),
        )

    def warn(self, tables: Sequence[Table]) -> list[Table]:
        """The tables, those that are flattered with a warning in their note."""
        if not self.frames:
            return list(tables)
        own = f", {self.own} of them from the very set that is evaluated" if self.own else ""
        warning = (
            f"Warning: the ball of {self.frames} of {self.of} frames is an accepted "
            f"prediction{own}; such a truth flatters what predicted it."
        )
        return [
            replace(table, note=f"{table.note} {warning}".strip())
            if table.name in WARNED
            else table
            for table in tables
        ]

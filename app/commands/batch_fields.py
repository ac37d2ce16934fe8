"""What of a batch is printed, whether a home or a server has it."""

from __future__ import annotations

SHOWN = (
    "id",
    "dataset",
    "name",
    "state",
    "groups",
    "waiting",
    "handed_in",
    "settled",
    "due",
    "annotators",
    "reviewers",
    "query",
    "sort",
    "verdicts",
    "blind",
    "created",
    "created_by",
    "last",
)
"""Its fields, in this order."""

"""What is printed of a thing, in this order, whether a home or a server has it."""

from __future__ import annotations

BATCH = (
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
DATASET = ("id", "name", "groups", "solved", "accepted", "rejected", "deferred", "unreviewed")
IMPORT = (
    "outcome",
    "read",
    "imported",
    "new",
    "changed",
    "unchanged",
    "missing",
    "without_picture",
    "findings",
    "counts",
    "skipped",
    "more_skipped",
    "remarks",
)
VERSION = (
    "id",
    "dataset",
    "name",
    "hash",
    "created",
    "note",
    "groups",
    "counts",
    "split",
    "policy",
    "policy_hash",
    "solver_version",
    "software_version",
)

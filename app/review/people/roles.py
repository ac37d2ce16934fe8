"""Roles: what each of them may do. One table; nothing else decides it."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum

from app.errors import ForbiddenError


class Role(StrEnum):
    """What somebody is on this server; each may do what those before it may."""

    VIEWER = "viewer"
    ANNOTATOR = "annotator"
    REVIEWER = "reviewer"
    LEAD = "lead"
    ADMIN = "admin"


class Action(StrEnum):
    """What a request does."""

    ACCOUNT = "account"
    """Their own sessions and password."""
    READ = "read"
    """Look at datasets, groups, pictures, versions and files, and ask what if."""
    ANNOTATE = "annotate"
    """Lines, balls, cameras of a group; taking edits back; saved views."""
    REVIEW = "review"
    """Verdicts, one by one and in bulk; exports."""
    LEAD = "lead"
    """What concerns a whole dataset: thresholds, versions, imports, predictions, evaluations."""
    ADMINISTER = "administer"
    """People, deleting a dataset, the figures of the service."""


_RANKS = tuple(Role)
LEAST: Mapping[Action, Role] = {
    Action.ACCOUNT: Role.VIEWER,
    Action.READ: Role.VIEWER,
    Action.ANNOTATE: Role.ANNOTATOR,
    Action.REVIEW: Role.REVIEWER,
    Action.LEAD: Role.LEAD,
    Action.ADMINISTER: Role.ADMIN,
}
"""The first role that may."""


def may(role: Role, action: Action) -> bool:
    """Whether a role lets somebody do that."""
    return _RANKS.index(role) >= _RANKS.index(LEAST[action])


def require(role: Role, action: Action) -> None:
    """Raise ForbiddenError unless a role lets somebody do that."""
    if not may(role, action):
        raise ForbiddenError(
            f"this needs the role {LEAST[action]}; yours is {role}",
            hint="An admin of this server can change your role.",
        )

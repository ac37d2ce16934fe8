"""First policy: what judges a dataset that an import makes, when nobody names a policy.

See docs/decisions/0023-the-first-policy-follows-the-pictures.md.
"""

from __future__ import annotations

from collections.abc import Iterable

from app.soccer.group import Group
from app.soccer.policy import PAPER, TOUCHLINE, Policy

LEAST_SHARE = 0.5
"""Of the views whose paint could place their camera, so many must have a picture."""


def first_policy(groups: Iterable[Group]) -> Policy:
    """``touchline`` where most cameras can be drawn onto the paint of their pictures, else ``paper``.

    Args:
        groups: Those with which the dataset begins.
    """
    views = [view for group in groups for view in group.views if view.takes_paint]
    pictures = sum(view.media is not None for view in views)
    return TOUCHLINE if pictures > LEAST_SHARE * len(views) else PAPER

"""The policy of a dataset.

Datasets have a first policy, a present one and those before it, and change to another.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from app.db.session import Session
from app.db.store import Store
from app.features.datasets.service import read_dataset_head, save_policy
from app.features.groups.digest import digest
from app.features.groups.state import require_etag
from app.features.policies.queries import PolicyVersion, policy_history
from app.soccer.group import Group
from app.soccer.policy import ESTIMATED, PAPER, TOUCHLINE, Policy, with_sigmas


@dataclass(frozen=True)
class PolicyState:
    """What judges a dataset now; ``history`` is oldest first and ends with it."""

    dataset_id: int
    dataset: str
    policy: Policy
    history: tuple[PolicyVersion, ...]

    @property
    def version(self) -> int:
        """How many policies there have been."""
        return len(self.history)

    @property
    def etag(self) -> str:
        """Quoted, for ETag and If-Match."""
        return f'"{digest([self.dataset_id, self.version, self.policy.name, self.policy.hash])}"'


def read_policy(store: Store, dataset: str | int) -> PolicyState:
    """The policy of a dataset and its history.

    Raises:
        NotFoundError: There is no such dataset.
    """
    with store.read() as session:
        return _read_policy_state(session, dataset)


def change_policy(
    store: Store, dataset: str | int, policy: Policy, *, if_match: str | None, actor: str
) -> PolicyState:
    """Judge a dataset by another policy; what that leaves without a solution is stale.

    The same policy again changes nothing. Calibrations are known wherever the calibration part
    of the policy is.

    Args:
        store: The database.
        dataset: Name or id.
        policy: The policy.
        if_match: ETag of the policy that the change builds on; None: whatever it is.
        actor: Who wants it.

    Raises:
        NotFoundError: There is no such dataset.
        StaleRevisionError: Somebody else was faster.
    """
    with store.write() as session:
        return apply_policy(session, dataset, policy, if_match=if_match, actor=actor)


def apply_policy(
    session: Session, dataset: str | int, policy: Policy, *, if_match: str | None, actor: str
) -> PolicyState:
    """``change_policy`` within a write session."""
    state = _read_policy_state(session, dataset)
    if if_match is not None:
        require_etag(state.etag, if_match, f'the policy of "{state.dataset}"')
    if policy.noise == state.policy.noise == ESTIMATED:
        # What was estimated is the dataset's: it stays until the next solve.
        policy = with_sigmas(policy, state.policy)
    if policy == state.policy:
        return state
    save_policy(session, state.dataset_id, policy, actor)
    return _read_policy_state(session, state.dataset_id)


def _read_policy_state(session: Session, dataset: str | int) -> PolicyState:
    found = read_dataset_head(session, dataset)
    return PolicyState(found.id, found.name, found.policy, policy_history(session, found.id))


LEAST_SHARE = 0.5
"""Of the views whose paint could place their camera, so many must have a picture."""


def first_policy(groups: Iterable[Group]) -> Policy:
    """``touchline`` where most cameras can be drawn onto the paint of their pictures, else ``paper``.

    Args:
        groups: Those with which the dataset begins.
    """
    views = [view for group in groups for view in group.views if view.can_use_paint]
    pictures = sum(view.media is not None for view in views)
    return TOUCHLINE if pictures > LEAST_SHARE * len(views) else PAPER

"""The policy of a dataset, chosen by its name."""

from __future__ import annotations

from app.review.datasets import Dataset, get_dataset, set_policy
from app.soccer.policy import POLICIES
from app.store.session import Store


def choose_policy(store: Store, dataset: str, name: str, *, actor: str = "local") -> Dataset:
    """Judge a dataset by the policy of that name; the one that it has already changes nothing.

    Args:
        store: The database.
        dataset: Name or id.
        name: One of ``POLICIES``.
        actor: Who wants it.

    Raises:
        NotFoundError: There is no such dataset.
    """
    found, policy = get_dataset(store, dataset), POLICIES[name]
    if found.policy == policy:
        return found
    return set_policy(store, found.id, policy, actor=actor)

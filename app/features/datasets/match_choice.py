"""Match choice: what is known of one match of a dataset, or of all of them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol, TypeVar

from app.errors import NotFoundError


class MatchState(Protocol):
    """Something that is known of one match."""

    @property
    def match(self) -> str:
        """Its name; empty: groups without a match."""


State = TypeVar("State", bound=MatchState)


def of_match(states: Iterable[State], match: str | None) -> list[State]:
    """What is known of one match, or of all where ``match`` is None."""
    return [state for state in states if match in (None, state.match)]


def need_match(states: Iterable[State], match: str | None, dataset: str) -> list[State]:
    """``of_match``.

    Raises:
        NotFoundError: The dataset has no match of that name.
    """
    chosen = of_match(states, match)
    if match is not None and not chosen:
        raise no_match(dataset, match)
    return chosen


def no_match(dataset: str, match: str) -> NotFoundError:
    """The error where a dataset has no match of some name."""
    return NotFoundError(f'"{dataset}" has no match {match}')

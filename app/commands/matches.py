"""Matches of a dataset as commands choose and print them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
from typing import Any, Protocol, TypeVar

from app.commands.terminal import print_rows
from app.errors import InputError


class MatchState(Protocol):
    """Something that is known of one match."""

    @property
    def match(self) -> str:
        """Its name; empty: groups without a match."""


State = TypeVar("State", bound=MatchState)


def of_match(states: Iterable[State], match: str | None) -> list[State]:
    """What is known of the match that ``--match`` names, or of all where it names none."""
    return [state for state in states if match in (None, state.match)]


def need_match(states: Iterable[State], match: str | None, dataset: str) -> list[State]:
    """``of_match``; raises InputError where a dataset has no match of that name."""
    chosen = of_match(states, match)
    if match is not None and not chosen:
        raise InputError(f'"{dataset}" has no match {match}')
    return chosen


def print_sentences(states: Iterable[Any], as_json: bool) -> None:
    """The sentence of each match after its name, or the values of all as one JSON list."""
    print_rows(
        states,
        as_json,
        lambda state: {**asdict(state), "sentence": state.sentence},
        lambda state: f"{state.match}: {state.sentence}" if state.match else state.sentence,
    )

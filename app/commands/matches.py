"""Matches of a dataset as commands print them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

from app.commands.terminal import print_rows


def print_sentences(states: Iterable[Any], as_json: bool) -> None:
    """The sentence of each match after its name, or the values of all as one JSON list."""
    print_rows(
        states,
        as_json,
        lambda state: {**asdict(state), "sentence": state.sentence},
        lambda state: f"{state.match}: {state.sentence}" if state.match else state.sentence,
    )

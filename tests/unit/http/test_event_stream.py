"""Events: what a listener is told of what is gone."""

from __future__ import annotations

import asyncio

import pytest

from app.features.people.visibility_queries import EVERYTHING, Visibility
from app.features.queue.changes import LoggedChange
from app.http.event_stream import EventListener, _change_event, make_first_event


@pytest.mark.parametrize(
    ("sight", "entry", "told"),
    [
        (Visibility(True, frozenset({9}), "ann", frozenset()), 9, False),
        (Visibility(True, frozenset({9}), "ann", frozenset()), 11, True),
        (Visibility(False, frozenset({9}), "ann"), 11, False),
        (EVERYTHING, 9, True),
    ],
)
def test_who_comes_once_a_dataset_is_gone_is_told_of_it_only_if_they_see_everything(
    sight: Visibility, entry: int, told: bool
) -> None:
    async def ask() -> bool:
        feed = EventListener(None, 5, 2, sight, began=10)
        return feed.listens_to_change(LoggedChange(entry, 3, None, "delete", "eve"))

    assert asyncio.run(ask()) is told


def test_who_annotates_blind_is_told_no_id_of_the_log() -> None:
    told = [
        _change_event(LoggedChange(41, 3, "demo", "verdict", "eve", 7, "x"), "41-12"),
        make_first_event("41-12"),
    ]

    async def read(numbered: bool) -> bytes:
        feed = EventListener(None, 5, 2, EVERYTHING, began=10, numbered=numbered)
        feed.take(told)
        feed.take([], ended=True)
        return b"".join([event async for event in feed.read()])

    assert asyncio.run(read(True)) == b"".join(told)
    plain = asyncio.run(read(False))
    assert b"41" not in plain and b"12" not in plain and plain.count(b"id: 0\n") == 2

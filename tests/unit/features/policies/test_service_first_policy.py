"""Which policy a dataset begins with."""

from __future__ import annotations

from dataclasses import replace

import pytest

from app.features.policies.service import choose_first_policy
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Media, Station, View
from app.soccer.policy import PAPER, TOUCHLINE

SIZE = ImageSize(960, 540)
LINES = {"Middle line": ()}


def group(pictures: int, views: int = 4, **station: object) -> Group:
    """Views with lines, so many of them with a picture."""
    return Group(
        "g",
        tuple(
            View(
                f"{n}",
                replace(Station(f"{n}", SIZE, lines=LINES), **station),
                media=Media(f"{n}.jpg") if n < pictures else None,
            )
            for n in range(views)
        ),
    )


@pytest.mark.parametrize(
    ("pictures", "policy"), [(4, TOUCHLINE), (3, TOUCHLINE), (2, PAPER), (0, PAPER)]
)
def test_it_uses_paint_where_more_than_half_of_the_pictures_are_there(pictures, policy):
    assert choose_first_policy([group(pictures)]) == policy


@pytest.mark.parametrize("station", [{"shared": True}, {"lines": {}}], ids=["static", "no lines"])
def test_pictures_that_place_no_camera_do_not_count(station):
    assert choose_first_policy([group(4, **station)]) == PAPER
    assert choose_first_policy([group(4, **station), group(3, 4)]) == TOUCHLINE


def test_a_dataset_without_groups_gets_the_policy_of_the_paper():
    assert choose_first_policy([]) == PAPER

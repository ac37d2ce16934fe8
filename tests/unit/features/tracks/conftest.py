"""A dataset of a ball in flight before four static cameras, solved."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.flights import flight_groups


@pytest.fixture
def flight(fill: Callable[..., list[int]]) -> list[int]:
    """Ids of its groups, in the dataset *demo*."""
    return fill(*flight_groups(60))

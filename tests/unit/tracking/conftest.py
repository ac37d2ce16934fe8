"""One rendered film for all tests of tracking."""

from __future__ import annotations

import pytest

from tests.tripod_films import Film, render_film


@pytest.fixture(scope="session")
def film() -> Film:
    """A pan with a zoom, 1280 x 720."""
    return render_film()

"""Scenes that several test files look at, made once."""

from __future__ import annotations

import pytest

from app.sample.scene import Scene
from tests.scenes import make_scenes

SEED = 20_260_101


@pytest.fixture(scope="session")
def clean_scenes() -> list[Scene]:
    return make_scenes(40, SEED, faults=False)


@pytest.fixture(scope="session")
def faulty_scenes() -> list[Scene]:
    return make_scenes(120, 4, faults=True)

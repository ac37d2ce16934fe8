"""Accepted runs of a linked view say where a view has to show the ball."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.db.store import Store
from app.features.recordings.follow_hints import follow_hints
from app.features.recordings.service import get_recording
from tests.linked_recording import FRAMES, LIVE, LinkedRecording, views


@pytest.fixture
def store(app: Any) -> Store:
    found: Store = app.state.services.store
    return found


@pytest.fixture
def recording(
    api: Any, store: Store, film: Path, finished: Callable[[Any], Any]
) -> LinkedRecording:
    return LinkedRecording(api, store, film, finished, [])


class TestFollowHints:
    @pytest.mark.parametrize(("accepted", "frames"), [(0, range(LIVE, FRAMES)), (1, range(LIVE))])
    def test_the_run_of_the_other_view_says_where_the_ball_is(
        self, store: Store, recording: LinkedRecording, accepted: int, frames: range
    ) -> None:
        recording.accept(accepted)
        hints = follow_hints(store, get_recording(store, recording.id), frames)
        assert set(hints.cameras) == set(frames)
        pixels = views()[1 - accepted].pixels
        assert len(hints.places) > 50 and set(hints.places) <= set(frames)
        off = []
        for number, place in hints.places.items():
            beside = pixels[number - frames[0]] - (place.x, place.y)
            off.append(beside @ np.linalg.solve(place.covariance, beside))
        assert np.mean(np.array(off) < 9.21) > 0.9
        narrow = [np.linalg.eigvalsh(place.covariance)[0] for place in hints.places.values()]
        assert np.median(np.sqrt(narrow)) < 20

    def test_a_run_that_nobody_accepted_says_nothing(
        self, store: Store, recording: LinkedRecording
    ) -> None:
        hints = follow_hints(store, get_recording(store, recording.id), range(LIVE))
        assert hints.places == {} and len(hints.cameras) == LIVE

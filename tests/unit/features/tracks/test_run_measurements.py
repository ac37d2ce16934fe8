"""Accepted ball runs of a recording and of its linked replay measure the ball between groups."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.db.store import Store
from app.features.tracks.around import compute_track_excerpt
from app.features.tracks.service import TrackDetail, list_tracks, make_tracks, read_track_detail
from tests.bench.link import at_times
from tests.linked_recording import (
    BALL,
    BEGIN,
    FPS,
    FRAMES,
    LIVE,
    SIGMA_PX,
    SPEED,
    TIMES,
    UNSURE,
    LinkedRecording,
)

GROUPS = [30, 60]


@pytest.fixture
def store(app: Any) -> Store:
    found: Store = app.state.services.store
    return found


@pytest.fixture
def recording(
    api: Any, store: Store, film: Path, finished: Callable[[Any], Any]
) -> LinkedRecording:
    return LinkedRecording(api, store, film, finished, GROUPS)


def made(store: Store) -> TrackDetail:
    make_tracks(store, "cup", None, "ann", lambda *_: None)
    (track,) = list_tracks(store, "cup")
    return read_track_detail(store, track.id)


class TestFollowedRuns:
    def test_every_accepted_frame_measures_the_ball(
        self, store: Store, recording: LinkedRecording
    ) -> None:
        assert made(store).ball.reason is not None
        recording.accept(0)
        recording.accept(1)
        (before,) = list_tracks(store, "cup")
        assert before.stale
        detail = made(store)
        assert not detail.track.stale and detail.ball.reason is None
        measured = detail.inputs.measurements
        assert (detail.track.first, detail.track.last) == (0, LIVE - 1)
        assert measured.view_names == ("final", "final link 1")
        is_live = np.array([name == "final" for name in measured.views])
        # Not what is uncertain, and not what groups show: people say there where the ball is.
        assert set(measured.frames[is_live]) == set(range(LIVE)) - {*UNSURE, *GROUPS}
        shown = BEGIN + SPEED * np.arange(FRAMES - LIVE) / FPS
        assert set(measured.times[~is_live].round(3)) == set(np.delete(shown, UNSURE).round(3))
        assert measured.sigma == pytest.approx(SIGMA_PX)
        assert np.allclose(detail.ball.times, TIMES)
        off = np.linalg.norm(detail.ball.position - at_times(BALL, TIMES), axis=1)
        both = np.array([state == "measured" for state in detail.ball.state])
        assert both.sum() > 50 and np.median(off[both]) < 0.05

    def test_the_frames_around_one_have_them_too(
        self, store: Store, recording: LinkedRecording
    ) -> None:
        recording.accept(0)
        recording.accept(1)
        around = compute_track_excerpt(store, made(store).track.id, 60)
        assert around.ball.reason is None
        assert set(around.inputs.measurements.views) == {"final", "final link 1"}

    def test_a_run_that_is_taken_back_measures_nothing(
        self, store: Store, recording: LinkedRecording
    ) -> None:
        recording.accept(0)
        assert made(store).inputs.measurements.view_names == ("final",)
        recording.accept(0, False)
        (track,) = list_tracks(store, "cup")
        assert track.stale
        assert len(made(store).inputs.measurements) == 0

"""Accepted ball runs of a recording and of its linked replay measure the ball between groups."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.db.store import Store
from app.features.recordings.ball_run_values import run_to_columns
from app.features.recordings.ball_runs import get_ball_run
from app.features.recordings.queries import update_ball_run
from app.features.tracks.around import compute_track_excerpt
from app.features.tracks.schemas import TrackFrames
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

    def test_a_frame_that_becomes_a_group_goes_on_measuring_it(
        self,
        api: Any,
        app: Any,
        store: Store,
        recording: LinkedRecording,
        finished: Callable[[Any], Any],
    ) -> None:
        recording.accept(0)
        recording.accept(1)
        before = made(store).inputs.measurements
        asked = {"frames": [45], "propose": False, "linked": True}
        job = finished(api.post(f"{recording.path}/groups", json=asked))
        assert (job.result["new"], job.result["linked_views"]) == (1, 1)
        app.state.services.jobs.wait(job.result["solve_job"], 60)
        after = made(store).inputs.measurements
        pairs = [sorted(zip(one.frames, one.views, strict=True)) for one in (before, after)]
        assert pairs[0] == pairs[1] and (45, "final link 1") in pairs[1]

    def test_one_that_contradicts_the_track_without_a_group_is_clicked_again(
        self, store: Store, recording: LinkedRecording
    ) -> None:
        run = get_ball_run(store, recording.id, recording.runs[0]).run
        off = [replace(ball, x=ball.x + 60 * (ball.frame == 45)) for ball in run.balls]
        with store.write() as session:
            columns = run_to_columns(replace(run, balls=tuple(off)))
            update_ball_run(session, recording.runs[0], **columns)
        recording.accept(0)
        recording.accept(1)
        found = TrackFrames.of(made(store), 45, 45).contradicted
        assert [(one.view, one.group) for one in found] == [("final", None)]
        assert "Click the followed ball again" in found[0].fix

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

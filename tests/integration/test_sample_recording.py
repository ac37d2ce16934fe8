"""The sample's recording, found again by parts of the product that never saw how it was drawn."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.sample.recording import ShotPlan, write_recording
from tests.bench.recording import KnownRecording, compared, link_errors

PARTS = (
    ShotPlan("main", 3.0, "start"), ShotPlan("closeup", 1.2), ShotPlan("main", 3.2),
    ShotPlan("replay", 3.6, "wipe", 0.5, 0), ShotPlan("main", 2.4, "wipe"),
    ShotPlan("other", 1.6), ShotPlan("main", 2.4, "dissolve"),
)  # fmt: skip


@pytest.fixture(scope="module")
def known(tmp_path_factory: pytest.TempPathFactory) -> KnownRecording:
    out = tmp_path_factory.mktemp("recording") / "film.mp4"
    write_recording(out, parts=PARTS)
    return KnownRecording.open(out)


class TestRecordingOfTheSample:
    def test_every_shot_is_found_at_its_frames_with_its_kind(self, known: KnownRecording) -> None:
        found = known.found_shots()
        truth = known.truth["shots"]
        assert [(one.kind, one.entered_by) for one in found] == [
            (one["kind"], one["entered_by"]) for one in truth
        ]
        for one, other in zip(found, truth, strict=True):
            slack = 0 if other["entered_by"] in ("start", "cut") else 2
            assert abs(one.first - other["first"]) <= slack, other
        flown = [one.logo for one in found]
        assert flown[3] == flown[4] is not None
        assert flown.count(None) == len(flown) - 2

    def test_who_runs_before_bare_grass_is_one_shot(self, tmp_path: Path) -> None:
        """A long lens runs along with somebody, too fast to be followed, while other grass comes into view."""
        write_recording(tmp_path / "film.mp4", parts=[ShotPlan("closeup", 5, "start")], since=27.0)
        (shot,) = KnownRecording.open(tmp_path / "film.mp4").found_shots()
        assert (shot.first, shot.last, shot.kind) == (0, 124, "closeup")

    def test_a_live_shot_is_tracked_with_the_cameras_that_took_it(
        self, known: KnownRecording
    ) -> None:
        share, pixels, metres = compared(known.tracked(2), known.rows(2))
        assert share >= 0.97
        assert np.median(pixels) < 1.0
        assert np.percentile(pixels, 95) < 3.0
        assert np.median(metres) < 0.2

    def test_a_replay_is_linked_from_its_ball(self, known: KnownRecording) -> None:
        (link,) = known.truth["links"]
        outcome, frames, percent, _ = link_errors(known, link, known.linked(link, 0.3))
        assert outcome == "linked"
        assert abs(float(str(frames))) < 0.1
        assert abs(float(str(percent))) < 1.0

"""ISSIA's six cameras adjusted together, judged on blocks of time that they did not see."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from app.datasets.issia_reader import IssiaOptions, open_issia
from app.datasets.report import Report
from app.soccer.pitch import Pitch
from app.soccer.policy import PAPER
from app.solving.rig import RigCamera, RigFrame
from app.solving.rig_proposal import RigProposal, propose_rig

DATA = Path(os.environ.get("TOUCHLINE_REAL_DATA", Path(__file__).parents[3] / "shared" / "data"))
pytestmark = pytest.mark.skipif(
    not (DATA / "issia-lines").is_dir(), reason=f"no real data in {DATA}"
)


@pytest.fixture(scope="module")
def proposal() -> RigProposal:
    options = IssiaOptions(lines=DATA / "issia-lines")
    groups = list(open_issia(DATA / "issia", options, Report()).groups())
    stations = {view.station.key: view.station for group in groups for view in group.views}
    cameras = [
        RigCamera(key, station.size, station.lines, station.given)
        for key, station in sorted(stations.items())
    ]
    frames = [
        RigFrame(
            int(group.key),
            {view.station.key: view.ball.center for view in group.views if view.ball is not None},
        )
        for group in groups
    ]
    return propose_rig(cameras, frames, Pitch(), PAPER)


class TestIssia:
    @pytest.mark.parametrize(
        ("a", "b", "before", "after"),
        [("cam3", "cam4", 8.0, 1.1), ("cam1", "cam2", 5.0, 1.1), ("cam5", "cam6", 3.0, 0.7)],
    )
    def test_rays_meet_in_time_that_was_held_out(self, proposal, a, b, before, after):
        pair = next(item for item in proposal.pairs if (item.a, item.b) == (a, b))
        assert pair.held_out > 100
        assert pair.held_out_before_px > before
        assert pair.held_out_after_px < after

    def test_no_camera_is_ahead(self, proposal):
        known = [pair for pair in proposal.pairs if pair.offset_frames is not None]
        assert len(known) >= 4
        for pair in known:
            assert abs(pair.offset_frames) < max(0.02, 2 * pair.offset_sigma_frames)

    def test_lines_hold_the_rig_in_its_place(self, proposal):
        assert proposal.line_points == 66
        assert proposal.ball_moved_m < 0.5
        for change in proposal.cameras:
            assert change.lines_after_px < change.lines_before_px

"""ISSIA's six cameras adjusted together, judged on blocks of time that they did not see."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.formats.issia_reader import IssiaOptions, open_issia
from app.formats.report import ReaderReport
from app.soccer.annotation import make_lines
from app.soccer.group import Group
from app.soccer.pitch import Pitch
from app.soccer.policy import PAPER
from app.solving.rig_proposal import RigProposal, propose_rig
from app.solving.solve import solve_group
from tests.bench.rigs import rig_of

DATA = Path(os.environ.get("TOUCHLINE_REAL_DATA", Path(__file__).parents[3] / "shared" / "data"))
pytestmark = pytest.mark.skipif(
    not (DATA / "issia-lines").is_dir(), reason=f"no real data in {DATA}"
)


EVERY = 10
"""Instants whose normalised gaps are looked at; neighbours are alike."""


@pytest.fixture(scope="module")
def groups() -> list[Group]:
    options = IssiaOptions(lines=DATA / "issia-lines")
    return list(open_issia(DATA / "issia", options, ReaderReport()).groups())


@pytest.fixture(scope="module")
def proposal(groups) -> RigProposal:
    return propose_rig(*rig_of(groups), Pitch(), PAPER)


def with_sigma(group: Group, proposal: RigProposal) -> Group:
    """The group with the cameras in use and what is proposed of their errors, without lines."""
    spreads = {change.key: change.covariance_before for change in proposal.cameras}
    for view in group.views:
        spread = spreads.get(view.station.key)
        station = replace(view.station, given_covariance=spread, lines=make_lines({}))
        group = group.with_view(replace(view, station=station))
    return group


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

    def test_gaps_are_as_large_as_the_accepted_sigma_says(self, groups, proposal):
        """In the mean square, and 95 % of them as chi-square has it."""
        pairs = [group for group in groups if sum(v.ball is not None for v in group.views) == 2]
        solved = [solve_group(with_sigma(group, proposal), PAPER) for group in pairs[::EVERY]]
        squares = [it.chi_square.value for it in solved if it.passes and it.chi_square is not None]
        assert len(squares) > 150
        assert np.sqrt(np.mean(squares)) == pytest.approx(1.0, abs=0.2)
        assert np.sqrt(np.percentile(squares, 95)) == pytest.approx(1.96, rel=0.2)

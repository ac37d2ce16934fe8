from __future__ import annotations

import numpy as np
import pytest

from app.tracking.link_kernels import score_ray_meetings

ROOM = np.array([(-60.0, 60.0), (-40.0, 40.0), (-45.0, 1.5)])


def scores(centres, shifts, live, replay, known=None):
    return score_ray_meetings(
        np.array(centres), np.array(shifts, dtype=float), live,
        np.ones(len(live), bool) if known is None else known,
        0.0, replay, np.zeros(len(replay)), ROOM, 0.25, 16.0, 0.1,
    )  # fmt: skip


def ray(position, target):
    way = np.subtract(target, position)
    return [*position, *(way / np.linalg.norm(way))]


class TestMeetingScores:
    LIVE = np.array([ray((0.0, 60.0, -15.0), (x, 0.0, -1.0)) for x in range(5)])

    def test_rays_that_meet_count_for_and_those_that_miss_against(self) -> None:
        replay = np.array([ray((-60.0, 0.0, -5.0), (2.0, 0.0, -1.0))])
        met, missed = scores([2, 0], [0.0], self.LIVE, replay)
        assert met == pytest.approx(np.log(0.1 + 16 / np.sqrt(2 * np.pi * 0.25)))
        beside = np.array([ray((-60.0, 30.0, -5.0), (2.0, 9.0, -8.0))])
        assert scores([2], [0.0], self.LIVE, beside)[0] == pytest.approx(np.log(0.1), abs=0.05)
        assert missed < met

    def test_a_miss_is_judged_by_its_distance(self) -> None:
        # Seen from the side 0.5 m above the other ray: one sigma.
        live = np.array([[0.0, 30.0, -1.0, 0.0, -1.0, 0.0]])
        replay = np.array([[-30.0, 0.0, -1.5, 1.0, 0.0, 0.0]])
        density = 16 / np.sqrt(2 * np.pi * 0.25) * np.exp(-0.5)
        assert scores([0], [0.0], live, replay)[0] == pytest.approx(np.log(0.1 + density))

    def test_no_ball_is_behind_a_camera_or_outside(self) -> None:
        live = np.array([[0.0, 30.0, -1.0, 0.0, -1.0, 0.0]])
        behind = np.array([[-30.0, 0.0, -1.0, -1.0, 0.0, 0.0]])
        outside = np.array([[-30.0, -39.0, -1.0, 1.0, 0.0, 0.0]])
        for replay in (behind, outside - [0, 5.0, 0, 0, 0, 0]):
            assert scores([0], [0.0], live, replay)[0] == pytest.approx(np.log(0.1))

    def test_what_has_no_partner_says_nothing(self) -> None:
        replay = np.array([ray((-60.0, 0.0, -5.0), (2.0, 0.0, -1.0))] * 2)
        assert scores([2], [-9.0, 9.0], self.LIVE, replay)[0] == 0.0
        assert scores([2], [0.0, 0.0], self.LIVE, replay, np.zeros(5, bool))[0] == 0.0

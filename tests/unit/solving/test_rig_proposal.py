from dataclasses import replace

import numpy as np
import pytest

from app.geometry.bundle import linearize, optimize_points, ray_pair_distances_px
from app.geometry.resection import parameters_from_camera
from app.soccer.frames import ImagePoint
from app.soccer.pitch import Pitch
from app.soccer.policy import PAPER
from app.solving.rig import RigFrame, make_rig
from app.solving.rig_proposal import BLOCK, compute_error_covariance, propose_rig
from tests.cameras import SIZE
from tests.rigs import GIVEN, TRUTH, cameras, frames, off


@pytest.fixture(scope="module")
def proposal():
    return propose_rig(cameras(), frames(), Pitch(), PAPER)


def pair(proposal, a="cam1", b="cam2"):
    return next(item for item in proposal.pairs if (item.a, item.b) == (a, b))


class TestProposeRig:
    def test_cameras_that_never_saw_an_instant_agree_in_it(self, proposal):
        found = pair(proposal)
        assert found.held_out > 25
        assert found.held_out_before_px > 3.0
        assert found.held_out_after_px < 1.0

    def test_what_is_held_out_was_not_adjusted_to(self):
        seen = frames()
        for place, frame in enumerate(seen):
            if frame.time // BLOCK % 2 and "cam2" in frame.balls:
                x, y = frame.balls["cam2"]
                bumped = {**frame.balls, "cam2": ImagePoint(x + 6.0, y)}
                seen[place] = RigFrame(frame.time, bumped)
        found = pair(propose_rig(cameras(), seen, Pitch(), PAPER))
        assert found.held_out_after_px > found.after_px + 1.0

    def test_says_how_far_each_camera_moves(self, proposal):
        for change in proposal.cameras:
            true, given = TRUTH[change.key], GIVEN[change.key]
            assert change.before == given
            assert change.moved_m == pytest.approx(
                np.linalg.norm(change.after.position - given.position)
            )
            assert change.picture_px > 2.0
            assert change.lines_after_px < change.lines_before_px
            apart = np.linalg.norm(change.after.position - true.position)
            assert apart < 4 * change.position_sigma_m

    def test_how_far_the_camera_in_use_may_be_off_covers_the_truth(self, proposal):
        for change in proposal.cameras:
            sure = np.reshape(change.covariance, (8, 8))
            wide = np.reshape(change.covariance_before, (8, 8))
            assert np.linalg.eigvalsh(wide - sure)[0] > -1e-9
            off = GIVEN[change.key].position - TRUTH[change.key].position
            assert (np.abs(off) < 3 * np.sqrt(np.diag(wide)[3:6])).all()

    def test_cameras_of_one_time_are_not_ahead(self, proposal):
        found = pair(proposal)
        assert abs(found.offset_frames) < 4 * max(found.offset_sigma_frames, 0.005)
        assert found.offset_sigma_frames < 0.05

    def test_a_camera_that_is_ahead_is_seen(self):
        found = pair(propose_rig(cameras(), frames(ahead={"cam2": 0.4}), Pitch(), PAPER))
        assert found.offset_frames == pytest.approx(0.4, abs=0.12)
        assert found.offset_frames > 4 * found.offset_sigma_frames

    def test_ahead_is_to_show_a_later_instant_under_the_same_number(self):
        # Frame t of camera 2 is what it would have shown at t + 1.
        early = frames()
        following = {frame.time: frame.balls.get("cam2") for frame in early}
        seen = []
        for frame in early:
            balls = {key: at for key, at in frame.balls.items() if key != "cam2"}
            if (later := following.get(frame.time + 1)) is not None:
                balls["cam2"] = later
            seen.append(RigFrame(frame.time, balls))
        found = pair(propose_rig(cameras(), seen, Pitch(), PAPER))
        assert found.offset_frames > max(0.3, 4 * found.offset_sigma_frames)

    def test_nothing_can_be_held_out_of_one_block(self):
        found = pair(propose_rig(cameras(), frames(45), Pitch(), PAPER))
        assert (found.held_out, found.held_out_after_px) == (0, None)


TRUE = np.array([parameters_from_camera(camera, SIZE.diagonal / 2) for camera in TRUTH.values()])
ERRORS = np.array([0.003, 0.002, 0.0015, 0.5, 0.8, 0.4, 0.01, 0.004])
"""Standard deviations of the parameters of cameras that are off."""
RIGS = 12


def gaps_of(seed: int) -> np.ndarray:
    """Gaps of the rays of two cameras that are off, each in units of its sigma."""
    rng = np.random.default_rng(seed)
    given = {key: off(camera, rng.normal(size=8) * ERRORS) for key, camera in TRUTH.items()}
    rig, _ = make_rig(cameras(lines=False, given=given), frames(120), Pitch(), PAPER)
    balls = optimize_points(TRUE, rig.rays, np.inf)
    covariances = np.array(
        [
            compute_error_covariance(
                camera, TRUE[row], balls[rig.rays.point[rig.rays.camera == row]]
            )
            for row, camera in enumerate(rig.cameras)
        ]
    )
    rays, _ = rig.rays.select_common_points(0, 1)
    _, signed, free = ray_pair_distances_px(rig.initial_parameters, rays)
    at = linearize(
        rig.initial_parameters, optimize_points(rig.initial_parameters, rays, np.inf), rays
    )
    order = np.argsort(rays.point, kind="stable").reshape(-1, 2)
    slopes = np.einsum("nsi,nsia->nsa", free.reshape(-1, 2, 2), at.by_camera[order])
    carried = np.einsum("nsa,nsab,nsb->n", slopes, covariances[rays.camera[order]], slopes)
    return np.abs(signed) / np.sqrt(1 + carried)


@pytest.fixture(scope="module")
def rig():
    return make_rig(cameras(), frames(60), Pitch(), PAPER)[0]


class TestErrorCovariance:
    def test_moves_balls_in_the_mean_square_as_far_as_the_error_does(self, rig):
        camera, balls = rig.cameras[0], optimize_points(TRUE, rig.rays, np.inf)
        covariance = compute_error_covariance(camera, TRUE[0], balls)
        moved = camera.camera.project(balls) - TRUTH["cam1"].project(balls)
        rng = np.random.default_rng(5)
        draws = rng.multivariate_normal(TRUE[0], covariance, 400)
        apart = [
            camera.camera_of_parameters(row).project(balls) - TRUTH["cam1"].project(balls)
            for row in draws
        ]
        assert np.mean(np.square(apart)) == pytest.approx(np.mean(moved**2), rel=0.2)

    def test_any_error_is_possible(self, rig):
        covariance = compute_error_covariance(
            rig.cameras[0], TRUE[0], optimize_points(TRUE, rig.rays, np.inf)
        )
        lengths = np.sqrt(np.diag(covariance))
        assert np.linalg.eigvalsh(covariance / np.outer(lengths, lengths))[0] > 1e-6

    def test_gaps_of_rays_are_as_large_as_chi_square_has_them(self):
        gaps = np.concatenate([gaps_of(seed) for seed in range(RIGS)])
        assert np.sqrt(np.mean(gaps**2)) == pytest.approx(1.0, abs=0.2)
        assert np.percentile(gaps, 95) == pytest.approx(1.96, rel=0.2)

    def test_a_camera_that_stands_right_is_not_off(self, rig):
        camera = replace(rig.cameras[0], camera=rig.cameras[0].camera_of_parameters(TRUE[0]))
        own = camera.parameters
        assert (
            compute_error_covariance(camera, own, optimize_points(TRUE, rig.rays, np.inf)) == 0
        ).all()

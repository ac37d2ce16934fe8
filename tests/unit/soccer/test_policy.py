from dataclasses import replace

from app.soccer.policy import PAPER, STRICT, CalibrationPolicy


class TestHash:
    def test_the_name_does_not_count(self):
        assert replace(PAPER, name="mine").hash == PAPER.hash

    def test_every_threshold_counts(self):
        assert replace(PAPER, tau_percent=0.9).hash != PAPER.hash
        assert STRICT.hash != PAPER.hash

    def test_tau_leaves_calibrations_alone(self):
        assert replace(PAPER, tau_percent=0.9).calibration_hash == PAPER.calibration_hash
        other = replace(PAPER, calibration=CalibrationPolicy(check_labels=False))
        assert other.calibration_hash != PAPER.calibration_hash


class TestPaper:
    def test_holds_the_values_recovered_from_the_published_dataset(self):
        assert (PAPER.tau_percent, PAPER.ball_diameter_m) == (1.0, 0.226)
        assert (PAPER.jac_gamma_percent, PAPER.min_jac, PAPER.min_baseline_m) == (0.5, 0.75, 1.0)

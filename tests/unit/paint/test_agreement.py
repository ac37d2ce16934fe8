"""Agreement: a camera and the paint, without labels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.paint.agreement import (
    measure_agreement,
    measure_agreement_with_clear_paint,
    measure_strength_near_markings,
)
from app.paint.ridges import find_line_like_pixels, measure_line_strength
from app.soccer.pitch import Pitch
from tests.unit.paint.test_snap import panned


class TestAgreement:
    def test_the_true_camera_is_supported_and_the_turned_one_is_not(self, rendered):
        paint = find_line_like_pixels(rendered.image, rendered.field)
        right = measure_agreement(rendered.truth, rendered.field, paint)
        wrong = measure_agreement(panned(rendered.truth, 25.0), rendered.field, paint)
        assert right.supported > 0.8 and right.explained > 0.5
        assert wrong.combined_score < right.combined_score / 3

    def test_the_picture_itself_may_be_given(self, rendered):
        paint = find_line_like_pixels(rendered.image, rendered.field)
        assert measure_agreement(
            rendered.truth, rendered.field, rendered.image
        ) == measure_agreement(rendered.truth, rendered.field, paint)

    def test_paint_that_no_marking_explains_lowers_explained_alone(self, rendered):
        paint = find_line_like_pixels(rendered.image, rendered.field)
        more = paint.copy()
        rows = np.nonzero(rendered.field.mean(axis=1) > 0.9)[0]
        more[rows[len(rows) // 2], ::2] = True
        before = measure_agreement(rendered.truth, rendered.field, paint)
        after = measure_agreement(rendered.truth, rendered.field, more)
        assert after.explained < before.explained - 0.02
        assert after.supported == pytest.approx(before.supported, abs=0.05)

    def test_without_paint_and_without_field_both_are_zero(self, rendered):
        nothing = np.zeros(rendered.field.shape, np.bool_)
        assert measure_agreement(rendered.truth, rendered.field, nothing).combined_score == 0
        assert measure_agreement(rendered.truth, nothing, nothing).points == 0


class TestClearPaint:
    """Faint ridges and what lies beyond the pitch are no paint that a camera has to explain."""

    @pytest.fixture
    def strength(self, rendered):
        return measure_line_strength(rendered.image, rendered.field)

    def explained(self, rendered, strength) -> tuple[float, float]:
        paint = measure_strength_near_markings(rendered.truth, rendered.field, strength, Pitch())
        clear = measure_agreement_with_clear_paint(
            rendered.truth, rendered.field, strength, Pitch(), paint
        )
        known = measure_agreement(rendered.truth, rendered.field, strength > 0)
        assert (clear.supported, clear.points) == (known.supported, known.points)
        return known.explained, clear.explained

    def places(self, rendered, on_pitch: bool):
        """Rows and columns on the field that the camera puts on the pitch, or far from it."""
        rows, columns = np.nonzero(rendered.field)
        at = rendered.truth.project_to_ground(np.column_stack([columns, rows]).astype(float))
        beyond = (np.abs(at[:, :2]) - (52.5, 34.0)).max(axis=1)
        kept = np.nan_to_num(beyond, nan=np.inf) < -1 if on_pitch else ~(beyond < 8)
        return rows[kept], columns[kept]

    def test_faint_ridges_are_left_out_and_strong_ones_are_not(self, rendered, strength):
        paint = measure_strength_near_markings(rendered.truth, rendered.field, strength, Pitch())
        rows, columns = (axis[::40] for axis in self.places(rendered, on_pitch=True))
        before = self.explained(rendered, strength)
        faint, strong = strength.copy(), strength.copy()
        faint[rows, columns] = np.maximum(strength[rows, columns], 0.3 * paint)
        strong[rows, columns] = np.maximum(strength[rows, columns], 0.8 * paint)
        known, clear = self.explained(rendered, faint)
        assert known < before[0] - 0.1 and clear == pytest.approx(before[1], abs=0.05)
        assert self.explained(rendered, strong)[1] < before[1] - 0.1

    def test_seats_as_green_as_grass_lie_beyond_the_pitch(self, rendered, strength):
        sky = np.ones_like(rendered.field)
        stand = replace(rendered, field=sky)
        before = self.explained(rendered, strength)[1]
        rows, columns = (axis[::20] for axis in self.places(stand, on_pitch=False))
        assert len(rows) > 500
        seats = strength.copy()
        seats[rows, columns] = strength.max()
        known, clear = self.explained(stand, seats)
        assert known < 0.6 * before and clear == pytest.approx(before, abs=0.05)

    def test_without_paint_nothing_is_explained(self, rendered, strength):
        nothing = np.zeros_like(strength)
        assert measure_strength_near_markings(rendered.truth, rendered.field, nothing, Pitch()) == 0
        assert self.explained(rendered, nothing) == (0, 0)

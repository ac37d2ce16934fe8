"""Agreement: a camera and the paint, without labels."""

from __future__ import annotations

import numpy as np
import pytest

from app.paint.agreement import agreement
from app.paint.ridges import line_like
from tests.unit.paint.test_snap import panned


class TestAgreement:
    def test_the_true_camera_is_supported_and_the_turned_one_is_not(self, rendered):
        paint = line_like(rendered.image, rendered.field)
        right = agreement(rendered.truth, rendered.field, paint)
        wrong = agreement(panned(rendered.truth, 25.0), rendered.field, paint)
        assert right.supported > 0.8 and right.explained > 0.5
        assert wrong.product < right.product / 3

    def test_the_picture_itself_may_be_given(self, rendered):
        paint = line_like(rendered.image, rendered.field)
        assert agreement(rendered.truth, rendered.field, rendered.image) == agreement(
            rendered.truth, rendered.field, paint
        )

    def test_paint_that_no_marking_explains_lowers_explained_alone(self, rendered):
        paint = line_like(rendered.image, rendered.field)
        more = paint.copy()
        rows = np.nonzero(rendered.field.mean(axis=1) > 0.9)[0]
        more[rows[len(rows) // 2], ::2] = True
        before = agreement(rendered.truth, rendered.field, paint)
        after = agreement(rendered.truth, rendered.field, more)
        assert after.explained < before.explained - 0.02
        assert after.supported == pytest.approx(before.supported, abs=0.05)

    def test_without_paint_and_without_field_both_are_zero(self, rendered):
        nothing = np.zeros(rendered.field.shape, np.bool_)
        assert agreement(rendered.truth, rendered.field, nothing).product == 0
        assert agreement(rendered.truth, nothing, nothing).points == 0

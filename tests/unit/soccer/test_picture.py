from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.errors import InputError
from app.geometry.camera import Camera
from app.soccer.frames import ImageSize
from app.soccer.picture import PictureGeometry, size_centred_on_principal_point
from tests.cameras import SIZE
from tests.unit.solving.conftest import BEHIND_GOAL, PITCH, click

PICTURE = PictureGeometry(1.25, (0.2, -0.1))


class TestPictureGeometry:
    def test_the_camera_of_the_picture_as_it_is_sees_what_the_lines_were_taken_from(self):
        points = PITCH.sample("Big rect. right main", 1.0, 1.0)
        shown = PICTURE.camera_of_annotated_picture(BEHIND_GOAL, SIZE).project(points)
        lines = PICTURE.lines_in_original_picture(
            {"Big rect. right main": [tuple(it) for it in shown]}, SIZE
        )
        (found,) = lines.values()
        np.testing.assert_allclose(np.array(found), BEHIND_GOAL.project(points), atol=1e-9)

    def test_nothing_that_was_done_changes_nothing(self):
        lines = click(BEHIND_GOAL)
        again = PictureGeometry().lines_in_original_picture(lines, SIZE)
        for name in lines:
            np.testing.assert_allclose(np.array(again[name]), np.array(lines[name]), atol=1e-9)

    @pytest.mark.parametrize(
        "numbers",
        [
            (0.4, (0.0, 0.0)),
            (2.5, (0.0, 0.0)),
            (float("nan"), (0.0, 0.0)),
            (1.0, (0.9, 0.0)),
            (1.0, (0.0, 0.0), (-0.1, 0.0, 0.0)),
        ],
    )
    def test_what_no_picture_can_be_is_refused(self, numbers):
        with pytest.raises(InputError):
            PictureGeometry(*numbers)


CAMERA = Camera(np.eye(3), np.zeros(3), (1000.0, 1000.0), (0.0, 0.0))
VIEW = ImageSize(1280, 720)


class TestOtherSize:
    @pytest.mark.parametrize(
        ("point", "size"),
        [
            ((479.5, 269.5), (960, 540)),
            ((480, 270), (960, 540)),
            ((959.5, 539.5), (1920, 1080)),
            ((359.5, 287.5), (720, 576)),
            ((499.5, 280.75), None),
            ((449.5, 252.625), None),
        ],
    )
    def test_the_middle_of_another_size_tells_it(
        self, point: tuple[float, float], size: tuple[int, int] | None
    ) -> None:
        found = size_centred_on_principal_point(replace(CAMERA, principal_point=point), VIEW)
        assert found == (None if size is None else ImageSize(*size))

    @pytest.mark.parametrize(
        "point", [(639.5, 359.5), (640, 360), (640.5, 360.5), (612.3, 344.9), (600.5, 300.5)]
    )
    def test_the_middle_of_the_view_and_estimated_points_tell_nothing(
        self, point: tuple[float, float]
    ) -> None:
        assert size_centred_on_principal_point(replace(CAMERA, principal_point=point), VIEW) is None

    def test_any_enlargement_of_the_view_is_a_size(self) -> None:
        found = size_centred_on_principal_point(
            replace(CAMERA, principal_point=(499.5, 249.5)), ImageSize(2000, 1000)
        )
        assert found == ImageSize(1000, 500)

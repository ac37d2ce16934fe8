from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.geometry.camera import Camera
from app.soccer.camera_size import size_centred_on_principal_point
from app.soccer.frames import ImageSize

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

"""The library's markings are the server's."""

from __future__ import annotations

import numpy as np
import pytest

from app.soccer.pitch import MARKINGS, Pitch, Segment
from touchline.pitch import markings


class TestMarkings:
    @pytest.mark.parametrize("size", [(105.0, 68.0), (100.0, 64.0)])
    def test_each_goes_from_end_to_end_where_the_server_has_it(self, size) -> None:
        found = markings(*size)
        assert set(found) == set(MARKINGS)
        for name, shape in Pitch(*size).shapes.items():
            points = found[name]
            if isinstance(shape, Segment):
                ends = {tuple(np.round(points[place], 12)) for place in (0, -1)}
                assert ends == {tuple(np.round(end, 12)) for end in (shape.start, shape.end)}
            else:
                away = points[:, :2] - shape.center
                assert np.hypot(*away.T) == pytest.approx(shape.radius)
                for place, angle in ((0, shape.first), (-1, shape.last)):
                    wanted = shape.radius * np.array([np.cos(angle), np.sin(angle)])
                    assert away[place] == pytest.approx(wanted)

    def test_no_step_is_longer_than_asked(self) -> None:
        for points in markings(step=0.1).values():
            assert np.linalg.norm(np.diff(points, axis=0), axis=1).max() <= 0.1 + 1e-12

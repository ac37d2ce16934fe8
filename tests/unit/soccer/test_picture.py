import numpy as np
import pytest

from app.errors import InputError
from app.soccer.picture import PictureGeometry
from tests.cameras import SIZE
from tests.unit.solving.conftest import BEHIND_GOAL, PITCH, click

PICTURE = PictureGeometry(1.25, (0.2, -0.1))


class TestPictureGeometry:
    def test_the_camera_of_the_picture_as_it_is_sees_what_the_lines_were_taken_from(self):
        points = PITCH.sample("Big rect. right main", 1.0, 1.0)
        shown = PICTURE.camera_of_shown_picture(BEHIND_GOAL, SIZE).project(points)
        lines = PICTURE.lines_as_taken({"Big rect. right main": [tuple(it) for it in shown]}, SIZE)
        (found,) = lines.values()
        np.testing.assert_allclose(np.array(found), BEHIND_GOAL.project(points), atol=1e-9)

    def test_nothing_that_was_done_changes_nothing(self):
        lines = click(BEHIND_GOAL)
        again = PictureGeometry().lines_as_taken(lines, SIZE)
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

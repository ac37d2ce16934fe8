from __future__ import annotations

import sys

import cv2
import numpy as np
import pytest

from app.errors import InputError
from app.evaluation.result import (
    HEIGHT,
    PALETTE,
    WIDTH,
    Axis,
    Chart,
    Panel,
    ReferenceLine,
    Series,
    figure_to_png,
)

LINE = Series("a", "A line", (0.0, 1.0), (0.0, 1.0))


def drawn(figure: Chart) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(figure_to_png(figure), np.uint8), cv2.IMREAD_COLOR)


def figure(*series: Series, **more) -> Chart:
    panel = Panel("P", Axis("x", "m"), Axis("y"), series, **more)
    return Chart("f", "Title", (panel,), "A note that says over what it was computed.")


def like(picture: np.ndarray, color: str) -> np.ndarray:
    """Where a picture has a colour (#rrggbb)."""
    red_green_blue = np.frombuffer(bytes.fromhex(color[1:]), np.uint8).astype(int)
    return np.abs(picture[:, :, ::-1].astype(int) - red_green_blue).max(axis=2) < 12


def count(picture: np.ndarray, color: str) -> int:
    return int(like(picture, color).sum())


class TestFigurePng:
    def test_has_a_place_for_each_panel(self) -> None:
        two = Chart("f", "T", figure(LINE).panels * 2)
        assert drawn(figure(LINE)).shape == (HEIGHT, WIDTH, 3)
        assert drawn(two).shape == (HEIGHT, 2 * WIDTH, 3)

    def test_draws_the_curve_and_not_without_it(self) -> None:
        assert count(drawn(figure(LINE)), PALETTE[0]) > 400
        assert count(drawn(figure()), PALETTE[0]) == 0

    def test_a_dashed_curve_has_gaps(self) -> None:
        dashed = Series("a", "", (0.0, 1.0), (0.0, 1.0), "dashed")
        whole = Series("a", "", (0.0, 1.0), (0.0, 1.0))
        share = count(drawn(figure(dashed)), PALETTE[0]) / count(drawn(figure(whole)), PALETTE[0])
        assert 0.4 < share < 0.8

    def test_a_mark_stands_where_it_should(self) -> None:
        picture = drawn(figure(LINE, marks=(ReferenceLine("x", 0.5, "half"),)))
        columns = np.flatnonzero(like(picture, PALETTE[4]).any(axis=0))
        curve = np.flatnonzero(like(picture, PALETTE[0]).any(axis=0))
        assert columns.min() == pytest.approx((curve.min() + curve.max()) / 2, abs=12)

    def test_a_few_stray_points_do_not_flatten_the_rest(self) -> None:
        places = tuple(float(x) for x in range(100))
        stray = Series("a", "A", places, (*places[:99], 1e6), "points")
        # Half of the points lie in the left half of the picture, so they reach half way up.
        left = drawn(figure(stray))[:, WIDTH // 4 : WIDTH // 2]
        blue = (left[:, :, 0].astype(int) - left[:, :, 2]) > 60
        assert np.ptp(np.flatnonzero(blue.any(axis=1))) > HEIGHT / 8

    def test_without_matplotlib_the_extra_is_named(self, monkeypatch) -> None:
        monkeypatch.setitem(sys.modules, "matplotlib", None)
        with pytest.raises(InputError, match="matplotlib") as caught:
            figure_to_png(figure(LINE))
        assert "touchline[charts]" in (caught.value.hint or "")

    @pytest.mark.parametrize(
        "series",
        [
            Series("a", "A", (), ()),
            Series("a", "A", (3.0,), (4.0,), "points"),
            Series("a", "A", (0.0, 0.0), (1.0, 1.0)),
            Series("a", "A", (0.0, 1.0), (-5.0, 5.0), low=(-6.0, 4.0), high=(-4.0, 6.0)),
            Series("a", "A", (0.0, 1.0), (0.0, 1e9)),
        ],
    )
    def test_draws_whatever_there_is(self, series) -> None:
        assert drawn(figure(series)).shape[0] == HEIGHT

    def test_colours_follow_the_value(self) -> None:
        near = Series("a", "A", (0.0, 1.0), (0.0, 1.0), color=10.0)
        far = Series("b", "B", (0.0, 1.0), (1.0, 0.0), color=90.0)
        picture = drawn(figure(near, far, color=Axis("Distance", "m"))).astype(int)
        lower = picture[HEIGHT // 2 :, 100 : WIDTH // 2 - 60]
        # Near is blue and begins at the bottom left, far is red and begins at the top.
        assert ((lower[:, :, 0] - lower[:, :, 2]) > 80).sum() > 50
        assert ((lower[:, :, 2] - lower[:, :, 0]) > 80).sum() < 20

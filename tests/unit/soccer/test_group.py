from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box, ImagePoint, ImageSize
from app.soccer.group import Group, Station, View, make_view_letter

STATION = Station("7.png", ImageSize(1280, 720))
BALL = BallAnnotation(box=Box(10.0, 20.0, 8.0, 6.0))


class TestViewLetter:
    def test_views_after_the_26th_are_numbered(self):
        assert [make_view_letter(index) for index in (0, 2, 25, 26)] == ["A", "C", "Z", "V27"]


class TestBall:
    def test_one_ball_is_the_ball(self):
        assert View("7.png", STATION, (BALL,)).ball == BALL

    def test_of_several_balls_none_is_used(self):
        assert View("7.png", STATION, (BALL, BALL)).ball is None

    def test_an_occluded_ball_is_used_and_one_out_of_view_is_not(self):
        occluded = BallAnnotation(box=BALL.box, occluded=True)
        gone = BallAnnotation(out_of_view=True)
        assert View("7.png", STATION, (gone, occluded)).ball == occluded
        assert View("7.png", STATION, (gone,)).ball is None

    def test_its_centre_comes_from_box_or_point(self):
        assert BALL.center == ImagePoint(14.0, 23.0)
        assert BallAnnotation(point=ImagePoint(3.0, 4.0)).center == (3.0, 4.0)


class TestWithView:
    def test_replaces_the_view_of_that_key_and_keeps_the_order(self):
        group = Group("g", (View("a", STATION), View("b", STATION)))
        changed = group.with_view(View("a", STATION, (BALL,)))
        assert [view.key for view in changed.views] == ["a", "b"]
        assert changed.view("a").ball == BALL
        assert group.view("a").ball is None

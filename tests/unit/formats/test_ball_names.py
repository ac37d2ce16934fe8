from __future__ import annotations

import pytest

from app.formats.ball_names import is_ball, is_same_name

BALLS = [
    "ball",
    "balls",
    "Ball",
    "BALL",
    "sports_ball",
    "sports-ball",
    "sportsball",
    "SportsBall",
    "soccer-ball",
    "SOCCER_BALL",
    "soccerBalls",
    "football",
    "footballs",
    "foot-ball",
    "football-balls",
    "game_ball",
    "gameball",
    "match.ball",
    "the_ball",
    "Fußball",
    "fussball",
    "balón",
    "balon",
    "ballon",
    "bola",
    "pelota",
    "pallone",
    "ball/ball",
    "мяч",
    "ball_1",
    "Ball 2",
    "ball1",
]
OTHERS = [
    "basketball",
    "basket_ball",
    "volleyball",
    "handball",
    "tennis-ball",
    "american_football",
    "rugby_ball",
    "baseball",
    "ballboy",
    "ball_kid",
    "football_player",
    "soccer",
    "player",
    "goal",
    "person",
    "s",
    "sport",
    "game",
    "balls_out",
    "1",
    "player_1",
    "basketball_1",
]


class TestIsBall:
    @pytest.mark.parametrize("name", [*BALLS, " sports ball ", "Soccer Ball", "sports  balls"])
    def test_the_ball_is_known_in_every_spelling(self, name: str) -> None:
        assert is_ball(name)

    @pytest.mark.parametrize("name", [*OTHERS, "", "football player", "ball in hand"])
    def test_other_balls_and_other_things_are_not_it(self, name: str) -> None:
        assert not is_ball(name)


class TestSameName:
    def test_case_separators_and_accents_do_not_matter(self) -> None:
        assert is_same_name("Object_1", "object-1")
        assert is_same_name("Balón", "balon")
        assert not is_same_name("object1", "object2")

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from app.formats.ball_names import is_ball_name, is_same_name
from app.formats.coco_reader import read_coco
from app.formats.report import ReaderReport
from tests.unit.formats.foreign_coco import ball, category, coco, image, write

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
        assert is_ball_name(name)

    @pytest.mark.parametrize("name", [*OTHERS, "", "football player", "ball in hand"])
    def test_other_balls_and_other_things_are_not_it(self, name: str) -> None:
        assert not is_ball_name(name)


class TestSameName:
    def test_case_separators_and_accents_do_not_matter(self) -> None:
        assert is_same_name("Object_1", "object-1")
        assert is_same_name("Balón", "balon")
        assert not is_same_name("object1", "object2")


PEOPLE = [category("Player"), category("Referee", 2)]


def balls(root: Path, report: ReaderReport, value: Any, ball_category: str = "") -> int:
    write(root, {"x.json": value})
    groups = read_coco(root, report, ball_category=ball_category)
    return sum(len(view.balls) for group in groups for view in group.views)


class TestCategories:
    @pytest.mark.parametrize("name", ["ball", "sports_ball", "soccer-ball", "balls", "Football"])
    def test_the_report_says_which_one_was_taken(
        self, tmp_path: Path, report: ReaderReport, name: str
    ) -> None:
        assert balls(tmp_path, report, coco(categories=[category(name)])) == 1
        assert f'category "{name}" is the ball (1 annotation)' in report.remarks[-1]
        assert report.problems == []

    @pytest.mark.parametrize("name", ["basketball", "ball_boy", "Player"])
    def test_where_none_is_the_ball_the_names_are_listed_with_what_to_do(
        self, tmp_path: Path, report: ReaderReport, name: str
    ) -> None:
        assert balls(tmp_path, report, coco(categories=[category(name)])) == 0
        (problem,) = report.problems
        assert problem.field == "categories"
        assert "the file contains no ball" in problem.problem
        assert f'("{name}")' in problem.problem
        assert "--ball-category" in problem.problem

    @pytest.mark.parametrize("named", ["Round thing", "round_thing", "2", " 2.0"])
    def test_a_category_that_somebody_names_is_the_ball(
        self, tmp_path: Path, report: ReaderReport, named: str
    ) -> None:
        value = coco(
            annotations=[ball(category=2), ball(identity=2, category=1)],
            categories=[category("ball"), category("round thing", 2)],
        )
        assert balls(tmp_path, report, value, named) == 1
        assert '"round thing" is the ball' in report.remarks[-1]

    def test_a_name_that_no_category_has_brings_no_ball(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        assert balls(tmp_path, report, coco(), "puck") == 0
        assert (
            'none of its categories ("ball", "Player") is recognised' in report.problems[0].problem
        )

    def test_without_a_list_the_only_id_is_the_ball_where_no_picture_has_two(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        value = coco()
        del value["categories"]
        assert balls(tmp_path, report, value) == 1
        assert (
            "category id 1 is the ball (1 annotation); the file lists no categories"
            in (report.remarks[-1])
        )

    @pytest.mark.parametrize(
        "second", [{"category": 2}, {"bbox": [5, 6, 7, 8]}], ids=["two ids", "two in a picture"]
    )
    def test_without_a_list_anything_else_is_left_to_a_person(
        self, tmp_path: Path, report: ReaderReport, second: dict[str, Any]
    ) -> None:
        value = coco(annotations=[ball(), ball(identity=2, **second)], categories=[])
        assert balls(tmp_path, report, value) == 0
        assert "none of its categories (id 1" in report.problems[-1].problem
        assert balls(tmp_path, ReaderReport(), value, "1") > 0

    def test_a_category_that_nothing_has_is_no_ball(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        value = coco(annotations=[ball(category=2)])
        assert balls(tmp_path, report, value) == 0
        assert 'no annotation that can be read has "ball"' in report.problems[0].problem

    def test_a_file_without_a_ball_beside_one_with_it_is_a_remark(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        people = coco([image("b.jpg")], categories=PEOPLE)
        write(tmp_path, {"people.json": people})
        assert balls(tmp_path, report, coco()) == 1
        assert any('none of its categories ("Player", "Referee")' in it for it in report.remarks)
        assert report.problems == []

    @pytest.mark.parametrize(
        ("categories", "field"),
        [
            (["ball", category("ball")], "id"),
            ([{"name": "x"}, category("ball")], "id"),
            ([category("ball"), {"id": 3}], "name"),
            ([category("ball"), category("Player", 1.0)], "id"),
        ],
    )
    def test_one_that_cannot_be_used_is_named_and_the_others_count(
        self, tmp_path: Path, report: ReaderReport, categories: list[Any], field: str
    ) -> None:
        assert balls(tmp_path, report, coco(categories=categories)) == 1
        assert [problem.field for problem in report.problems] == [field]

from __future__ import annotations

import json
import math
from dataclasses import replace

import pytest
from sqlalchemy import insert, text

from app.features.datasets.tables import DatasetModel, GroupModel
from app.features.solutions import codec as value_codec
from app.features.solutions.codec import summarize_solution
from app.features.solutions.queries import (
    SolutionKey,
    _is_undetermined,
    decode_calibration,
    decode_calibration_without_markings,
    encode_calibration,
    encode_solution,
    insert_solutions,
    read_calibrations,
    read_solutions,
    read_summary,
)
from app.soccer.finding import Finding, SuggestedFix
from app.soccer.frames import Box, ImagePoint
from app.soccer.solution import (
    Ball3D,
    BallFit,
    Calibration,
    Gate,
    MarkingFit,
    PaintFit,
    Solution,
    SuspectLabel,
    TriangulatedPair,
    ViewSolution,
)

THIRD = 1 / 3
KEY = SolutionKey(1, "inputs", "policy")


@pytest.fixture
def solution(full_camera) -> Solution:
    """A solution with one of everything."""
    point = ImagePoint(THIRD, -2.5)
    calibration = Calibration(
        source="lines",
        camera=full_camera,
        jac=(0.9, 0.95, 1.0),
        error_px=0.1 + 0.2,
        markings=(
            MarkingFit("Middle line", "tp", (0.5, THIRD), (point, point), THIRD),
            MarkingFit("Side line top", "fn", used=False),
        ),
        suspects=(SuspectLabel("Circle left", None, 0.5, 12.5),),
        covariance=tuple(float(value) for value in range(64)),
        unobservable=("focal length",),
    )
    fit = BallFit(point, 3.5, 0.25, 14.5, Box(1, 2, 3, 4), 0.1, None, 1.25, 80.0)
    none = BallFit(None, None, None, None, None, None, None, None, None)
    failed = Calibration(source="lines", camera=None, reason="no lines")
    pair = TriangulatedPair("7.png", "cam1", (1.0, 2.0, -0.5), (3.5, 2.0), 40.0, 75.0, True)
    return Solution(
        views=(
            ViewSolution("7.png", calibration, "key-a", True, None, fit),
            ViewSolution("cam1", failed, "key-b", False, "calibratable", none),
            ViewSolution("cam2", calibration, "key-a", False, "ball"),
        ),
        pairs=(pair, replace(pair, valid=False, failed="baseline")),
        ball=Ball3D((1.0, 2.0, -0.5), (0.1,) * 9, 0.3, 75.0, ("7.png",)),
        gates=(
            Gate("jac", True, 0.9, 0.75, 0.2, "worst 0.90 · A", "7.png"),
            Gate("reprojection", False, 30.0, 22.0, -8 / 22, "30 px · B", "cam1"),
            Gate("sigma", False, 3.0, 0.5, -5.0, "3 m", active=False),
        ),
        findings=(
            Finding("low_parallax", "3 degrees", number=3.0, threshold=5.0),
            Finding(
                "bad_point", "off", "7.png", "Middle line", fix=SuggestedFix("drop_point", index=2)
            ),
            Finding("bad_point", "off too", "7.png"),
        ),
        policy_hash="policy",
    )


@pytest.fixture
def with_group(own_store):
    """A database with the row of one group."""
    values = {"created": "", "policy": "{}", "policy_hash": "", "name": "d", "id": 1}
    full_group = dict.fromkeys(
        ("key", "match", "split", "label", "changed", "inputs_hash", "source_hash"), ""
    )
    numbers = {"pitch_length": 105.0, "pitch_width": 68.0, "revision": 1, "number": 1}
    with own_store.write() as session:
        session.execute(insert(DatasetModel), [values])
        session.execute(insert(GroupModel), [{**full_group, **numbers, "id": 1, "dataset_id": 1}])
    return own_store


class TestRoundTrip:
    def test_a_solution_comes_back_to_the_last_bit(self, with_group, full_group, solution) -> None:
        with with_group.write() as session:
            insert_solutions(session, [(KEY, encode_solution(full_group, solution))])
        with with_group.read() as session:
            assert read_solutions(session, [KEY]) == {1: solution}

    def test_a_solution_is_found_only_under_its_own_key(
        self, with_group, full_group, solution
    ) -> None:
        with with_group.write() as session:
            insert_solutions(session, [(KEY, encode_solution(full_group, solution))])
        with with_group.read() as session:
            for other in (
                replace(KEY, inputs_hash="x"),
                replace(KEY, policy_hash="x"),
                replace(KEY, solver_version="x"),
                replace(KEY, group_id=2),
            ):
                assert read_solutions(session, [other]) == {}

    def test_calibrations_are_kept_once_and_inserting_again_changes_nothing(
        self, with_group, full_group, solution
    ) -> None:
        for _ in range(2):
            with with_group.write() as session:
                insert_solutions(session, [(KEY, encode_solution(full_group, solution))])
        with with_group.read() as session:
            counts = [
                session.execute(text(f"SELECT count(*) FROM {name}")).scalar()
                for name in ("solution", "calibration")
            ]
            assert counts == [1, 2]
            assert read_calibrations(session, ["key-a", "x"]) == {
                "key-a": solution.views[0].calibration
            }

    def test_whether_lines_leave_a_camera_open_is_told_from_the_text_alone(
        self, solution, full_camera
    ) -> None:
        found = solution.views[0].calibration
        none = Calibration("lines", None, reason="no lines")
        odd = replace(found, unobservable=(), reason='"camera":null, "unobservable":["x"]')
        told = [
            found,
            replace(found, unobservable=()),
            none,
            Calibration("given", full_camera),
            odd,
        ]
        for item in told:
            is_open = item.camera is None or item.unobservable != ()
            assert _is_undetermined(encode_calibration(item)) == is_open

    def test_known_calibrations_are_not_encoded_again(self, full_group, solution) -> None:
        encoded = encode_solution(full_group, solution, known={"key-a"})
        assert set(encoded.calibrations) == {"key-b"}


class TestValueCodec:
    def test_numbers_that_are_not_finite_come_back(self) -> None:
        ball = Ball3D((math.inf, -math.inf, 1.0), (math.inf,) * 9, math.inf, 0.5, ())
        text_ = value_codec.solution_json_text(value_codec.to_json(ball))
        assert value_codec.from_json(Ball3D, json.loads(text_)) == ball

    def test_a_field_that_is_new_has_its_default(self) -> None:
        value = value_codec.to_json(Finding("low_parallax", "3 degrees"))
        del value["fix"], value["confidence"]
        assert value_codec.from_json(Finding, value) == Finding("low_parallax", "3 degrees")

    def test_what_came_later_stands_there_only_where_it_says_something(self) -> None:
        """Calibrations that are frozen must come out as the same bytes."""
        bare = Calibration("lines", None)
        assert "paint" not in value_codec.to_json(bare)
        told = replace(bare, paint=PaintFit(0.5, None, 7, reason="no_paint"))
        value = value_codec.to_json(told)
        assert value["paint"]["points"] == 7
        assert value_codec.from_json(Calibration, value) == told
        assert value_codec.from_json(Calibration, value_codec.to_json(bare)) == bare

    def test_markings_can_be_left_out_whatever_texts_say(self) -> None:
        trap = ',"markings":[],"suspects":[]'
        fit = MarkingFit(trap, "tp", (0.1,), (ImagePoint(1.0, 2.0),), 34.0)
        told = Calibration(
            "lines", None, trap, markings=(fit, fit), suspects=(SuspectLabel(trap, None, 0.5, 3.0),)
        )
        body = encode_calibration(told)
        assert decode_calibration(body) == told
        assert decode_calibration_without_markings(body) == replace(told, markings=())

    def test_a_type_without_a_codec_is_a_programming_error(self) -> None:
        with pytest.raises(TypeError, match="no codec"):
            value_codec.to_json({"a": 1})


def painted_views(solution: Solution, fits: tuple[PaintFit | None, ...]) -> Solution:
    """The solution with what the paint says of its views, each with a camera."""
    full_camera = solution.views[0].calibration.camera
    views = [
        replace(view, calibration=replace(view.calibration, camera=full_camera, paint=fit))
        for view, fit in zip(solution.views, fits, strict=True)
    ]
    return replace(solution, views=tuple(views))


class TestSummary:
    def test_names_the_first_failing_gate_with_its_margin(self, full_group, solution) -> None:
        found = summarize_solution(full_group, solution)
        assert (found.passes, found.gate, found.gate_view) == (False, "reprojection", "cam1")
        assert found.margin == pytest.approx(-8 / 22)

    def test_value_is_the_margin_without_its_sign(self, full_group, solution) -> None:
        assert summarize_solution(full_group, solution).value == pytest.approx(8 / 22)
        passing = replace(solution, gates=solution.gates[:1])
        assert summarize_solution(full_group, passing).value == pytest.approx(0.2)

    def test_numbers_come_from_the_ball_and_the_views_behind_it(self, full_group, solution) -> None:
        found = summarize_solution(full_group, solution)
        assert found.size_ratio == 1.25
        assert (found.sigma_m, found.parallax_degrees, found.height_m) == (0.3, 75.0, 0.5)
        assert found.min_jac == 0.9
        assert found.findings == ("low_parallax", "bad_point")

    def test_agreement_is_the_lowest_of_the_views_in_use_whose_paint_was_read(
        self, full_group, solution
    ) -> None:
        assert summarize_solution(full_group, solution).agreement is None
        painted = painted_views(solution, (PaintFit(0.9, 0.8, 90), None, None))
        assert summarize_solution(full_group, painted).agreement == pytest.approx(0.72)
        # The second view is left out.
        fits = PaintFit(0.9, 0.8, 90), PaintFit(0.1, 0.2, 90), PaintFit(0.5, 0.5, 90)
        assert summarize_solution(
            full_group, painted_views(solution, fits)
        ).agreement == pytest.approx(0.25)
        unseen = painted_views(solution, (PaintFit(None, None, 0, reason="no_frame"), None, None))
        assert summarize_solution(full_group, unseen).agreement is None

    def test_min_jac_is_the_lowest_of_the_views_in_use(self, full_group, solution) -> None:
        (left_out,) = [view.key for view in full_group.views if not view.included]
        for key, lowest in ((left_out, 0.9), (full_group.views[0].key, 0.1)):
            views = tuple(
                replace(view, calibration=replace(view.calibration, jac=(0.1, 0.1, 0.1)))
                if view.view == key
                else view
                for view in solution.views
            )
            assert summarize_solution(full_group, replace(solution, views=views)).min_jac == lowest

    def test_the_error_is_that_of_the_gate_with_and_without_a_ball(
        self, full_group, solution
    ) -> None:
        judged = replace(solution.gates[1], value=3.5)
        diagonal = full_group.views[0].size.diagonal
        for ball in (solution.ball, None):
            found = summarize_solution(full_group, replace(solution, ball=ball, gates=(judged,)))
            assert found.error_px == 3.5
            assert found.error_percent == pytest.approx(350 / diagonal)
        unjudged = summarize_solution(
            full_group, replace(solution, gates=(replace(judged, value=None),))
        )
        assert (unjudged.error_px, unjudged.error_percent) == (None, None)

    def test_without_a_ball_there_is_no_parallax_of_it(self, full_group, solution) -> None:
        found = summarize_solution(full_group, replace(solution, ball=None))
        assert (found.parallax_degrees, found.height_m) == (None, None)

    def test_a_group_without_anything_has_no_numbers(self, full_group) -> None:
        found = summarize_solution(full_group, Solution((), (), None, ()))
        assert found.passes
        assert (found.value, found.margin, found.error_px, found.min_jac) == (None,) * 4

    def test_comes_back_from_its_text(self, full_group, solution) -> None:
        summary = encode_solution(full_group, solution).summary
        assert (
            read_summary(value_codec.solution_json_text(value_codec.to_json(summary)))
            == summary
            == summarize_solution(full_group, solution)
        )

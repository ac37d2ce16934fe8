"""Solutions as they travel."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from app.features.groups.edit_codec import edit_from_json
from app.features.groups.solution_schemas import (
    SolutionDocument,
    _make_calibration_document,
    camera_sigma,
)
from app.geometry.polyline import distance_to_polyline
from app.geometry.resection import PARAMETERS, camera_from_parameters, parameters_from_camera
from app.soccer.finding import Finding, SuggestedFix
from app.soccer.group import Group
from app.soccer.pitch import GOAL_PARTS, Pitch
from app.soccer.policy import PAPER, STRICT
from app.soccer.solution import Calibration, Solution
from app.solving.jaccard import project_markings
from app.solving.solve import solve_group
from tests.cameras import SIZE, WIDE_LENSES, wide
from tests.unit.stores import MAIN


@pytest.fixture(scope="module")
def solution(group: Group) -> Solution:
    return solve_group(group, PAPER)


class TestSolutionDocument:
    def test_what_travels_is_what_was_computed(self, solution: Solution, group: Group) -> None:
        document = json.loads(SolutionDocument.of(solution, group).model_dump_json())
        assert document["passes"] is True
        assert document["first_failing"] is None
        assert document["ball"]["point"] == list(solution.ball.point)
        assert document["ball"]["height_m"] == -solution.ball.point[2]
        assert [gate["name"] for gate in document["gates"]] == [g.name for g in solution.gates]
        assert document["pairs"][0]["errors_px"] == list(solution.pairs[0].errors_px)

    def test_jac_is_named_by_its_threshold(self, solution: Solution, group: Group) -> None:
        view = SolutionDocument.of(solution, group).views[0]
        assert list(view.calibration.jac) == ["0.5", "1", "2"]

    def test_a_marking_is_told_as_it_is_seen_up_to_the_border(
        self, solution: Solution, group: Group
    ) -> None:
        shown = 0
        documents = SolutionDocument.of(solution, group).views
        for view, document in zip(group.views, documents, strict=True):
            for fit in document.calibration.markings:
                polyline = np.array(fit.polyline).reshape(-1, 2)
                assert (polyline >= 0).all()
                assert (polyline <= [view.size.width, view.size.height]).all()
                if fit.nearest:
                    _, places = distance_to_polyline(np.array(fit.nearest), polyline)
                    assert np.allclose(places, fit.nearest, atol=2e-3)
                shown += len(polyline) > 1
            assert all(fit.polyline for fit in document.calibration.markings if fit.outcome != "fn")
        assert shown > 4

    def test_the_same_camera_of_another_pitch_is_drawn_anew(
        self, solution: Solution, group: Group
    ) -> None:
        narrow = replace(group, pitch=replace(group.pitch, width=60.0))
        told = [SolutionDocument.of(solution, one).views[0] for one in (group, narrow, group)]
        drawn = [[fit.polyline for fit in one.calibration.markings] for one in told]
        assert drawn[0] == drawn[2] != drawn[1]

    def test_goals_are_drawn_where_they_were_fitted(self, group: Group) -> None:
        parts, drawn = set[str](), 0
        for policy in (PAPER, STRICT):
            pitch = policy.calibration.pitch_for_fitted_lines(group.pitch)
            solved = solve_group(group, policy)
            for view, document in zip(
                group.views, SolutionDocument.of(solved, group).views, strict=True
            ):
                camera = solved.view(view.key).calibration.camera
                seen = project_markings(camera, pitch, view.size)
                for fit in document.calibration.markings:
                    if fit.marking in GOAL_PARTS and fit.polyline:
                        assert np.allclose(fit.polyline, seen[fit.marking], atol=1e-3)
                        parts.add(fit.marking)
                        drawn += 1
        assert drawn >= 2 * len(parts) > 0

    def test_where_no_camera_is_nothing_is_drawn(self, solution: Solution, group: Group) -> None:
        first = solution.views[0]
        blind = replace(first, calibration=replace(first.calibration, camera=None))
        document = SolutionDocument.of(replace(solution, views=(blind,)), group).views[0]
        assert not any(fit.polyline for fit in document.calibration.markings)

    def test_a_camera_says_how_well_it_is_known_where_that_is_known(
        self, solution: Solution, group: Group
    ) -> None:
        first = solution.views[0]
        spread = tuple((np.eye(8) * 1e-4).ravel().tolist())
        known = replace(first, calibration=replace(first.calibration, covariance=spread))
        open_ = replace(first, calibration=replace(first.calibration, covariance=None))
        documents = SolutionDocument.of(replace(solution, views=(known, open_)), group).views
        sigma = documents[0].calibration.sigma
        assert sigma is not None
        assert sigma.position_meters == pytest.approx((0.01, 0.01, 0.01))
        assert sigma.pan_degrees == pytest.approx(0.5729577951)
        told = [document.calibration.camera.covariance for document in documents]
        assert np.diag(told[0])[:4] == pytest.approx([1e-4] * 3 + [0.5729577951**2])
        assert told[1] is None
        assert documents[1].calibration.sigma is None

    def test_a_wide_lens_is_named_with_its_coefficients(
        self, solution: Solution, group: Group
    ) -> None:
        plain = SolutionDocument.of(solution, group).views[0].calibration.camera
        assert plain is not None
        assert (plain.lens, plain.lens_coefficients) == ("brown_conrady", None)
        assert len(plain.radial_distortion) == 6
        first = solution.views[0]
        camera = wide((0.0, 60.0, -9.0), (0.0, 0.0, 0.0), "arctan_polynomial")
        changed = replace(first, calibration=Calibration("given", camera))
        document = SolutionDocument.of(replace(solution, views=(changed,)), group)
        found = json.loads(document.model_dump_json())["views"][0]["calibration"]["camera"]
        assert found["lens"] == "arctan_polynomial"
        assert tuple(found["lens_coefficients"]) == WIDE_LENSES["arctan_polynomial"]
        assert found["radial_distortion"] == []

    def test_the_document_fits_its_own_schema(self, solution: Solution, group: Group) -> None:
        text = SolutionDocument.of(solution, group).model_dump_json()
        again = SolutionDocument.model_validate_json(text)
        assert again.model_dump_json() == text

    def test_a_number_that_is_not_finite_travels_as_null(
        self, solution: Solution, group: Group
    ) -> None:
        endless = replace(solution, ball=replace(solution.ball, sigma_m=float("inf")))
        text = SolutionDocument.of(endless, group).model_dump_json()
        assert json.loads(text)["ball"]["sigma_m"] is None
        assert SolutionDocument.model_validate_json(text).ball.sigma_m is None

    def test_a_finding_offers_the_edit_that_the_history_would_keep(
        self, solution: Solution, group: Group
    ) -> None:
        view = group.views[0]
        marking = next(iter(view.station.lines))
        found = Finding(
            "bad_point", "?", view.key, fix=SuggestedFix("drop_marking", view.key, marking)
        )
        document = SolutionDocument.of(replace(solution, findings=(found,)), group).findings[0]
        edit = {"edit": "set_lines", "view": view.key, "lines": {marking: None}}
        assert [offer.model_dump() for offer in document.offers] == [
            {"label": "Delete the line", "edit": edit, "caption": f"{marking}: fits no line"}
        ]
        assert edit_from_json(edit).apply(group).view(view.key).station.lines.keys() == (
            view.station.lines.keys() - {marking}
        )

    def test_a_finding_that_no_edit_mends_says_where_to_draw(
        self, solution: Solution, group: Group
    ) -> None:
        found = Finding("visible_not_annotated", "?", group.views[0].key, "Middle line")
        document = SolutionDocument.of(replace(solution, findings=(found,)), group).findings[0]
        led = {"label": "Draw it", "caption": "", "looks": None, "reads": False}
        assert document.offers == []
        assert document.guide is not None
        assert document.guide.model_dump() == {**led, "draws": "Middle line"}

    def test_a_finding_that_only_a_person_can_mend_offers_nothing(
        self, solution: Solution, group: Group
    ) -> None:
        found = Finding("low_parallax", "?")
        document = SolutionDocument.of(replace(solution, findings=(found,)), group)
        assert document.findings[0].offers == []
        assert document.findings[0].guide is None


HALF_DIAGONAL = math.hypot(1280, 720) / 2
SIGMAS = np.array([0.001, 0.002, 0.003, 0.3, 0.4, 0.5, 0.01, 0.004])


def calibration(covariance: np.ndarray | None) -> Calibration:
    spread = None if covariance is None else tuple(covariance.ravel().tolist())
    lens = replace(MAIN, distortion=np.array([0.12, *[0.0] * 11]))
    return Calibration(source="lines", camera=lens, covariance=spread)


class TestCameraSigma:
    def test_numbers_by_hand(self) -> None:
        sigma = camera_sigma(calibration(np.diag(SIGMAS**2)), SIZE)
        assert sigma is not None
        assert sigma.pan_degrees == pytest.approx(0.0572957795)
        assert sigma.roll_degrees == pytest.approx(3 * sigma.pan_degrees)
        assert sigma.position_meters == pytest.approx((0.3, 0.4, 0.5))
        assert sigma.focal_px == pytest.approx(15.0)

    def test_agrees_with_many_cameras_drawn_from_the_covariance(self) -> None:
        rng = np.random.default_rng(4)
        mixed = np.diag(SIGMAS) @ (np.eye(PARAMETERS) + 0.3 * rng.normal(size=(PARAMETERS,) * 2))
        spread = mixed @ mixed.T
        known = calibration(spread)
        assert known.camera is not None
        mean = parameters_from_camera(known.camera, HALF_DIAGONAL)
        drawn = [
            camera_from_parameters(row, known.camera.principal_point, HALF_DIAGONAL)
            for row in rng.multivariate_normal(mean, spread, size=4000)
        ]
        sigma = camera_sigma(known, SIZE)
        assert sigma is not None
        # A sigma of 4000 draws is itself known to 1 / sqrt(2 * 4000), about 1.1 %.
        assert sigma.k1 == pytest.approx(np.std([one.distortion[0] for one in drawn]), rel=0.06)
        focals = [one.focal_length[0] for one in drawn]
        assert sigma.focal_px == pytest.approx(np.std(focals), rel=0.06)

    def test_are_those_of_the_cameras_file_also_beside_the_middle_and_with_other_pixels(
        self,
    ) -> None:
        known = calibration(np.diag(SIGMAS**2))
        assert known.camera is not None
        aside = replace(known.camera, principal_point=(500.0, 200.0), focal_length=(1500.0, 1200.0))
        known = replace(known, camera=aside)
        document = _make_calibration_document(known, Pitch(), SIZE)
        assert document.camera is not None and document.camera.covariance is not None
        told = np.sqrt(np.diag(document.camera.covariance))
        sigma = document.sigma
        assert sigma is not None
        assert (sigma.focal_px, sigma.k1) == pytest.approx(tuple(told[6:]))
        slope = (2 * np.sqrt(1500.0 * 1200.0) / SIZE.diagonal) ** 2
        assert sigma.k1 == pytest.approx(np.hypot(2 * 0.12 * SIGMAS[6], slope * SIGMAS[7]))

    def test_a_given_camera_and_a_view_without_camera_have_no_sigma(self) -> None:
        assert camera_sigma(calibration(None), SIZE) is None
        assert camera_sigma(Calibration(source="lines", camera=None), SIZE) is None

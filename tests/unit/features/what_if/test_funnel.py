from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from app.config import Settings
from app.db.store import Store
from app.errors import NotFoundError
from app.features.datasets.service import get_dataset
from app.features.groups.edit import SetViewInclusion, make_set_ball_edit
from app.features.groups.submit import load_group_state, submit_edit
from app.features.imports.ingest import ensure_dataset, import_groups
from app.features.policies.service import change_policy
from app.features.queue.service import list_groups
from app.features.solutions.service import solve_dataset
from app.features.what_if.funnel import WITHOUT_EFFECT, Yield, count_yield
from app.features.what_if.service import WhatIfStore
from app.features.what_if.table import YieldTable
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box
from app.soccer.group import Group
from app.soccer.policy import PAPER, CalibrationPolicy, Policy
from app.soccer.solution import GATES, PaintFit, Solution
from app.soccer.thresholds import THRESHOLDS
from app.solving.ball_covariance import CovarianceOfMeanBall
from app.solving.facts import collect_facts_of_views, join_facts
from app.solving.judgement import PASSES, Judgement, compute_view_jac, judge_groups
from app.solving.solve import solve_and_collect_facts, solve_group
from tests.cameras import looking
from tests.scenes import make_scenes
from tests.unit.solving.conftest import given_view

SEEDS = 9


def odd_ones(scenes: list[Group]) -> list[Group]:
    """Groups that no scene is like: left out views, no lines, no ball, several balls."""
    first, second, third, fourth = scenes[:4]
    view = first.views[0]
    two = (BallAnnotation(box=Box(10, 10, 9, 9)), BallAnnotation(box=Box(90, 10, 9, 9)))
    odd = [
        first.with_view(replace(view, included=False)),
        second.with_view(replace(second.views[0], balls=())),
        third.with_view(replace(third.views[0], balls=two)),
        fourth.with_view(
            replace(fourth.views[1], station=replace(fourth.views[1].station, lines={}))
        ),
    ]
    return [replace(group, key=f"odd/{place}.png") for place, group in enumerate(odd)]


@pytest.fixture(scope="module")
def groups() -> list[Group]:
    """Scenes with every planted fault, and the odd ones."""
    scenes = [scene.group for scene in make_scenes(groups=26, seed=20_260_101, faults=True)]
    return [*scenes, *odd_ones(scenes)]


@pytest.fixture(scope="module")
def filled(tmp_path_factory: pytest.TempPathFactory, groups: list[Group]) -> Iterator[Store]:
    """A store with the groups solved, in the dataset "many"."""
    store = Store.open(Settings(home=tmp_path_factory.mktemp("yields")))
    import_groups(store, "many", groups, source="scenes", actor="ann")
    solve_dataset(store, "many")
    yield store
    store.close()


@pytest.fixture(scope="module")
def solutions(filled: Store) -> list[tuple[Group, Solution]]:
    """Groups and solutions as stored, in order."""
    ids = [row.id for row in list_groups(filled, 1, limit=500).items]
    states = [load_group_state(filled, number) for number in ids]
    return [(state.group, state.solution) for state in states if state.solution is not None]


def random_policy(seed: int) -> Policy:
    """Thresholds near those that decide about real groups."""
    rng = random.Random(seed)
    return replace(
        PAPER,
        name=f"random {seed}",
        jac_gamma_percent=rng.choice([0.2, 0.35, 0.5, 1.0, 2.0]),
        min_jac=rng.choice([0.0, 0.5, 0.75, 0.85, 0.95]),
        tau_percent=rng.choice([0.02, 0.05, 0.1, 0.3, 1.0, 5.0, 100.0]),
        min_baseline_m=rng.choice([0.0, 1.0, 40.0, 70.0]),
        min_parallax_degrees=rng.choice([None, 5.0, 20.0, 60.0]),
        max_sigma_m=rng.choice([None, 0.05, 0.1, 0.3, 1.0]),
        min_p_value=rng.choice([None, 0.002, 0.1]),
        click_sigma_px=rng.choice([0.3, 1.0, 4.0]),
        box_sigma_share=rng.choice([0.0, 0.04, 0.2]),
        low_parallax_degrees=rng.choice([5.0, 30.0]),
        below_grass_m=rng.choice([-1.0, 0.5]),
        max_height_m=rng.choice([2.0, 40.0]),
        outside_pitch_m=rng.choice([-20.0, 10.0]),
    )


def judge_table(table: YieldTable, policy: Policy) -> Judgement:
    return judge_groups(table.facts, policy, CovarianceOfMeanBall(table.facts))


def solved_again(group: Group, solution: Solution, policy: Policy) -> Solution:
    """What ``solve`` says under another policy; calibrations do not depend on it."""
    known = {view.calibration_key: view.calibration for view in solution.views}
    return solve_group(group, policy, known)


def with_paint(solution: Solution) -> Solution:
    """The solution as if paint had been read in two of three pictures, and agreed or not."""
    views = []
    for view in solution.views:
        rng = random.Random(view.calibration_key)
        paint = PaintFit(rng.random(), 1.0, 90) if rng.random() < 0.7 else None
        views.append(replace(view, calibration=replace(view.calibration, paint=paint)))
    return replace(solution, views=tuple(views))


class TestJudgeTable:
    @pytest.mark.parametrize("seed", range(SEEDS))
    def test_judges_as_solve_does(self, filled, solutions, seed: int) -> None:
        policy = random_policy(seed)
        table = WhatIfStore(filled).get_snapshot(1).table
        judged = judge_table(table, policy)
        assert table.groups == len(solutions)
        for place, (group, old) in enumerate(solutions):
            solution = solved_again(group, old, policy)
            failing = solution.first_failing
            name = (
                None
                if judged.first_failed_gates[place] == PASSES
                else GATES[judged.first_failed_gates[place]]
            )
            assert name == (failing.name if failing else None), (group.key, failing)
            if solution.ball is not None:
                assert judged.point[place] == pytest.approx(solution.ball.point, abs=1e-9)
                angle = solution.ball.parallax_degrees
                assert judged.parallax[place] == pytest.approx(angle, abs=1e-9)
            else:
                assert np.isnan(judged.point[place]).all()

    def test_the_policies_of_this_test_let_something_through_and_stop_something(
        self, filled
    ) -> None:
        table = WhatIfStore(filled).get_snapshot(1).table
        found = np.concatenate(
            [judge_table(table, random_policy(n)).first_failed_gates for n in range(SEEDS)]
        )
        # No picture of these was read.
        assert set(found.tolist()) == {*range(PASSES + 1)} - {GATES.index("agreement")}

    @pytest.mark.parametrize("seed", range(3))
    def test_agreement_is_judged_as_solve_does(self, solutions, seed: int) -> None:
        painted = [(group, with_paint(solution)) for group, solution in solutions]
        table = join_facts(
            [
                collect_facts_of_views(group.views, [view.calibration for view in solution.views])
                for group, solution in painted
            ]
        )
        policy = replace(random_policy(seed), min_agreement=0.5, min_jac=0.5, tau_percent=1.0)
        judged = judge_groups(table, policy, CovarianceOfMeanBall(table))
        assert GATES.index("agreement") in judged.first_failed_gates and judged.passing_groups.any()
        for place, (group, old) in enumerate(painted):
            failing = solved_again(group, old, policy).first_failing
            name = (
                None
                if judged.first_failed_gates[place] == PASSES
                else GATES[judged.first_failed_gates[place]]
            )
            assert name == (failing.name if failing else None), (group.key, failing)

    def test_without_a_threshold_agreement_changes_no_bit_of_what_is_solved(
        self, solutions
    ) -> None:
        for group, old in solutions:
            bare, painted = (solved_again(group, one, PAPER) for one in (old, with_paint(old)))
            assert (painted.gates, painted.pairs, painted.ball) == (
                bare.gates,
                bare.pairs,
                bare.ball,
            )
            assert "agreement" not in [gate.name for gate in painted.gates]

    def test_sigma_is_that_of_the_solution(self, filled, solutions) -> None:
        """The gate at the very value, a billionth to either side."""
        table = WhatIfStore(filled).get_snapshot(1).table
        policy = replace(PAPER, click_sigma_px=2.0, box_sigma_share=0.1)
        for place, (group, old) in enumerate(solutions):
            ball = solved_again(group, old, policy).ball
            if ball is None:
                continue
            for factor, passes in ((1 + 1e-9, True), (1 - 1e-9, False)):
                at = replace(policy, max_sigma_m=ball.sigma_m * factor)
                assert judge_table(table, at).passing_groups[place] == passes, group.key

    def test_the_p_value_is_that_of_the_solution(self, filled, solutions) -> None:
        """The gate at the very value, a billionth to either side."""
        table = WhatIfStore(filled).get_snapshot(1).table
        policy = replace(PAPER, click_sigma_px=0.5)
        tested = 0
        for place, (group, old) in enumerate(solutions):
            found = solved_again(group, old, policy).chi_square
            if found is None or not solved_again(group, old, policy).passes:
                continue
            tested += 1
            for factor, passes in ((1 - 1e-9, True), (1 + 1e-9, False)):
                at = replace(policy, min_p_value=found.p_value * factor)
                assert judge_table(table, at).passing_groups[place] == passes, group.key
        assert tested > 3

    def test_jac_is_that_of_the_calibrations(self, filled, solutions) -> None:
        table = WhatIfStore(filled).get_snapshot(1).table
        for place, gamma in enumerate((0.5, 1.0, 2.0)):
            stored = [
                view.calibration.jac[place] if view.calibration.jac else np.nan
                for _, solution in solutions
                for view in solution.views
            ]
            assert np.array_equal(compute_view_jac(table.facts, gamma), stored, equal_nan=True)

    @pytest.mark.parametrize("goal", ["inner", "middle", "laws"])
    def test_jac_is_that_of_the_calibrations_whatever_goals_are_fitted(self, groups, goal) -> None:
        policy = replace(PAPER, calibration=replace(PAPER.calibration, goal=goal))
        apart = 0
        for group in groups[:12]:
            solution, facts = solve_and_collect_facts(group, policy, {})
            fits = [fit for view in solution.views for fit in view.calibration.markings]
            apart += sum(fit.judged_px is not None for fit in fits)
            for place, gamma in enumerate((0.5, 1.0, 2.0)):
                stored = [
                    view.calibration.jac[place] if view.calibration.jac else np.nan
                    for view in solution.views
                ]
                assert np.array_equal(compute_view_jac(facts, gamma), stored, equal_nan=True)
        assert (apart > 0) == (goal != "inner")


def counted(found: Yield) -> None:
    """The steps lead from all groups to those that pass."""
    left = found.groups
    for step in found.funnel:
        left -= step.dropped
        assert step.left == left
    assert left == found.passing
    for parts in (found.splits, found.distances):
        assert sum(part.groups for part in parts) == found.groups
        assert sum(part.passing for part in parts) == found.passing


class TestGetYield:
    def test_counts_telescope_and_agree_with_the_queue(self, filled, solutions) -> None:
        found = count_yield(WhatIfStore(filled), 1)
        counted(found)
        assert found.passing == list_groups(filled, 1, "passes:yes").total > 0
        for step in found.funnel:
            assert step.dropped == list_groups(filled, 1, f"gate:{step.gate}").total
        assert [step.gate for step in found.funnel] == [
            name for name in GATES[:7] if name != "agreement"
        ]
        assert (found.gained, found.lost, found.needs_solving) == (0, 0, ())

    @pytest.mark.parametrize("seed", range(3))
    def test_what_if_counts_what_is_gained_and_lost(self, filled, solutions, seed: int) -> None:
        policy = random_policy(seed)
        values = {name: getattr(policy, name) for name in ("min_jac", "tau_percent", "max_sigma_m")}
        found = count_yield(WhatIfStore(filled), 1, values)
        counted(found)
        asked = replace(PAPER, **values)
        after = [solved_again(group, old, asked).passes for group, old in solutions]
        before = [old.passes for _, old in solutions]
        assert found.passing == sum(after)
        assert found.gained == sum(b and not a for a, b in zip(before, after, strict=True))
        assert found.lost == sum(a and not b for a, b in zip(before, after, strict=True))

    def test_curves_are_the_papers_figure_3(self, filled, solutions) -> None:
        found = count_yield(WhatIfStore(filled), 1)
        assert [curve.gamma_percent for curve in found.curves] == [0.5, 1.0, 2.0]
        for place, curve in enumerate(found.curves):
            for threshold in (0, 50, 75, 90, 100):
                expected = sum(
                    sum(
                        view.ball is not None
                        and view.included
                        and solved.calibration.camera is not None
                        and (jac is None or jac[place] > threshold / 100)
                        for view, solved in zip(group.views, solution.views, strict=True)
                        for jac in [solved.calibration.jac]
                    )
                    >= 2
                    for group, solution in solutions
                )
                assert curve.groups[threshold] == expected
            assert list(curve.groups) == sorted(curve.groups, reverse=True)

    def test_findings_follow_their_thresholds(self, filled, solutions) -> None:
        values = {"max_height_m": 1.0, "low_parallax_degrees": 30.0, "outside_pitch_m": -10.0}
        found = count_yield(WhatIfStore(filled), 1, values)
        again = [solved_again(group, old, replace(PAPER, **values)) for group, old in solutions]
        assert found.findings
        for part in found.findings:
            having = [s for s in again if part.name in {item.kind for item in s.findings}]
            assert (part.groups, part.passing) == (len(having), sum(s.passes for s in having))
            assert part.groups > 0

    def test_a_high_ball_beside_the_pitch_is_the_finding_that_the_solver_has(
        self, store, fill
    ) -> None:
        """Within both limits, and too high for so far outside."""
        places = {"a": (-30.0, 90.0, -20.0), "b": (40.0, 85.0, -20.0)}
        views = tuple(
            given_view(key, looking(place, (0.0, 42.0, -14.0), 1500.0), (0.0, 42.0, -14.0))
            for key, place in places.items()
        )
        fill(Group("high", views))
        found = count_yield(WhatIfStore(store), 1)
        (part,) = [part for part in found.findings if part.name == "implausible_ball"]
        assert (part.groups, part.passing) == (1, 1)
        assert list_groups(store, 1, "finding:implausible_ball").total == 1

    def test_given_cameras_without_lines_are_counted_apart(self, store, fill, make_static) -> None:
        bare = make_static(10)
        views = tuple(
            replace(view, station=replace(view.station, key=f"{view.key}x", lines={}))
            for view in bare.views
        )
        fill(replace(bare, key="11", views=views), make_static(10))
        found = count_yield(WhatIfStore(store), 1, {"min_jac": 1.0})
        assert found.given_not_measured == 1
        assert found.passing == 1

    def test_a_match_in_two_splits_is_a_leak(self, store, fill, make_group) -> None:
        test = replace(make_group(9), match="another", split="test", key="another/9.png")
        fill(make_group(7), make_group(8, split="test"), make_group(10), test)
        (leak,) = count_yield(WhatIfStore(store), 1).leakage
        assert leak.match == make_group(7).match
        assert leak.splits == (("test", 1), ("train", 2))

    def test_thresholds_that_need_solving_are_named_and_left_as_they_are(self, filled) -> None:
        yields = WhatIfStore(filled)
        values = {"calibration": {"check_labels": False}, "min_jac": 0.5, "ball_diameter_m": 0.3}
        found = count_yield(yields, 1, values)
        assert found.needs_solving == ("calibration.check_labels",)
        assert found.passing == count_yield(yields, 1, {"min_jac": 0.5}).passing

    @pytest.mark.parametrize("name", ["ball_diameter_m", "pitch_length_m", "pitch_width_m"])
    def test_what_the_table_passes_over_changes_no_gate_of_a_solve(
        self, solutions, name: str
    ) -> None:
        (threshold,) = (item for item in THRESHOLDS if item.name == name)
        assert threshold.subject in WITHOUT_EFFECT
        other = replace(PAPER, **{name: threshold.maximum})
        for group, old in solutions[:10]:
            again = solved_again(group, old, other)
            assert [gate.passed for gate in again.gates] == [gate.passed for gate in old.gates]

    def test_an_empty_dataset_yields_nothing(self, store) -> None:
        ensure_dataset(store, "demo", "ann")
        found = count_yield(WhatIfStore(store), 1)
        counted(found)
        assert found.groups == 0

    def test_an_unknown_dataset_is_not_found(self, store) -> None:
        with pytest.raises(NotFoundError):
            count_yield(WhatIfStore(store), 9)


class TestYieldStore:
    def test_unsolved_groups_are_the_first_step(self, store, fill, make_group) -> None:
        fill(make_group(7), make_group(8), solved=False)
        yields = WhatIfStore(store)
        found = count_yield(yields, 1)
        counted(found)
        assert (found.funnel[0].gate, found.funnel[0].dropped, found.unsolved) == ("unsolved", 2, 2)
        solve_dataset(store, "demo")
        assert count_yield(yields, 1).passing == 2

    def test_an_edit_is_seen_and_an_undo_too(self, store, fill, make_group) -> None:
        ids = fill(make_group(7), make_group(8), make_group(9))
        yields = WhatIfStore(store)
        assert count_yield(yields, 1).passing == 3
        state = load_group_state(store, ids[1])
        state = submit_edit(
            store, ids[1], make_set_ball_edit("8.png", None), if_match=state.etag, actor="ann"
        )
        found = count_yield(yields, 1)
        assert [step.gate for step in found.funnel if step.dropped] == ["ball"]
        submit_edit(
            store,
            ids[2],
            SetViewInclusion("9.png", False),
            if_match=load_group_state(store, ids[2]).etag,
            actor="b",
        )
        assert count_yield(yields, 1).passing == 1
        fresh = count_yield(WhatIfStore(store), 1)
        assert fresh == count_yield(yields, 1)

    def test_a_new_policy_needs_no_solution_to_be_answered(self, store, fill, make_group) -> None:
        fill(make_group(7), make_group(8))
        yields = WhatIfStore(store)
        before = yields.get_snapshot(1)
        narrow = replace(PAPER, min_parallax_degrees=5.0, max_sigma_m=1e-6)
        change_policy(store, "demo", narrow, if_match=None, actor="ann")
        found = count_yield(yields, 1)
        assert (found.unsolved, found.passing) == (0, 0)
        assert yields.get_snapshot(1).blocks[0].table is before.blocks[0].table
        other = replace(PAPER, calibration=CalibrationPolicy(robust_scale_px=3.0))
        change_policy(store, "demo", other, if_match=None, actor="ann")
        assert count_yield(yields, 1).unsolved == 2

    def test_nothing_is_read_again_while_nothing_changes(self, filled) -> None:
        yields = WhatIfStore(filled)
        assert yields.get_snapshot(1) is yields.get_snapshot(1)

    def test_the_oldest_table_goes_when_memory_is_short(
        self, store, fill, make_group, monkeypatch
    ) -> None:
        fill(make_group(7))
        import_groups(store, "other", [make_group(8)], source="test", actor="ann")
        solve_dataset(store, "other")
        yields = WhatIfStore(store)
        first = yields.get_snapshot(get_dataset(store, "demo").id)
        monkeypatch.setattr("app.features.what_if.service.MAX_BYTES", first.nbytes)
        yields.get_snapshot(get_dataset(store, "other").id)
        assert yields.get_snapshot(1) is not first
        assert np.array_equal(
            yields.get_snapshot(1).table.facts.pair_moved, first.table.facts.pair_moved
        )

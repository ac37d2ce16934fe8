"""Gold groups by what a sample knows of itself, and by a frozen version."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.db.store import Store
from app.errors import InputError
from app.features.agreement.service import compare_or_adopt_submission
from app.features.audit.queries import AuditQuery
from app.features.audit.service import read_audit
from app.features.batches.leases import BatchMember, LeaseService
from app.features.batches.progress import list_own_batches
from app.features.batches.service import NewBatch, change_batch, make_batch
from app.features.groups.edit import SetLines, make_set_ball_edit
from app.features.groups.submit import load_group_state, submit_edit
from app.features.imports.ingest import import_groups
from app.features.independent_annotations.gold import TruthSource, read_gold_report, set_gold_start
from app.features.independent_annotations.known_truth import (
    BatchAnnotationTerms,
    GoldChoice,
    begin_next_annotation,
    mark_groups_with_known_truth,
)
from app.features.independent_annotations.queries import GOLD
from app.features.independent_annotations.service import get_annotation_of_copy
from app.features.people.roles import Role
from app.features.people.service import invite
from app.features.people.visibility_queries import EVERYTHING
from app.features.solutions.service import solve_dataset
from app.features.verdicts.service import set_verdict
from app.features.versions.freeze import FreezeRequest, freeze_dataset
from app.json_text import json_text
from app.sample.scene import TRUTH, truth_to_json
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box, ImagePoint
from app.soccer.group import Media
from app.solving.jaccard import project_markings
from tests.scenes import make_scenes
from tests.unit.features.independent_annotations.begun import begin_for_batch, begin_take

SAMPLE = GoldChoice(TruthSource.SAMPLE, start="bare")


@pytest.fixture
def scenes(store: Store, tmp_path: Path):
    """Four scenes in ``demo``, their frames where the sample was written; one shows no one moment."""
    made = make_scenes(groups=4, seed=3, faults=False)
    truths = {scene.truth.key: truth_to_json(scene.truth) for scene in made}
    truths[made[3].truth.key]["faults"] = [{"kind": "not_synchronous", "view": "x", "amount": 2.0}]
    (tmp_path / TRUTH).write_text(json_text({"seed": 3, "groups": truths}))
    groups = []
    for scene in made:
        folder = (tmp_path / scene.group.key).parent
        views = tuple(
            replace(view, media=Media(str(folder / "Frames-v3.zip"), view.key))
            for view in scene.group.views
        )
        groups.append(replace(scene.group, views=views))
    import_groups(store, "demo", groups, source="files", actor="local")
    return made


def judge(store: Store, group: int, person: str) -> None:
    etag = load_group_state(store, group).etag
    set_verdict(store, group, "accepted", None, "seen", if_match=etag, actor=person)


def drawn_as_it_is(store: Store, copy: int, scene, aside: float) -> None:
    """Annotate a bare copy by the true cameras, its balls ``aside`` pixels to the right."""
    for mine, view in zip(
        load_group_state(store, copy).group.views, scene.group.views, strict=True
    ):
        truth = scene.truth.view(view.key)
        shown = project_markings(truth.camera, scene.group.pitch, view.size)
        lines = {
            name: tuple(ImagePoint(x, y) for x, y in shown[name][:: max(len(shown[name]) // 6, 1)])
            for name in view.station.lines
            if name in shown and len(shown[name]) > 1
        }
        etag = load_group_state(store, copy).etag
        submit_edit(store, copy, SetLines(mine.key, lines), if_match=etag, actor="ann")
        x, y = truth.camera.project(np.array([truth.ball]))[0]
        d = truth.ball_diameter_px
        box = Box(x + aside - d / 2, y - d / 2, d, d)
        etag = load_group_state(store, copy).etag
        submit_edit(
            store,
            copy,
            make_set_ball_edit(mine.key, BallAnnotation(box=box)),
            if_match=etag,
            actor="ann",
        )


class TestSample:
    def test_errors_are_those_against_the_true_cameras_and_ball(self, store, scenes) -> None:
        chosen = mark_groups_with_known_truth(store, "demo", SAMPLE, actor="lea")
        assert (len(chosen.groups), chosen.left_out) == (3, 1)
        terms = BatchAnnotationTerms(
            4, load_group_state(store, 1).dataset_id, [4], 1, True, "2000", gold_every=1
        )
        take = begin_next_annotation(store, terms, person="ann")
        assert take is not None and take.kind == "gold"
        scene = scenes[take.group_id - 1]
        drawn_as_it_is(store, take.copy_id, scene, 0.0)
        judge(store, take.copy_id, "ann")
        report = read_gold_report(store, "demo")
        assert {one.source for one in report.groups} == {TruthSource.SAMPLE}
        ((result,),) = [person.results for person in report.people]
        assert result.error.line_px < 0.5 and result.error.ball_px < 0.01
        assert result.error.ball_m < 0.05
        assert (result.right, result.true_verdict) == (None, "unreviewed")

    def test_balls_that_are_aside_are_off_by_that_much(self, store, scenes) -> None:
        mark_groups_with_known_truth(store, "demo", replace(SAMPLE, query="", size=1), actor="lea")
        take = begin_for_batch(store, 1, "ann", kind=GOLD, nameless=True)
        drawn_as_it_is(store, take.copy_id, scenes[0], 6.0)
        judge(store, take.copy_id, "ann")
        ((result,),) = [person.results for person in read_gold_report(store, "demo").people]
        assert result.error.ball_px == pytest.approx(6)
        assert result.error.line_px < 0.5 and result.error.ball_m > 0.05

    def test_what_annotators_begin_with_changes_nothing_of_what_is_known(
        self, store, scenes
    ) -> None:
        mark_groups_with_known_truth(store, "demo", replace(SAMPLE, query="", size=1), actor="lea")
        judge(store, 1, "lea")
        # Said twice it is changed once.
        for _ in range(2):
            assert set_gold_start(store, 1, "imported", actor="lea").source is TruthSource.SAMPLE
        audit = read_audit(store, AuditQuery(), EVERYTHING).items
        assert [one.sentence for one in audit if one.kind == "gold"] == [
            "set what annotators of gold group 1 begin with: the imported annotations",
            "marked 1 group of a sample as gold",
        ]

    def test_other_groups_of_the_same_names_have_no_truth(self, store, scenes, tmp_path) -> None:
        truth = tmp_path / TRUTH
        truth.rename(tmp_path / "elsewhere.json")
        with pytest.raises(InputError, match="none of these groups has known true values"):
            mark_groups_with_known_truth(store, "demo", SAMPLE, actor="lea")
        truth.symlink_to(tmp_path / "elsewhere.json")
        with pytest.raises(InputError, match="none of these groups has known true values"):
            mark_groups_with_known_truth(store, "demo", SAMPLE, actor="lea")


class TestVersion:
    def test_only_what_people_agreed_upon_is_the_truth(self, store, scenes) -> None:
        solve_dataset(store, "demo")
        for person in ("ann", "bo"):
            copy = begin_take(store, 2, person=person).copy_id
            judge(store, copy, person)
        assert compare_or_adopt_submission(store, copy) == "agreed"
        judge(store, 1, "ann")
        judge(store, 3, "cy")
        for person, moved in (("ann", 0.0), ("bo", 40.0)):
            copy = begin_take(store, 3, person=person).copy_id
            drawn_as_it_is(store, copy, scenes[2], moved)
            judge(store, copy, person)
        assert compare_or_adopt_submission(store, copy) == "open"
        freeze_dataset(store, "demo", FreezeRequest("v1"), actor="lea")
        key = load_group_state(store, 2).group.views[0].key
        ball = BallAnnotation(box=Box(10.0, 10.0, 14.0, 14.0))
        frozen = load_group_state(store, 2)
        submit_edit(store, 2, make_set_ball_edit(key, ball), if_match=frozen.etag, actor="cy")
        choice = GoldChoice(TruthSource.VERSION, version="v1")
        assert mark_groups_with_known_truth(store, "demo", choice, actor="lea").groups == (2,)
        take = begin_for_batch(store, 2, "dee", kind=GOLD, nameless=True)
        judge(store, take.copy_id, "dee")
        ((result,),) = [person.results for person in read_gold_report(store, "demo").people]
        assert (result.right, result.error.ball_px, result.error.line_px) == (True, 0, 0)
        with pytest.raises(InputError, match="give the frozen version"):
            mark_groups_with_known_truth(
                store, "demo", GoldChoice(TruthSource.VERSION), actor="lea"
            )


class TestRunningBatch:
    def test_gold_groups_come_into_it_and_what_was_handed_in_is_not_given_again(
        self, store, scenes
    ) -> None:
        invite(store, "ada", Role.ANNOTATOR, actor="local")
        new = NewBatch("a", query="number>=2", annotators=["ada"])
        batch = make_batch(store, "demo", new, actor="lea")
        leases, ada = LeaseService(store), BatchMember("ada")
        first = leases.lease_next_group(batch.id, ada).group
        leases.submit_group(batch.id, first, ada, actor="ada")
        mark_groups_with_known_truth(store, "demo", replace(SAMPLE, query="number<=1"), actor="lea")
        change_batch(store, batch.id, actor="lea", gold_every=1)
        copy = leases.lease_next_group(batch.id, ada).group
        assert load_group_state(store, copy).group.label == "Group 1"
        judge(store, copy, "ada")
        assert [one.person for one in read_gold_report(store, "demo").people] == ["ada"]
        assert list_own_batches(store, lambda _: ada)[0].left == 2
        second = get_annotation_of_copy(
            store, leases.lease_next_group(batch.id, ada).group
        ).group_id
        change_batch(store, batch.id, actor="lea", no_gold=True)
        assert {first, second, leases.lease_next_group(batch.id, ada).group} <= {
            2,
            3,
            4,
        } and first != second

"""ETags worked out from rows are those of the whole states."""

from __future__ import annotations

from app.db.store import Store
from app.features.groups.edit import SetStationLines, SetViewInclusion
from app.features.groups.state import (
    GroupChangeBasis,
    GroupState,
    content_tag_from_etag,
    group_etag,
    read_etags,
    read_group_change_basis,
)
from app.features.groups.submit import load_group_state, submit_edit
from app.features.groups.undo import undo_group_edit
from app.features.imports.ingest import import_groups
from app.features.stations.service import load_station, submit_station_edit, undo_station
from app.features.verdicts.service import set_verdict
from app.soccer.frames import ImagePoint


def etags_of(store: Store, *ids: int) -> dict[int, str]:
    with store.read() as session:
        return read_etags(session, ids)


class TestReadEtags:
    def test_follows_edits_and_verdicts(self, store: Store, state: GroupState) -> None:
        seen = [state.etag]
        edited = submit_edit(
            store, state.id, SetViewInclusion("7.png", False), if_match=seen[0], actor="ann"
        )
        seen.append(edited.etag)
        assert etags_of(store, state.id) == {state.id: edited.etag}
        judged = set_verdict(store, state.id, "deferred", if_match=edited.etag, actor="ann")
        seen.append(judged.etag)
        assert etags_of(store, state.id) == {state.id: judged.etag}
        assert len(set(seen)) == 3

    def test_what_is_undone_is_not_what_it_was(self, store: Store, state: GroupState) -> None:
        edit = SetViewInclusion("7.png", False)
        edited = submit_edit(store, state.id, edit, if_match=state.etag, actor="ann")
        undone = undo_group_edit(store, state.id, if_match=edited.etag, actor="ann")
        assert undone.stored.inputs_hash == state.stored.inputs_hash
        assert etags_of(store, state.id) == {state.id: undone.etag} != {state.id: state.etag}

    def test_a_static_camera_that_was_changed_and_changed_back_makes_a_cached_document_old(
        self, store: Store, fill, make_static
    ) -> None:
        """Its own ETag is another, and whoever went on from the old one would be refused."""
        (one, other) = fill(make_static(10), make_static(11))
        before = load_group_state(store, one)
        station = load_station(store, before.station_ids["cam1"])
        edit = SetStationLines({"Middle line": (ImagePoint(1.5, 2.5), ImagePoint(3.0, 4.0))})
        edited = submit_station_edit(store, station.id, edit, if_match=station.etag, actor="ann")
        undone = undo_station(store, station.id, if_match=edited.etag, actor="ann")
        for number in (one, other):
            assert (
                load_group_state(store, number).station_etags["cam1"] == undone.etag != station.etag
            )
        after = load_group_state(store, one)
        assert etags_of(store, one) == {one: after.etag} != {one: before.etag}
        # What was said is the same: an edit of another view still goes through.
        assert content_tag_from_etag(after.etag) == content_tag_from_etag(before.etag)

    def test_other_thresholds_under_the_same_name_are_another(self) -> None:
        etags = {group_etag("said", policy, "custom", (), 0) for policy in ("one", "two")}
        assert len(etags) == 2

    def test_without_a_solution_is_another(self, store: Store, fill, make_group) -> None:
        (one,) = fill(make_group(), solved=False)
        before = load_group_state(store, one).etag
        assert etags_of(store, one) == {one: before}
        fill()
        assert etags_of(store, one) == {one: load_group_state(store, one).etag} != {one: before}

    def test_counts_the_findings_of_the_solution_and_of_imports(
        self, store: Store, fill, make_group
    ) -> None:
        ids = fill(make_group(7, shift=300.0), make_group(8))
        edit = SetViewInclusion("8.png", False)
        etag = load_group_state(store, ids[1]).etag
        submit_edit(store, ids[1], edit, if_match=etag, actor="ann")
        # The same group comes with another ball: what a person edited stays, with a finding.
        import_groups(
            store, "demo", [make_group(8, ball=(6.0, 2.0, -0.5))], source="b", actor="ann"
        )
        fill()
        states = {number: load_group_state(store, number) for number in ids}
        assert all(state.solution.findings for state in states.values())
        assert etags_of(store, *ids) == {number: item.etag for number, item in states.items()}

    def test_leaves_out_groups_that_do_not_exist(self, store: Store, state: GroupState) -> None:
        assert list(etags_of(store, state.id, 99)) == [state.id]


class TestReadHead:
    def test_is_the_first_part_of_the_etag_and_the_policy(
        self, store: Store, state: GroupState
    ) -> None:
        with store.read() as session:
            said = state.etag.strip('"').partition("-")[0]
            assert read_group_change_basis(session, state.id) == GroupChangeBasis(
                said, state.policy.hash
            )
            assert read_group_change_basis(session, 99) is None

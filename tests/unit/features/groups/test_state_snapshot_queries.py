from __future__ import annotations

from sqlalchemy import insert, select

from app.db.dialects.dialect import get_session_dialect
from app.db.store import Store
from app.features.datasets.tables import GroupModel, ImportFindingModel, StationModel, ViewModel
from app.features.groups.queries import upsert_unassigned_frames
from app.features.groups.state_snapshot_queries import (
    iterate_groups,
    iterate_stations,
    iterate_verdicts,
    list_all_import_findings,
    list_all_unassigned_frames,
    replace_all_rows,
)
from app.features.paint.proposal_queries import Proposal, read_proposals, save_proposals
from app.features.predictions.tables import PredictionModel, PredictionSetModel
from app.features.verdicts.queries import StoredVerdict, insert_verdicts_and_end_work

VERDICT = StoredVerdict(7, 1, "ann", "t", "accepted", None, None, "h", "p", False, None)


def proposal(view_id: int) -> Proposal:
    return Proposal(view_id, "unsure", "Odd.", {}, 0.5, 0.4, 30, 0.2, None, "f", "s", "1")


class TestAll:
    def test_everything_that_the_log_can_make_anew_is_read(self, filled: Store, full_group) -> None:
        with filled.write() as session:
            insert_verdicts_and_end_work(session, 1, [VERDICT], actor="ann", at="t")
            upsert_unassigned_frames(session, 1, {("cam1", "99"): b"x"})
            said = {"group_id": 1, "kind": "edited", "sentence": "kept"}
            session.execute(insert(ImportFindingModel), [said])
        with filled.read() as session:
            stations = {item.station.key: item.station for item in iterate_stations(session)}
            assert stations == {view.station.key: view.station for view in full_group.views}
            assert [item.group for item in iterate_groups(session)] == [full_group]
            (verdict,) = iterate_verdicts(session)
            assert {**verdict, "id": 7} == vars(VERDICT)
            assert [(row.camera, row.frame) for row in list_all_unassigned_frames(session)] == [
                ("cam1", "99")
            ]
            assert [row.sentence for row in list_all_import_findings(session)] == ["kept"]


def whole(session):
    """Rows of stations, groups and views, as they are."""
    return (
        [dict(row._mapping) for row in session.execute(select(*model.__table__.columns))]
        for model in (StationModel, GroupModel, ViewModel)
    )


class TestRewrite:
    def test_rows_are_replaced_while_verdicts_refer_to_them(self, filled: Store) -> None:
        with filled.write() as session:
            insert_verdicts_and_end_work(session, 1, [VERDICT], actor="ann", at="t")
            upsert_unassigned_frames(session, 1, {("cam1", "99"): b"x"})
            stations, groups, views = whole(session)
            label = [{**row, "label": "anew"} for row in groups]
            replace_all_rows(
                session, stations=stations, groups=label, views=views, noticed=[], unassigned=[]
            )
        with filled.read() as session:
            assert [item.group.label for item in iterate_groups(session)] == ["anew"]
            assert list(list_all_unassigned_frames(session)) == []
            assert len(list(iterate_verdicts(session))) == 1
            assert get_session_dialect(session).count_lost_references(session) == 0

    def test_what_nobody_said_stays_with_the_views_that_are_there_again(
        self, filled: Store
    ) -> None:
        with filled.write() as session:
            stations, groups, views = whole(session)
            ids = [row["id"] for row in views]
            assert len(ids) > 1
            save_proposals(session, [proposal(number) for number in ids])
            named = {"id": 1, "dataset_id": groups[0]["dataset_id"], "name": "detector"}
            words = dict.fromkeys(("format", "source", "created", "actor", "digest", "report"), "")
            numbers = dict.fromkeys(("frames", "boxes", "cameras", "unknown"), 0)
            session.execute(insert(PredictionSetModel), [{**named, **words, **numbers}])
            box = {"set_id": 1, "x": 1.0, "y": 2.0, "width": 3.0, "height": 4.0, "score": 0.5}
            session.execute(insert(PredictionModel), [{**box, "view_id": item} for item in ids])
            before = session.execute(select(*PredictionModel.__table__.columns)).all()
            replace_all_rows(
                session,
                stations=stations,
                groups=groups,
                views=views[1:],
                noticed=[],
                unassigned=[],
            )
        with filled.read() as session:
            assert read_proposals(session, ids) == {item: proposal(item) for item in ids[1:]}
            after = session.execute(select(*PredictionModel.__table__.columns)).all()
            assert after == before[1:]

from __future__ import annotations

from sqlalchemy import insert, select, text

from app.store.models import GroupModel, ImportFindingModel, StationModel, ViewModel
from app.store.projection import (
    all_groups,
    all_noticed,
    all_spare,
    all_stations,
    all_verdicts,
    rewrite,
)
from app.store.session import Store
from app.store.spare import put_spare
from app.store.verdicts import StoredVerdict, insert_verdicts

VERDICT = StoredVerdict(7, 1, "ann", "t", "accepted", None, None, "h", "p", False, None)


class TestAll:
    def test_everything_that_the_log_can_make_anew_is_read(self, filled: Store, group) -> None:
        with filled.write() as session:
            insert_verdicts(session, 1, [VERDICT], actor="ann", at="t")
            put_spare(session, 1, {("cam1", "99"): b"x"})
            said = {"group_id": 1, "kind": "edited", "sentence": "kept"}
            session.execute(insert(ImportFindingModel), [said])
        with filled.read() as session:
            stations = {item.station.key: item.station for item in all_stations(session)}
            assert stations == {view.station.key: view.station for view in group.views}
            assert [item.group for item in all_groups(session)] == [group]
            (verdict,) = all_verdicts(session)
            assert {**verdict, "id": 7} == vars(VERDICT)
            assert [(row.camera, row.frame) for row in all_spare(session)] == [("cam1", "99")]
            assert [row.sentence for row in all_noticed(session)] == ["kept"]


class TestRewrite:
    def test_rows_are_replaced_while_verdicts_refer_to_them(self, filled: Store) -> None:
        with filled.write() as session:
            insert_verdicts(session, 1, [VERDICT], actor="ann", at="t")
            put_spare(session, 1, {("cam1", "99"): b"x"})
            stations, groups, views = (
                [dict(row._mapping) for row in session.execute(select(*model.__table__.columns))]
                for model in (StationModel, GroupModel, ViewModel)
            )
            label = [{**row, "label": "anew"} for row in groups]
            rewrite(session, stations=stations, groups=label, views=views, noticed=[], spare=[])
        with filled.read() as session:
            assert [item.group.label for item in all_groups(session)] == ["anew"]
            assert list(all_spare(session)) == []
            assert len(list(all_verdicts(session))) == 1
            assert not session.execute(text("PRAGMA foreign_key_check")).all()

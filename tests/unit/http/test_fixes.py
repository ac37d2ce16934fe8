"""The page of fixes: every action is on it, and its requests do what is offered."""

from __future__ import annotations

import ast
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from app.features.groups.edit_codec import edit_to_json
from app.features.groups.submit import load_group_state
from app.features.groups.suggested_edits import _ACTIONS, list_edits_of_fix
from app.features.imports.ingest import import_groups
from app.soccer.finding import FINDING_KINDS, SuggestedFix
from app.soccer.frames import ImagePoint
from app.soccer.group import Group
from app.soccer.pitch import MARKINGS
from tests.docs.fixes import ACTIONS, EDITS, FINDINGS, PAGE, fixes_page, request_of

ROOT = Path(__file__).resolve().parents[3]
SOURCES = ("findings.py", "calibration_findings.py")


def proposed() -> dict[str, set[str]]:
    """The actions that the solver's findings propose, by kind, read off its source."""
    found: dict[str, set[str]] = {}
    for name in SOURCES:
        tree = ast.parse((ROOT / "app" / "solving" / name).read_text(encoding="utf-8"))
        for part in ast.walk(tree):
            if isinstance(part, ast.FunctionDef):
                called: dict[str, set[str]] = {"Finding": set(), "SuggestedFix": set()}
                for call in ast.walk(part):
                    if isinstance(call, ast.Call) and isinstance(call.func, ast.Name):
                        words = called.get(call.func.id)
                        if words is not None and isinstance(call.args[0], ast.Constant):
                            words.add(str(call.args[0].value))
                for kind in called["Finding"]:
                    found.setdefault(kind, set()).update(called["SuggestedFix"])
    return found


def fix_of(action: str, group: Group) -> SuggestedFix:
    """A fix of that action for the first view of a group."""
    view = group.views[0]
    first, second = sorted(view.station.lines)[:2]
    if action == "hide_marking":
        first = next(marking for marking in MARKINGS if marking not in view.station.lines)
    to = second if action == "relabel" else None
    return SuggestedFix(action, view.key, first, to, 1 if action == "pick_ball" else 0)


class TestPage:
    def test_is_up_to_date(self) -> None:
        assert PAGE.read_text(encoding="utf-8") == fixes_page(), "run python -m tests.docs"

    def test_has_every_action_and_every_finding(self) -> None:
        assert set(ACTIONS) == set(_ACTIONS)
        assert set(FINDINGS) == {*FINDING_KINDS}

    def test_says_of_each_finding_what_the_solver_proposes(self) -> None:
        for kind, actions in proposed().items():
            assert set(FINDINGS[kind][0]) == actions, kind


class TestRequests:
    @pytest.mark.parametrize("action", [name for name, (_, edit) in ACTIONS.items() if edit])
    def test_each_does_what_is_offered(self, app: Any, api: Any, group: Group, action: str) -> None:
        store = app.state.services.store
        view = group.views[0]
        moved = replace(view.balls[0], box=replace(view.balls[0].box, x=5.0))
        two = replace(view, balls=(*view.balls, moved), included=action != "include_view")
        import_groups(store, "fixed", [group.with_view(two)], source="test", actor="local")
        (row,) = api.get("/api/v1/groups", params={"dataset": "fixed"}).json()["items"]
        document = api.get(f"/api/v1/groups/{row['id']}").json()
        state = load_group_state(store, row["id"])
        (offer,) = list_edits_of_fix(state.group, fix_of(action, state.group), ImagePoint(9.0, 8.0))
        edit = edit_to_json(offer.edit)
        assert edit["edit"] == ACTIONS[action][1]
        ids = {one["key"]: one["id"] for one in document["views"]}
        path, body = request_of(edit, ids)
        assert EDITS[edit["edit"]][0] == f"PATCH {path.removeprefix('/api/v1')}".replace(
            str(ids[view.key]), "{id}"
        )
        sent = api.patch(path, json=body, headers={"If-Match": document["etag"]})
        assert sent.status_code == 200, sent.text
        assert load_group_state(store, row["id"]).group == offer.edit.apply(state.group)

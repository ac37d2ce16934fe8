"""A name says one number: in the list, in the group's document and in every file."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, get_type_hints

import pytest

from app.db.store import Store
from app.features.datasets.service import get_dataset
from app.features.exports.service import export_dataset
from app.features.groups.schemas import GroupDocument
from app.features.groups.submit import load_group_state
from app.features.imports.ingest import import_groups
from app.features.policies.service import change_policy
from app.features.queue.routes import GroupRow
from app.features.queue.service import list_groups
from app.features.solutions.service import solve_dataset
from app.soccer.policy import PAPER, TOUCHLINE, Policy
from tests.scenes import make_scenes

Document = Mapping[str, Any]
GROUPS = 30


def same(one: Any, other: Any) -> bool:
    if one is None or other is None:
        return one is other
    return bool(one == pytest.approx(other, rel=1e-12, abs=0))


def best_pair(group: Document) -> float | None:
    """The gate of the reprojection: the larger error of the pair that fits best."""
    (gate,) = [gate for gate in group["solution"]["gates"] if gate["name"] == "reprojection"]
    value: float | None = gate["value"]
    return value


def best_percent(group: Document) -> float | None:
    error, sizes = best_pair(group), {view["key"]: view for view in group["views"]}
    for pair in group["solution"]["pairs"]:
        for key, apart in zip((pair["a"], pair["b"]), pair["errors_px"], strict=True):
            if apart == error:
                return 100 * apart / math.hypot(sizes[key]["width"], sizes[key]["height"])
    return None


def of_ball(name: str) -> Callable[[Document], Any]:
    def value(group: Document) -> Any:
        ball = group["solution"]["ball"]
        return None if ball is None else ball[name]

    return value


def axis(number: int) -> Callable[[Document], Any]:
    def value(group: Document) -> Any:
        point = of_ball("point")(group)
        return None if point is None else point[number]

    return value


def deciding(name: str) -> Callable[[Document], Any]:
    def value(group: Document) -> Any:
        counted = ("calibratable", "two_views", "ball")
        gates = group["solution"]["gates"]
        failing = [gate for gate in gates if gate["active"] and not gate["passed"]]
        near = [
            gate
            for gate in gates
            if gate["active"] and gate["margin"] is not None and gate["name"] not in counted
        ]
        (gate, *_) = failing or sorted(near, key=lambda one: one["margin"]) or [{"margin": None}]
        margin = gate["margin"]
        return abs(margin) if margin is not None and name == "value" else margin

    return value


def of_views(path: str, choose: Callable[[list[Any]], Any]) -> Callable[[Document], Any]:
    """What is chosen of a number of the views in use, those alone that have it."""

    def value(group: Document) -> Any:
        found = []
        used = {view["key"] for view in group["views"] if view["included"]}
        for view in group["solution"]["views"]:
            if view["view"] not in used:
                continue
            inner: Any = view
            for name in path.split("/"):
                inner = None if inner is None else inner[name]
            if inner is not None:
                found.append(inner)
        return choose(found) if found else None

    return value


def first_view(group: Document) -> tuple[Document, Document] | None:
    """What was said and computed of the first view that the ball comes from."""
    ball = group["solution"]["ball"]
    if ball is None:
        return None
    (solved,) = [one for one in group["solution"]["views"] if one["view"] == ball["views"][0]]
    (said,) = [one for one in group["views"] if one["key"] == ball["views"][0]]
    return said, solved


def distance(group: Document) -> float | None:
    first = first_view(group)
    if first is None:
        return None
    camera = first[1]["calibration"]["camera"]["position_meters"]
    return math.dist(camera, group["solution"]["ball"]["point"])


LIST: Mapping[str, Callable[[Document], Any]] = {
    "margin": deciding("margin"),
    "min_jac": of_views("calibration/jac/0.5", min),
    "error_px": best_pair,
    "error_percent": best_percent,
    "sigma_m": of_ball("sigma_m"),
    "parallax_degrees": of_ball("parallax_degrees"),
    "size_ratio": of_views(
        "ball/size_ratio", lambda all_: max(all_, key=lambda r: abs(math.log(r)))
    ),
    "height_m": of_ball("height_m"),
    "distance_m": distance,
    "x_m": axis(0),
    "y_m": axis(1),
    "agreement": of_views("calibration/paint/agreement", min),
}
"""Every number of a row of the list, by the group's document."""
SNV3D = {"rep_error": "error_px", "optimized_error": "optimized_error_m"}
ELSEWHERE = {"box_px"}
"""Annotated boxes stand in the document of the group, optimised ones of points beside them."""


@pytest.fixture(
    params=[PAPER, replace(PAPER, name="best", point="best", jac_gamma_percent=1.0), TOUCHLINE],
    ids=lambda policy: policy.name,
)
def solved(store: Store, request: pytest.FixtureRequest) -> Store:
    """The sample's groups, with planted faults, under a policy."""
    policy: Policy = request.param
    groups = [scene.group for scene in make_scenes(groups=GROUPS, seed=3)]
    import_groups(store, "demo", groups, source="test", actor="ann")
    if policy != PAPER:
        change_policy(store, "demo", policy, if_match=None, actor="ann")
    solve_dataset(store, "demo")
    return store


def rows_of(store: Store) -> dict[str, Document]:
    page = list_groups(store, get_dataset(store, "demo").id, limit=500)
    documents = [GroupRow.of(row).model_dump(mode="json") for row in page.items]
    return {row["key"]: row for row in documents}


def groups_of(store: Store) -> dict[str, Document]:
    ids = [row["id"] for row in rows_of(store).values()]
    states = [GroupDocument.of(load_group_state(store, number)) for number in ids]
    return {(said := state.model_dump(mode="json"))["key"]: said for state in states}


def test_every_number_of_the_list_is_compared() -> None:
    hints = get_type_hints(GroupRow)
    numbers = {name for name, hint in hints.items() if hint == float | None}
    assert numbers == LIST.keys() | ELSEWHERE


def test_the_list_says_what_the_groups_say(solved: Store) -> None:
    rows, groups = rows_of(solved), groups_of(solved)
    assert len(rows) == GROUPS
    assert {row["passes"] for row in rows.values()} == {True, False}
    assert any(len(group["views"]) > 2 for group in groups.values())
    for key, row in rows.items():
        for name, told in LIST.items():
            assert same(row[name], told(groups[key])), (key, name)


def test_parquet_says_what_the_groups_say(solved: Store, tmp_path: Path) -> None:
    """Each column that is called like a number of the view's ball, or of the 3D ball, is that."""
    parquet = pytest.importorskip("pyarrow.parquet")
    out = export_dataset(solved, "demo", "parquet", tmp_path / "out", everything=True).out
    written = parquet.read_table(out / "views.parquet").to_pylist()
    groups, compared = groups_of(solved), set()
    for row in written:
        solution = groups[row["group"]]["solution"]
        (view,) = [one for one in solution["views"] if one["view"] == row["view"]]
        if not row["in_valid_pair"]:
            continue
        for told in (solution["ball"], view["ball"]):
            # No numbers of the ball: which ball it is, and how many views the group has.
            for name in row.keys() & told.keys() - {"point", "views"}:
                assert same(row[name], told[name]), (row["group"], name)
                compared.add(name)
    assert {"error_px", "error_percent", "sigma_m", "parallax_degrees", "size_ratio"} <= compared
    with_parallax = {row["group"] for row in written if row["parallax_degrees"] is not None}
    listed = {key for key, row in rows_of(solved).items() if row["parallax_degrees"] is not None}
    assert with_parallax == listed


def test_the_table_of_soccernet_v3d_says_what_the_groups_say(solved: Store, tmp_path: Path) -> None:
    out = export_dataset(solved, "demo", "soccernet-v3d", tmp_path / "out", everything=True).out
    with (out / "SNv3D.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    groups = groups_of(solved)
    assert len(rows) == sum(len(group["views"]) for group in groups.values())
    told = [
        view["ball"] for group in groups.values() for view in group["solution"]["views"]
        if view["included"]
    ]  # fmt: skip
    for column, name in SNV3D.items():
        written = sorted(float(row[column]) for row in rows if row[column])
        said = sorted(ball[name] for ball in told)
        assert set(said) <= set(written), column

"""No number leaves infinite or NaN: one encoder, and a walk through every door."""

from __future__ import annotations

import ast
import csv
import dataclasses
import importlib
import io
import json
import math
import re
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import structlog
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel

import app
from app.evaluation.result import Axis, Chart, Panel, Series, figure_to_csv
from app.features.findings.service import GroupFindings
from app.features.groups.solution_schemas import SolutionDocument
from app.features.jobs.queries import _to_json_column as job_text
from app.features.solutions.codec import from_json, solution_json_text, to_json
from app.formats.export_formats import FORMATS, WriteOptions, write_format
from app.formats.export_record import ExportRecord
from app.formats.manifest import Manifest, write_manifest
from app.formats.parquet import import_pyarrow
from app.geometry.camera import Camera
from app.json_text import canonical_json_text, json_text, replace_non_finite
from app.log import replace_non_finite_numbers
from app.soccer.finding import Finding, SuggestedFix
from app.soccer.solution import BestBall, Gate, MarkingFit, Solution, SuspectLabel
from app.terminal.terminal import print_json, print_values
from tests.unit.formats.conftest import camera, issia_group, soccer_group, solved  # noqa: F401

BAD = (math.inf, -math.inf, math.nan)
NOT_A_NUMBER = re.compile(r"(?<![\w'\"])-?(?:Infinity|NaN|inf|nan)(?!\w)")

WRITERS = {
    "json.dump": {"json_text.py"},
    "json.dumps": {
        "json_text.py",
        "features/solutions/codec.py",  # the database's own text: names of numbers, read back as such
        "soccer/policy.py",  # a hash
        "soccer/paint_evidence.py",  # refuses them: what was read is finite
        "http/requests.py",  # measures, writes nothing
        "formats/json_reader.py",  # measures, writes nothing
    },
    "msgspec.json.encode": {"json_text.py"},
    "csv.writer": {"formats/csv_text.py", "evaluation/result.py"},
    "csv.DictWriter": set(),
}
"""Who may write without ``app.json_text``, and why that is sound."""


def strict(text: str) -> Any:
    """A JSON text by the letter of its standard."""

    def refuse(name: str) -> None:
        raise AssertionError(f"{name} in {text[:200]}")

    return json.loads(text, parse_constant=refuse)


def poisoned(value: Any, bad: float) -> Any:
    """The value with every float in it replaced, however deep; cameras are always finite."""
    if isinstance(value, float):
        return bad
    if isinstance(value, Camera):
        return value
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {
            item.name: poisoned(getattr(value, item.name), bad)
            for item in dataclasses.fields(value)
            if item.init
        }
        return dataclasses.replace(value, **fields)
    if isinstance(value, tuple):
        items = [poisoned(item, bad) for item in value]
        return value._make(items) if hasattr(value, "_make") else tuple(items)
    return value


def whole(solution: Solution) -> Solution:
    """A solution in which every optional part is there."""
    first = dataclasses.replace(
        solution.views[0].calibration,
        error_px=1.0,
        markings=(filled(MarkingFit),),
        suspects=(filled(SuspectLabel),),
        covariance=(1.0,) * 64,
    )
    views = (dataclasses.replace(solution.views[0], calibration=first), *solution.views[1:])
    finding = Finding(
        "sides_swapped", "?", None, None, None, 1.0, 1.0, 1.0, SuggestedFix("swap_sides")
    )
    best = BestBall((0.0, 0.0, 0.0), (0.0,) * 9, 1.0, ("a",), (), (("a", 1.0),))
    gates = (Gate("ball", True, 1.0, 1.0, 1.0, "?"),)
    return dataclasses.replace(
        solution, views=views, findings=(finding,), best_ball=best, gates=gates
    )


def filled(kind: Any) -> Any:
    """A value of a dataclass, made from nothing but its hints."""
    hints = {item.name: str(item.type) for item in dataclasses.fields(kind)}
    return kind(**{name: _of(hint) for name, hint in hints.items()})


def _of(hint: str) -> Any:
    if hint.startswith("tuple[float, ...]"):
        return (1.0, 2.0)
    if hint.startswith("tuple"):
        return ()
    for name, value in (("float", 1.0), ("ImagePoint", None), ("str", "x"), ("bool", True)):
        if hint.startswith(name):
            return value
    return 1 if hint.startswith("int") else None


@pytest.fixture(params=BAD, ids=str)
def bad(request: pytest.FixtureRequest) -> float:
    return float(request.param)


class TestFinite:
    def test_replaces_infinite_numbers_at_any_depth_and_nothing_else(self, bad: float) -> None:
        value = {"a": [1.5, (bad, "inf")], "b": {"c": bad}, "d": True, "e": 3}
        assert replace_non_finite(value) == {
            "a": [1.5, [None, "inf"]],
            "b": {"c": None},
            "d": True,
            "e": 3,
        }

    def test_text_is_json_by_the_letter(self, bad: float) -> None:
        assert json_text({"a": bad, "ä": 1.5}) == '{"a": null, "ä": 1.5}'
        assert json_text([bad], compact=True, ascii_=True) == "[null]"

    @pytest.mark.parametrize("form", [{}, {"indent": 1}, {"compact": True}, {"ascii_": True}])
    def test_text_is_spelt_as_python_spells_it(self, form: dict[str, Any]) -> None:
        value = {
            "a": [1, 2.5, None, True, "ü\n\u2028"],
            "b": {},
            "c": [],
            "d": {"e": [{"f": -0.0}]},
        }
        spelling = {"indent": form.get("indent"), "ensure_ascii": "ascii_" in form}
        separators = (",", ":") if "compact" in form else None
        assert json_text(value, **form) == json.dumps(value, separators=separators, **spelling)

    @pytest.mark.parametrize(
        "value",
        [{1.5: 1}, {None: 1}, {True: [math.inf]}, ["\ud800"], np.float64(1.5), [np.float64("inf")]],
        ids=repr,
    )
    def test_what_the_fast_encoder_has_no_place_for_is_text_all_the_same(self, value: Any) -> None:
        for form in ({}, {"indent": 1}, {"ascii_": True}, {"compact": True}):
            assert json.loads(json_text(value, **form)) == json.loads(
                json.dumps(replace_non_finite(value))
            )

    @given(st.floats(allow_nan=False, allow_infinity=False) | st.integers())
    def test_numbers_come_back_as_the_same_bits(self, number: float) -> None:
        again = json.loads(json_text([number]))[0]
        assert (type(again), repr(again)) == (type(number), repr(number))


class TestDoors:
    def test_nobody_writes_json_or_csv_past_the_one_encoder(self) -> None:
        root = Path(app.__file__).parent
        found = {
            (call, str(path.relative_to(root)))
            for path in root.rglob("*.py")
            for call in calls_of(path)
            if call in WRITERS
        }
        past = sorted(f"{file} calls {call}" for call, file in found if file not in WRITERS[call])
        assert past == [], "use app.json_text.json_text, or say in WRITERS why it need not"


def calls_of(path: Path) -> Iterator[str]:
    """What is called in a file that speaks of JSON or CSV, as it is spelt: ``json.dumps``."""
    text = path.read_text(encoding="utf-8")
    for node in ast.walk(ast.parse(text)) if re.search("json|csv", text) else ():
        if isinstance(node, ast.Call):
            yield ast.unparse(node.func)


def models(of: type[BaseModel] = BaseModel) -> Iterator[type[BaseModel]]:
    """Every document of the REST interface."""
    for kind in of.__subclasses__():
        yield from models(kind)
        if kind.__module__.startswith("app."):
            yield kind


class TestRest:
    def test_every_document_writes_null_instead(self, bad: float) -> None:
        importlib.import_module("app.main")
        # Bodies with passwords come in and never leave.
        documents = {
            model
            for model in models()
            if not any("Secret" in str(item.annotation) for item in model.model_fields.values())
        }
        assert len(documents) > 300
        for model in documents:
            # Whatever the type of a field, the worst that could stand there, also inside of it.
            values = dict.fromkeys(model.model_fields, bad)
            deep = {name: [bad, {"x": (bad,)}] for name in model.model_fields}
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                for fields in (values, deep):
                    strict(model.model_construct(**fields).model_dump_json())

    def test_a_solution_is_told_with_null(self, record: ExportRecord, bad: float) -> None:
        solution = poisoned(record.solution, bad)
        text = SolutionDocument.of(solution, record.group).model_dump_json()
        assert strict(text)["ball"]["sigma_m"] is None

    def test_a_job_keeps_and_tells_null(self, bad: float) -> None:
        assert job_text({"result": bad}) == '{"result":null}'


class TestFiles:
    @pytest.mark.parametrize("format_", FORMATS)
    def test_every_format_writes_finite_numbers(
        self, request: pytest.FixtureRequest, tmp_path: Path, format_: str, bad: float
    ) -> None:
        static = format_.startswith("issia")
        record = request.getfixturevalue("static_record" if static else "record")
        spoiled = dataclasses.replace(record, solution=poisoned(record.solution, bad))
        for everything in (False, True):
            out = tmp_path / str(everything)
            out.mkdir()
            write_format(out, [spoiled], WriteOptions(format_, everything))
            files = [path for path in out.rglob("*") if path.is_file()]
            assert files
            for path in files:
                require_finite(path)

    def test_a_manifest_is_finite(self, tmp_path: Path, bad: float) -> None:
        settings = {"policy": {"tau_percent": bad}}
        manifest = Manifest("d", "coco", "2026-01-01T00:00:00Z", {}, settings, "none")
        write_manifest(tmp_path, manifest)
        found = strict((tmp_path / "manifest.json").read_text())
        assert found["settings"]["policy"] == {"tau_percent": None}

    def test_a_figure_is_finite_as_csv(self, bad: float) -> None:
        series = Series("all", "All", x=(1.0, 2.0), y=(bad, 3.0))
        panel = Panel("p", Axis("x"), Axis("y"), (series,))
        figure = Chart("f", "t", (panel,))
        rows = list(csv.reader(io.StringIO(figure_to_csv(figure))))
        assert not NOT_A_NUMBER.search(str(rows))


def require_finite(path: Path) -> None:
    """Raise where a file of an export holds a number that is not finite."""
    if path.suffix == ".parquet":
        rows = import_pyarrow()[1].read_table(path).to_pylist()
        strict(json.dumps(rows))
    elif path.suffix == ".json":
        strict(path.read_text(encoding="utf-8"))
    else:
        assert not NOT_A_NUMBER.search(path.read_text(encoding="utf-8")), path.name


class TestCommandLine:
    def test_findings_are_printed_as_json(
        self, record: ExportRecord, bad: float, capsys: pytest.CaptureFixture[str]
    ) -> None:
        solution = poisoned(record.solution, bad)
        values = GroupFindings(
            1, 1, record.group, solution.findings, (None,) * len(solution.findings)
        ).findings_as_json
        print_json(values)
        (found,) = strict(capsys.readouterr().out)
        assert (found["number"], found["threshold"], found["confidence"]) == (None, None, None)

    def test_a_table_says_none(self, bad: float, capsys: pytest.CaptureFixture[str]) -> None:
        print_values({"sigma": bad, "by split": {"train": bad}}, False)
        assert not NOT_A_NUMBER.search(capsys.readouterr().out)

    def test_the_log_says_none(self, bad: float) -> None:
        event = replace_non_finite_numbers(
            None, "info", {"event": "solved", "sigma": bad, "all": [bad]}
        )
        line = structlog.processors.KeyValueRenderer()(None, "info", dict(event))
        assert not NOT_A_NUMBER.search(str(line))


class TestStored:
    def test_a_solution_comes_back_as_it_was(self, record: ExportRecord) -> None:
        solution = poisoned(record.solution, math.inf)
        text = solution_json_text(to_json(solution))
        strict(text)
        assert from_json(Solution, json.loads(text)).ball == solution.ball


@pytest.fixture
def record(
    solved: Callable[..., ExportRecord],  # noqa: F811
    soccer_group: Callable[..., Any],  # noqa: F811
) -> ExportRecord:
    """A SoccerNet group, its solution with every optional part."""
    made = solved(soccer_group(replays=2))
    assert made.solution is not None
    return dataclasses.replace(made, solution=whole(made.solution))


@pytest.fixture
def static_record(
    solved: Callable[..., ExportRecord],  # noqa: F811
    issia_group: Callable[..., Any],  # noqa: F811
) -> ExportRecord:
    """The same of static cameras."""
    made = solved(issia_group())
    assert made.solution is not None
    return dataclasses.replace(made, solution=whole(made.solution))


class TestCanonical:
    def test_keys_are_sorted_and_no_space_stands_between_them(self) -> None:
        assert canonical_json_text({"b": 1, "a": [1.5, None]}) == '{"a":[1.5,null],"b":1}'

    def test_letters_stand_as_they_are(self) -> None:
        assert canonical_json_text("Müller") == '"Müller"'

    def test_a_number_that_is_not_finite_is_refused(self) -> None:
        with pytest.raises(ValueError, match="JSON"):
            canonical_json_text(float("inf"))

"""Documents are read off the values that they show."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace

import pytest
from pydantic import Field, ValidationError

from app.features.groups.solution_schemas import FailingGate
from app.features.policies.schemas import PolicyDocument
from app.features.predictions.evaluation_routes import FrameList
from app.http.documents import Document, RequestBody, encode_document
from app.json_text import Moment
from app.soccer.policy import PAPER
from app.soccer.solution import Gate

GATE = Gate("jac", False, 0.5, 0.75, -0.33, "too little fits", "7.png")


class TestDocument:
    def test_a_field_is_the_attribute_of_its_name_or_of_its_alias(self) -> None:
        document = FailingGate.model_validate(GATE)
        assert document.model_dump() == {
            "gate": "jac",
            "view": "7.png",
            "sentence": "too little fits",
        }

    def test_can_be_written_out_by_the_names_of_its_fields(self) -> None:
        written = FailingGate(gate="jac", view="7.png", sentence="too little fits")
        assert written == FailingGate.model_validate(GATE)

    def test_a_property_of_the_value_is_a_field_like_any_other(self) -> None:
        strict = replace(PAPER, tau_percent=0.5)
        assert PolicyDocument.model_validate(strict).hash == strict.hash != PAPER.hash

    def test_a_value_that_lacks_a_field_is_refused(self) -> None:
        with pytest.raises(ValidationError, match="sentence"):
            FailingGate.model_validate(Nameless())

    def test_a_page_names_the_next_one_by_text(self) -> None:
        assert FrameList(items=[], next=50, total=51).next == "50"


class Shot(RequestBody, examples=[{"first": 3}]):
    first: int


class ShotWithLast(Shot, examples=[{"first": 3, "last": 9}]):
    last: int


class TestRequestBody:
    def test_refuses_what_it_does_not_know(self) -> None:
        with pytest.raises(ValidationError, match="Extra inputs"):
            ShotWithLast.model_validate({"first": 3, "last": 9, "lst": 9})

    def test_has_its_own_examples_in_its_schema(self) -> None:
        assert Shot.model_json_schema()["examples"] == [{"first": 3}]
        assert ShotWithLast.model_json_schema()["examples"] == [{"first": 3, "last": 9}]


@dataclass(frozen=True)
class Match:
    """A frozen value as it is served."""

    begins: Moment
    ended: Moment | None = None
    length_m: float = float("nan")


class TestJsonOf:
    def test_a_value_tells_times_in_utc_with_a_z(self) -> None:
        match = Match("2026-11-28T21:00:00.000000+00:00")
        assert json.loads(encode_document(match)) == {
            "begins": "2026-11-28T21:00:00Z",
            "ended": None,
            "length_m": None,
        }

    def test_a_document_that_holds_a_value_tells_it_alike(self) -> None:
        class Page(Document):
            match: Match

        match = Match("2026-11-28T21:00:00.250000+00:00")
        assert json.loads(encode_document(Page(match=match)))["match"] == json.loads(
            encode_document(match)
        )

    @pytest.mark.parametrize("bad", [float("inf"), float("-inf")])
    def test_a_number_that_is_not_finite_is_null(self, bad: float) -> None:
        match = Match("2026-11-28T21:00:00+00:00", length_m=bad)
        assert json.loads(encode_document(match))["length_m"] is None


class TestWhatShowsADataclass:
    def test_has_the_fields_of_the_dataclass_in_order_and_then_its_own(self) -> None:
        assert list(KickDocument.model_fields) == ["minute", "player", "far"]

    def test_says_more_of_a_field_where_it_writes_that_down(self) -> None:
        described = {name: field.description for name, field in KickDocument.model_fields.items()}
        assert described == {"minute": None, "player": "Who kicked.", "far": None}

    def test_needs_every_field_even_where_the_dataclass_does_not(self) -> None:
        assert KickDocument.model_json_schema()["required"] == ["minute", "player", "far"]

    def test_reads_fields_and_properties_off_the_value(self) -> None:
        document = KickDocument.model_validate(Kick(7, "anna"))
        assert document.model_dump() == {"minute": 7, "player": "anna", "far": True}


@dataclass(frozen=True)
class Kick:
    """A kick of the ball."""

    minute: int
    player: str | None = None

    @property
    def far(self) -> bool:
        """Whether it flew far."""
        return True


class KickDocument(Document, shows=Kick):
    """A kick of the ball as it travels."""

    far: bool
    player: str | None = Field(description="Who kicked.")


@dataclass(frozen=True)
class Nameless:
    """A gate without its sentence."""

    name: str = "jac"
    view: str = "7.png"

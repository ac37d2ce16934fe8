"""Lines that are proposed beside drawn ones: which half, which markings, and what contradicts."""

from __future__ import annotations

from dataclasses import replace

from app.paint.drawn_lines import NOTHING_NEW, beside_drawn
from app.paint.view_proposal import ViewProposal
from app.soccer.annotation import Lines, make_lines
from app.soccer.frames import ImagePoint
from app.soccer.pitch import opposite_marking
from app.soccer.policy import CalibrationPolicy
from tests.cameras import SIZE
from tests.unit.applications import lines_of
from tests.unit.paint.lawns import PITCH, TRUE

SEEN = lines_of(TRUE.scaled(4 / 3, 4 / 3))
FOUND = ViewProposal("proposed", "", SEEN, 0.9, 0.8, 0.3, 0.25, 500)
POLICY = CalibrationPolicy()


def beside(drawn: Lines) -> ViewProposal:
    return beside_drawn(FOUND, drawn, PITCH, SIZE, POLICY)


def only(*markings: str) -> Lines:
    return make_lines({name: SEEN[name] for name in markings})


def test_without_drawn_lines_all_is_proposed() -> None:
    assert beside({}) is FOUND
    nothing = replace(FOUND, outcome="nothing", lines={})
    assert beside_drawn(nothing, SEEN, PITCH, SIZE, POLICY) is nothing


def test_drawn_markings_are_not_proposed_again() -> None:
    found = beside(only("Side line right"))
    assert found.sentence == ""
    assert dict(found.lines) == {
        name: points for name, points in SEEN.items() if name != "Side line right"
    }
    assert replace(found, lines=SEEN) == FOUND


def test_drawn_lines_say_which_half_is_seen() -> None:
    drawn = {
        opposite_marking(name): SEEN[name] for name in ("Side line right", "Big rect. right main")
    }
    found = beside(make_lines(drawn))
    assert found.sentence == ""
    assert "Side line bottom" in found.lines and "Side line top" not in found.lines
    assert found.lines["Side line bottom"] == SEEN["Side line top"]


def test_what_is_drawn_elsewhere_is_named_and_left() -> None:
    moved = [ImagePoint(point.x, point.y + 60.0) for point in SEEN["Big rect. right main"]]
    drawn = make_lines({**only("Side line right"), "Big rect. right main": moved})
    found = beside(drawn)
    assert found.outcome == "proposed"
    assert "“Big rect. right main” is drawn up to " in found.sentence
    assert "Side line right" not in found.sentence
    assert not set(drawn) & set(found.lines)


def test_what_the_camera_does_not_see_is_named() -> None:
    drawn = make_lines({**only("Side line right"), "Side line left": SEEN["Side line top"]})
    assert "“Side line left” is drawn where the proposed camera does not see it" in (
        beside(drawn).sentence
    )


def test_where_all_is_drawn_already_nothing_is_proposed() -> None:
    found = beside(SEEN)
    assert (found.outcome, dict(found.lines), found.sentence) == ("unsure", {}, NOTHING_NEW)

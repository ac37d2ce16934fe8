"""Work that is given out, in several windows: leases, handing in and back, independent annotations."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from playwright.sync_api import Page, expect

from app.db.store import Store
from app.features.batches.leases import BatchMember, LeaseService
from app.features.batches.service import NewBatch, make_batch
from app.features.people.roles import Role
from app.features.people.service import change_person, find_person
from tests.e2e.screen import TWO_FRAMES, Screen, hears, holding, until
from tests.e2e.team import (
    REFUSED,
    OpenPage,
    annotate,
    in_store,
    join,
    log_in,
    verdict,
)
from tests.e2e.test_access import serious_in_both

SUBMITTED = "This annotation is submitted; only a lead can return it."


class TestWork:
    def test_two_people_meet_on_purpose_alone_and_lose_nothing(
        self, open_page: OpenPage, team: str, team_home: Path, console: Any
    ) -> None:
        for refused in (REFUSED, "a status of 409"):
            console.expect(refused)
        join(team_home, "tove", Role.LEAD)
        join(team_home, "ivo", Role.REVIEWER)
        tove = open_page("/groups", address=team)
        log_in(tove, "tove")
        expect(tove.get_by_role("button", name="Assign…")).to_be_enabled()
        tove.keyboard.press("Shift+D")
        dialog = tove.get_by_role("dialog", name="Assign groups")
        dialog.get_by_label("Name").fill("A few")
        dialog.get_by_label("Number of groups (the first of the list)").fill("3")
        dialog.get_by_role("button", name="Assign", exact=True).click()
        tove.get_by_role("button", name="See the work").click()
        go_on = tove.get_by_role("button", name="Continue: 3 groups of A few")
        expect(go_on).to_be_focused()
        assert serious_in_both(tove) == []
        tove.keyboard.press("Enter")
        screen = Screen(tove)
        screen.ready()
        expect(tove.get_by_role("link", name="group 1 of 3")).to_be_visible()
        first = screen.group

        ivo = open_page("/work", address=team)
        log_in(ivo, "ivo")
        expect(ivo.get_by_role("button", name="Continue: 3 groups of A few")).to_be_focused()
        ivo.keyboard.press("Enter")
        other = Screen(ivo)
        other.ready()
        assert other.group != first, "nobody is given what somebody has open"
        hears(tove)
        # Who is here is known at once, not when the other page says next that it still is.
        with holding(tove, "**/lease"):
            ivo.goto(f"/review/{first}?batch={batch_in(ivo)}")
            other.ready()
            here = ivo.locator('[data-lease="others"]')
            expect(here).to_contain_text("tove opened this")
        here.get_by_role("button", name="Take over").click()
        expect(here).to_be_hidden()
        lost = tove.locator('[data-lease="lost"]')
        expect(lost).to_contain_text("ivo has taken this group over")
        assert serious_in_both(tove) == []
        tove.keyboard.press("s")
        # Somebody may have deferred this group before.
        until(tove, lambda: verdict(tove, first) == {"state": "deferred", "by": "tove"})
        until(tove, lambda: screen.group != first)
        expect(tove.get_by_text("in A few")).to_be_visible()

    def test_whoever_is_at_something_else_stays_there_when_their_work_arrives(
        self, open_page: OpenPage, team: str, team_home: Path, console: Any
    ) -> None:
        console.expect(REFUSED)
        give_to(team_home, "quinto", "Late", "id:10")
        page = open_page("/work", address=team)
        log_in(page, "quinto")
        go_on = page.get_by_role("button", name="Continue: 1 group of Late")
        expect(go_on).to_be_visible()
        with holding(page, "**/api/v1/work") as asked:
            page.reload()
            asked.arrive()
            elsewhere = page.get_by_role("link").first
            elsewhere.focus()
        expect(go_on).to_be_visible()
        page.evaluate(TWO_FRAMES)
        expect(elsewhere).to_be_focused()

    def test_nobody_is_sent_back_to_what_they_have_judged_and_is_on_its_way(
        self, open_page: OpenPage, team: str, team_home: Path, console: Any
    ) -> None:
        console.expect(REFUSED)
        give_to(team_home, "quinn", "Slow", "id:11,12")
        page = open_page("/work", address=team)
        log_in(page, "quinn")
        page.get_by_role("button", name="Continue: 2 groups of Slow").press("Enter")
        screen = Screen(page)
        screen.ready()
        with holding(page, "**/verdict") as verdicts:
            screen.press("s")
            until(page, lambda: screen.group == 12)
            screen.ready()
            verdicts.arrive()
            screen.press("s")
            expect(page.get_by_text("No more groups for you in “Slow”")).to_be_visible()
            assert screen.group == 12
        for group in (11, 12):
            until(page, lambda at=group: verdict(page, at).get("by") == "quinn")  # type: ignore[misc]

    def test_what_is_handed_in_goes_back_with_a_sentence_and_comes_again(
        self, open_page: OpenPage, team: str, team_home: Path, console: Any
    ) -> None:
        console.expect(REFUSED)
        join(team_home, "nora", Role.ANNOTATOR)
        join(team_home, "ralf", Role.REVIEWER)
        new = NewBatch("B", "id:6,7", annotators=["nora"], reviewers=["ralf"], skip_given=False)
        given = in_store(team_home, lambda store: make_batch(store, "sample", new, actor="local"))
        nora = open_page("/work", address=team)
        log_in(nora, "nora")
        expect(nora.get_by_role("button", name="Continue: 2 groups of B")).to_be_focused()
        nora.keyboard.press("Enter")
        Screen(nora).ready()
        nora.keyboard.press("Shift+F")
        until(nora, lambda: "/review/7" in nora.url)

        ralf = open_page(f"/review/6?q=batch%3A{given.id}", address=team)
        log_in(ralf, "ralf")
        Screen(ralf).ready()
        expect(ralf.get_by_role("button", name="Return to nora…")).to_be_visible()
        ralf.keyboard.press("Shift+U")
        dialog = ralf.get_by_role("dialog", name="Return to nora")
        expect(dialog.get_by_label("Reason")).to_be_focused()
        assert serious_in_both(ralf) == []
        ralf.keyboard.type("The far goal line is missing")
        ralf.keyboard.press("Enter")
        expect(dialog).to_be_hidden()
        until(ralf, lambda: ralf.url.endswith("/work"))

        bell = nora.get_by_role("button", name="Notifications")
        expect(bell).to_contain_text("2")
        nora.goto("/work")
        back = nora.get_by_role("list", name="Returned to you")
        expect(back).to_contain_text("by ralf: “The far goal line is missing”")
        assert serious_in_both(nora) == []
        back.get_by_role("link").press("Enter")
        expect(nora.get_by_text("ralf returned this")).to_be_visible()
        Screen(nora).ready()
        nora.keyboard.press("Shift+F")
        until(nora, lambda: "/review/7" in nora.url)
        groups = nora.request.get(f"/api/v1/batches/{given.id}/groups").json()["items"]
        assert [one["submitted_by"] for one in groups] == ["nora", None]

    def test_two_who_annotate_the_same_group_blind_differ_and_the_lead_decides(
        self, open_page: OpenPage, team: str, team_home: Path, console: Any
    ) -> None:
        for refused in (REFUSED, "a status of 403"):
            console.expect(refused)
        join(team_home, "lotte", Role.LEAD)
        lotte = open_page("/groups?q=id%3A9", address=team)
        log_in(lotte, "lotte")
        for name in ("uma", "ulf"):
            join(team_home, name, Role.REVIEWER)
        expect(lotte.get_by_role("button", name="Assign…")).to_be_enabled()
        lotte.keyboard.press("Shift+D")
        dialog = lotte.get_by_role("dialog", name="Assign groups")
        dialog.get_by_label("Name").fill("Twice")
        dialog.get_by_label("Annotators per group").fill("2")
        for name in ("uma", "ulf"):
            dialog.get_by_role("group", name="Annotators").get_by_label(name).check()
        dialog.get_by_role("button", name="Assign", exact=True).click()
        expect(lotte.get_by_role("button", name="See the work")).to_be_visible()

        copies: dict[str, int] = {}
        for name, keys in (("uma", ["s"]), ("ulf", ["x", "1"])):
            page = open_page("/work", address=team)
            log_in(page, name)
            expect(page.locator("[data-hidden-groups]")).to_contain_text("hidden from you")
            page.goto("/groups")
            hidden = page.locator("[data-hidden-groups]")
            expect(hidden).to_contain_text("some of its groups are hidden")
            for what in ("jobs", "recordings", "exports"):
                page.goto(f"/{what}")
                expect(page.get_by_role("heading", name=f"No {what} to show")).to_be_visible()
                expect(hidden).to_contain_text(f"The {what} of sample are hidden from you")
            page.goto("/work")
            copies[name] = judge_alone(page, "Twice", keys, unseen=copies)
        lotte.goto("/groups")
        expect(lotte.locator(".queue-row a").first).to_be_visible()
        expect(lotte.locator("[data-hidden-groups]")).to_have_count(0)
        assert len({9, *copies.values()}) == 3

        waiting = "/api/v1/datasets/sample/adjudications"
        until(lotte, lambda: lotte.request.get(waiting).json()["items"])
        lotte.goto("/datasets/sample/agreement")
        lotte.get_by_role("link", name="Decide the worst one").press("Enter")
        expect(lotte.locator(".compare__one")).to_have_count(2)
        assert lotte.url.endswith("/adjudicate/9")
        lotte.keyboard.press("2")
        expect(lotte.locator('.compare__one[data-chosen="true"]')).to_contain_text("ulf")
        lotte.keyboard.press("Enter")
        until(lotte, lambda: verdict(lotte, 9) == {"state": "rejected", "by": "lotte"})

    def test_a_batch_is_reassigned_beside_people_who_left(
        self, open_page: OpenPage, team: str, team_home: Path, console: Any
    ) -> None:
        console.expect(REFUSED)
        join(team_home, "lida", Role.LEAD)
        for name in ("gone", "less", "next"):
            join(team_home, name, Role.ANNOTATOR)
        new = NewBatch("Leavers", "id:4", annotators=["gone", "less"], skip_given=False)

        def leave(store: Store) -> int:
            batch = make_batch(store, "sample", new, actor="local").id
            change_person(store, find_person(store, "gone").id, disabled=True, actor="local")
            change_person(store, find_person(store, "less").id, role=Role.VIEWER, actor="local")
            return batch

        batch = in_store(team_home, leave)
        page = open_page("/work", address=team)
        log_in(page, "lida")
        page.get_by_role("button", name="Reassign… Leavers").click()
        dialog = page.get_by_role("dialog", name="Reassign: Leavers")
        annotators = dialog.get_by_role("group", name="Annotators")
        expect(annotators.get_by_label("gone (disabled)")).to_be_checked()
        less = annotators.get_by_label("less (no longer an annotator)")
        expect(less).to_be_checked()
        less.uncheck()
        expect(less).not_to_be_checked()
        annotators.get_by_label("next").check()
        dialog.get_by_role("button", name="Save").click()
        expect(dialog).to_be_hidden()
        found = page.request.get(f"/api/v1/batches/{batch}").json()
        assert found["annotators"] == ["gone", "next"]

    def test_a_lead_hands_one_of_two_annotations_back_and_takes_the_other_over(
        self, open_page: OpenPage, team: str, team_home: Path, console: Any
    ) -> None:
        console.expect(REFUSED)
        join(team_home, "lars", Role.LEAD)
        for name, moved in (("ute", 0), ("udo", 25)):
            join(team_home, name, Role.REVIEWER)
            in_store(team_home, lambda store, who=name, by=moved: annotate(store, 8, who, by))
        page = open_page("/adjudicate/8", address=team)
        log_in(page, "lars")
        expect(page.locator(".compare__one")).to_have_count(2)
        page.keyboard.press("2")
        page.keyboard.press("Shift+U")
        expect(page.get_by_label("Reason")).to_be_focused()
        page.keyboard.type("Too far right")
        page.keyboard.press("Enter")
        expect(page.get_by_text("Nothing to decide")).to_be_visible()
        rows = page.get_by_role("region", name="Independent annotations").get_by_role("row")
        expect(rows.filter(has_text="udo")).to_contain_text("returned by lars")
        assert serious_in_both(page) == []
        rows.filter(has_text="ute").get_by_role("link").press("Enter")
        Screen(page).ready()
        accept = page.get_by_role("button", name="Accept A")
        expect(accept).to_have_attribute("title", re.compile("ute has submitted this"))
        page.keyboard.press("Shift+R")
        expect(
            page.get_by_role("dialog", name="Apply ute’s annotation to the group")
        ).to_be_visible()
        expect(page.get_by_role("button", name="Apply Enter")).to_be_focused()
        page.keyboard.press("Enter")
        until(page, lambda: "/review/8" in page.url)
        expect(page.get_by_text("ute’s annotation is applied to the group")).to_be_visible()
        assert verdict(page, 8) == {"state": "accepted", "by": "ute"}

    def test_what_one_submitted_is_done_and_offers_nothing_that_changes_it(
        self, open_page: OpenPage, team: str, team_home: Path, console: Any
    ) -> None:
        join(team_home, "sina", Role.REVIEWER)
        new = NewBatch("Once", "id:5", annotators=["sina"], verdicts=2, skip_given=False)

        def submitted(store: Store) -> tuple[int, int]:
            batch = make_batch(store, "sample", new, actor="local").id
            leases, sina = LeaseService(store), BatchMember("sina")
            copy = leases.lease_next_group(batch, sina).group
            leases.submit_group(batch, copy, sina, actor="sina")
            return batch, copy

        batch, copy = in_store(team_home, submitted)
        page = open_page("/work", address=team)
        log_in(page, "sina")
        mine = page.locator(".work__item").filter(
            has=page.get_by_role("heading", name="Once", exact=True)
        )
        expect(mine.first).to_contain_text("1 of 1 group done · 0 open")
        expect(mine.first.get_by_role("button", name="Continue")).to_have_count(0)
        page.goto(f"{team}/review/{copy}?q=batch:{batch}")
        Screen(page).ready()
        expect(page.get_by_text("It is submitted and can no longer be changed")).to_be_visible()
        for name in ("Submit and next ⇧F", "Accept A", "Reject X", "Defer S"):
            button = page.get_by_role("button", name=name)
            expect(button).to_have_attribute("aria-disabled", "true")
            expect(button).to_have_attribute("title", SUBMITTED)
        page.keyboard.press("Shift+F")
        expect(page.get_by_text(SUBMITTED)).to_be_visible()


def give_to(home: Path, name: str, batch: str, q: str) -> None:
    """Let somebody come who has groups to review."""
    join(home, name, Role.REVIEWER)
    new = NewBatch(batch, q, reviewers=[name], skip_given=False)
    in_store(home, lambda store: make_batch(store, "sample", new, actor="local"))


def judge_alone(page: Page, batch: str, keys: list[str], *, unseen: dict[str, int]) -> int:
    """Judge the copy that somebody is given of a batch of one group; those of others are not there."""
    page.get_by_role("button", name=f"Continue: 1 group of {batch}").press("Enter")
    screen = Screen(page)
    screen.ready()
    copy = screen.group
    for name, other in unseen.items():
        assert page.request.get(f"/api/v1/groups/{other}").status == 404
        assert name not in page.locator("main").inner_text()
    assert (
        len(page.request.get("/api/v1/datasets/sample/independent-annotations").json()["items"])
        == 1
    )
    for key in keys:
        screen.press(key)
        screen.drawn()
    until(page, lambda: verdict(page, copy)["state"] in ("deferred", "rejected"))
    return copy


def batch_in(page: Page) -> str:
    """Id of the batch that a page walks."""
    return str(page.evaluate("() => new URLSearchParams(location.search).get('q').slice(6)"))

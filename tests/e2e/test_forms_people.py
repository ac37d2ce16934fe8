"""What is said about people, accounts and members leaves as said; what the server has stands where it should."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import pytest
from playwright.sync_api import Page, Route, expect

from app.db.store import Store
from app.features.people.login_queries import put_identity
from app.features.people.roles import Role
from app.features.people.second_factor import SecondFactors
from app.features.people.service import find_person
from tests.e2e.conftest import Console
from tests.e2e.crew import Crew, enrol, judged, open_as, sent
from tests.e2e.forms import Row, carry_out, choose, fill, press, read, tick
from tests.e2e.team import SECRET, OpenPage, in_store, join

FIREFOX = "Mozilla/5.0 (X11; Linux x86_64; rv:140.0) Gecko/20100101 Firefox/140.0"
CHROME = "Mozilla/5.0 (X11; Linux x86_64) AppleWebKit/537.36 Chrome/141.0.0.0 Safari/537.36"


@pytest.fixture
def no_rule(team_home: Path) -> Iterator[None]:
    """Afterwards nobody has to have a second factor."""
    yield
    in_store(team_home, lambda store: SecondFactors(store).set_required(False, actor="local"))


def let_in_by_provider(store: Store, name: str) -> None:
    with store.write() as session:
        person = find_person(store, name).id
        at = datetime.now(UTC).isoformat()
        shown = {"subject": f"s-{name}", "shown": f"{name}@club.example"}
        put_identity(
            session,
            {"person_id": person, "issuer": "https://x", **shown, "created": at, "used": None},
        )


EVERYBODY = "section[aria-labelledby=people-all]"
INVITE = "section[aria-labelledby=people-invite]"
PEOPLE = [
    Row(
        "invites somebody",
        [
            fill("Name", "nils", INVITE),
            choose("Role", "annotator", INVITE),
            press("Make a link", INVITE),
        ],
        {"POST /users": {"name": "nils", "role": "annotator"}},
        {"#people-link": "Send this link to nils"},
    ),
    Row("has seen the link", [press("Done")], {}, hides="#people-link"),
    Row(
        "invites somebody else with the role that is proposed, once more",
        [fill("Name", "olga", INVITE), press("Make a link", INVITE)],
        {"POST /users": {"name": "olga", "role": "reviewer"}},
        {f"{EVERYBODY} tr:has-text('olga')": "invited by anna"},
    ),
    Row(
        "looks at somebody's tokens",
        [press("Tokens of finn")],
        {"GET /users/{finn}/tokens": None},
        {"section[aria-labelledby=people-tokens]": "nightly"},
    ),
    Row(
        "ends one of them",
        [
            press("Revoke nightly", "section[aria-labelledby=people-tokens]"),
            press("Revoke for good? nightly"),
        ],
        {"DELETE /users/{finn}/tokens/{token}": None},
        hides="section[aria-labelledby=people-tokens] tbody tr",
    ),
    Row(
        "gives another role",
        [choose("Role of finn", "viewer")],
        {"PATCH /users/{finn}": {"role": "viewer"}},
    ),
    Row(
        "makes a link for a new password",
        [press("New link for finn")],
        {"POST /users/{finn}/link": None},
        {"#people-link": "Send this link to finn"},
    ),
    Row(
        "disables somebody",
        [press("Disable finn")],
        {"PATCH /users/{finn}": {"disabled": True}},
        {f"{EVERYBODY} tr:has(button[aria-label='Enable finn'])": "disabled"},
    ),
    Row(
        "enables them again",
        [press("Enable finn")],
        {"PATCH /users/{finn}": {"disabled": False}},
        {f"{EVERYBODY} tr:has(button[aria-label='Disable finn'])": "finn"},
    ),
    Row(
        "takes a lost second factor away",
        [press("Remove second factor of ines")],
        {"DELETE /users/{ines}/second-factor": None},
        hides="button[aria-label='Remove second factor of ines']",
    ),
    Row(
        "unlinks an account of the provider",
        [press("Unlink petra")],
        {"DELETE /users/{petra}/identity": None},
        hides="button[aria-label='Unlink petra']",
    ),
    Row(
        "asks a second factor of everybody",
        [tick("Require a second factor: people without one must set it up at their next login")],
        {"PUT /team": {"require_second_factor": True}},
        {".people__rule:has(input:checked)": "Require a second factor"},
    ),
    Row(
        "asks it of nobody any more",
        [
            tick(
                "Require a second factor: people without one must set it up at their next login",
                on=False,
            )
        ],
        {"PUT /team": {"require_second_factor": False}},
        {".people__rule:not(:has(input:checked))": "Require a second factor"},
    ),
    Row(
        "gives a role in one dataset",
        [choose("Role of carl here", "lead")],
        {"PUT /datasets/sample/members/{carl}": {"role": "lead"}},
    ),
    Row(
        "takes that role back",
        [choose("Role of carl here", "")],
        {"PUT /datasets/sample/members/{carl}": {"role": None}},
    ),
    Row(
        "shows earlier work as somebody's",
        [
            choose("Assign the earlier work of “local” to", "dora"),
            press("Assign earlier work"),
        ],
        {"POST /users/{dora}/adoption": None},
        {"section[aria-labelledby=people-local]": "It is assigned to dora."},
    ),
]


class TestPeople:
    def test_what_an_admin_does_about_people_leaves_as_said(
        self, open_page: OpenPage, crew: Crew, team_home: Path, no_rule: None
    ) -> None:
        token = {"name": "nightly", "scopes": ["read"], "days": 7, "dataset": None}
        nightly = sent(crew.log_in("finn"), "POST", "/tokens", token)["token"]["id"]
        enrol(crew.log_in("ines"))
        join(team_home, "anna", Role.ADMIN)
        in_store(team_home, lambda store: let_in_by_provider(store, "petra"))
        anna = crew.log_in("anna")
        enrol(anna)
        page = open_as(open_page, anna, "/people")
        expect(page.get_by_label("Role of carl here")).to_be_visible()
        self.shows_everybody(page)
        for row in PEOPLE:
            users = {one["name"]: one["id"] for one in read(page, "/users")["items"]}
            carry_out(page, row, {**users, "token": nightly})
        told = {one["name"]: one for one in read(page, "/users")["items"]}
        assert (told["finn"]["role"], told["nils"]["role"]) == ("viewer", "annotator")

    def test_a_rule_that_the_server_does_not_take_is_not_shown_as_in_force(
        self, open_page: OpenPage, crew: Crew, console: Console
    ) -> None:
        console.expect("503")
        page = open_as(open_page, crew.log_in("ada"), "/people")
        rule = page.get_by_label("Require a second factor")
        expect(rule).not_to_be_checked()
        page.route("**/api/v1/team", lambda route: route.fulfill(status=503), times=1)
        rule.click()
        expect(page.get_by_role("alert").first).to_be_visible()
        expect(rule).not_to_be_checked()

    def shows_everybody(self, page: Page) -> None:
        users = read(page, "/users")["items"]
        lines = page.locator(f"{EVERYBODY} tbody tr")
        expect(lines).to_have_count(len(users))
        for line, one in zip(lines.all(), users, strict=True):
            expect(line.get_by_role("rowheader")).to_contain_text(one["name"])
            expect(line.get_by_role("rowheader")).to_contain_text(f"by {one['created_by']}")
            expect(line.get_by_role("combobox")).to_have_value(one["role"])
            expect(line.get_by_role("cell").nth(1)).to_contain_text("active")
            seen = line.get_by_role("cell").nth(2)
            if one["seen"]:
                expect(seen.locator("time")).to_have_attribute("datetime", one["seen"])
            else:
                expect(seen).to_have_text("never")
            tokens = line.get_by_role("button", name="Tokens of")
            expect(tokens).to_have_count(1 if one["tokens"] else 0)
            factor = line.get_by_role("button", name="Remove second factor")
            mine = one["name"] == "anna"
            expect(factor).to_have_count(1 if one["second_factor"] and not mine else 0)

    def test_a_link_is_that_of_the_answer_and_is_copied_as_it_stands(
        self, open_page: OpenPage, crew: Crew
    ) -> None:
        page = open_as(open_page, crew.log_in("ada"), "/people")
        page.evaluate(
            "() => { navigator.clipboard.writeText = async (text) => { window.copied = text; }; }"
        )
        with page.expect_response(lambda answer: answer.url.endswith("/link")) as told:
            press("New link for carl")(page)
        link = told.value.json()["link"]
        expect(page.get_by_label("Link", exact=True)).to_have_value(link)
        press("Copy")(page)
        expect(page.get_by_role("button", name="Copied")).to_be_visible()
        assert page.evaluate("() => window.copied") == link

    def test_where_mail_is_set_up_another_link_asks_for_an_address(
        self, open_page: OpenPage, crew: Crew
    ) -> None:
        page = open_as(open_page, crew.log_in("ada"), "/account")

        def with_mail(route: Route) -> None:
            answer = route.fetch()
            route.fulfill(response=answer, json={**answer.json(), "mail": True})

        page.route("**/api/v1/users", with_mail)
        page.goto(f"{crew.address}/people")
        press("New link for carl")(page)
        card = page.locator("section[aria-labelledby=people-new-link]")
        expect(card.get_by_label("E-mail (optional)")).to_be_focused()
        card.get_by_label("E-mail (optional)").fill("carl@example.org")
        with page.expect_response(lambda answer: answer.url.endswith("/link")) as told:
            page.keyboard.press("Enter")
        assert told.value.request.post_data_json == {"email": "carl@example.org"}
        expect(card).to_be_hidden()
        expect(
            page.get_by_text("It was not sent by mail: this server sends no mail")
        ).to_be_visible()
        expect(page.get_by_label("Link", exact=True)).to_have_value(told.value.json()["link"])


TOKENS = "section[aria-labelledby=account-tokens]"
SESSIONS = "section[aria-labelledby=account-sessions]"
ACCOUNT = [
    Row(
        "makes a token as it is proposed",
        [fill("What it is for", "plain"), press("Make a token")],
        {"POST /tokens": {"name": "plain", "scopes": ["read"], "days": 90, "dataset": None}},
        {".tokens__made": "This is plain."},
    ),
    Row("has kept it", [press("Done", ".tokens__made")], {}, hides=".tokens__made"),
    Row(
        "makes one for little",
        [
            fill("What it is for", "robot"),
            choose("Dataset", "sample", TOKENS),
            choose("Valid for", "365", TOKENS),
            tick("read: read only; included in all others", on=False),
            tick("annotate: lines, balls and cameras"),
            tick("review: verdicts"),
            tick("lead: import, freeze, evaluate, thresholds"),
            press("Make a token"),
        ],
        {
            "POST /tokens": {
                "name": "robot",
                "scopes": ["annotate", "review", "lead"],
                "days": 365,
                "dataset": "sample",
            }
        },
        {".tokens__made": "This is robot."},
    ),
    Row(
        "ends the first of them",
        [press("Revoke plain"), press("Revoke for good? plain")],
        {"DELETE /tokens/{plain}": None},
        hides="tr:has-text('plain') button:has-text('Revoke')",
    ),
    Row(
        "ends a session of the other browser",
        [
            lambda page: (
                page.locator(f"{SESSIONS} tr", has_text="Firefox")
                .get_by_role("button", name="Log out ")
                .click()
            )
        ],
        {"DELETE /sessions/{firefox}": None},
        hides=f"{SESSIONS} tr:has-text('Firefox')",
    ),
    Row(
        "ends all other sessions",
        [press("Log out all other sessions")],
        {"DELETE /sessions": None},
        hides=f"{SESSIONS} tr:has-text('Chrome 141')",
    ),
    Row(
        "takes another password",
        [
            fill("Current password", SECRET),
            fill("New password", "four words that differ"),
            press("Change password"),
        ],
        {"PUT /session/password": {"old": SECRET, "new": "four words that differ"}},
        {"section[aria-labelledby=account-password]": "Password changed."},
    ),
]


class TestAccount:
    def test_what_somebody_does_about_their_account_leaves_as_said(
        self, open_page: OpenPage, crew: Crew
    ) -> None:
        for agent in (FIREFOX, CHROME):
            crew.log_in("tess", agent)
        page = open_as(open_page, crew.log_in("tess"), "/account")
        expect(page.locator(f"{SESSIONS} tbody tr")).to_have_count(3)
        expect(page.locator(f"{SESSIONS} h2")).to_have_text("Sessions of tess (lead)")
        open_ones = read(page, "/sessions")["items"]
        firefox = next(one for one in open_ones if one["browser"] == FIREFOX)
        chrome = next(one for one in open_ones if one["browser"] == CHROME)
        for one, name in (
            (firefox, "Firefox 140, Linux x86_64"),
            (chrome, "Chrome 141, Linux x86_64"),
        ):
            line = page.locator(f"{SESSIONS} tr", has_text=name)
            expect(line.locator("small")).to_have_text(one["address"])
            expect(line.locator("time").first).to_have_attribute("datetime", one["created"])
            expect(line.locator("time").last).to_have_attribute("datetime", one["seen"])
        for row in ACCOUNT:
            tokens = {one["name"]: one["id"] for one in read(page, "/tokens")["items"]}
            carry_out(page, row, {**tokens, "firefox": firefox["id"]})
            if row.does == "makes one for little":
                self.shows_tokens(page)
        crew.log_in("tess", password="four words that differ")

    def shows_tokens(self, page: Page) -> None:
        items = read(page, "/tokens")["items"]
        lines = page.locator(f"{TOKENS} tbody tr")
        expect(lines).to_have_count(len(items))
        for line, one in zip(lines.all(), items, strict=True):
            day = datetime.fromisoformat(one["expires"])
            expect(line.get_by_role("rowheader")).to_have_text(f"{one['name']}{one['start']}…")
            expect(line.get_by_role("cell").nth(0)).to_have_text(", ".join(one["scopes"]))
            expect(line.get_by_role("cell").nth(1)).to_have_text(one["dataset"] or "all datasets")
            expect(line.get_by_role("cell").nth(2)).to_have_text("never")
            expect(line.get_by_role("cell").nth(3)).to_contain_text(str(day.year))


TRUTH = {
    "sample": "the values it was generated from",
    "verdict": "its annotations at the time it was marked",
}
GOLD = "section[aria-labelledby=gold-title]"
MEMBERS = [
    Row(
        "gives a role here",
        [choose("Role of bob here", "none")],
        {"PUT /datasets/sample/members/{bob}": {"role": "none"}},
    ),
    Row(
        "gives another one here",
        [choose("Role of carl here", "reviewer")],
        {"PUT /datasets/sample/members/{carl}": {"role": "reviewer"}},
    ),
    Row(
        "lets somebody be what they are everywhere",
        [choose("Role of bob here", "")],
        {"PUT /datasets/sample/members/{bob}": {"role": None}},
    ),
    Row(
        "lets the other one, too",
        [choose("Role of carl here", "")],
        {"PUT /datasets/sample/members/{carl}": {"role": None}},
    ),
    Row(
        "lets annotators of a gold group begin with less",
        [
            lambda page: page.locator(f"{GOLD} tr:has(a[href='/review/4']) select").select_option(
                "bare"
            )
        ],
        {"PATCH /groups/4/gold": {"start": "bare"}},
        {f"{GOLD} tr:has(a[href='/review/4'])": "the values it was generated from"},
    ),
    Row(
        "takes its mark away",
        [press("Unmark", f"{GOLD} tr:has(a[href='/review/3'])")],
        {"DELETE /groups/3/gold": None},
        hides=f"{GOLD} a[href='/review/3']",
    ),
]


class TestMembers:
    def test_what_a_lead_gives_in_a_dataset_leaves_as_said(
        self, open_page: OpenPage, crew: Crew
    ) -> None:
        dora = crew.log_in("dora")
        judged(dora, 3, "accepted")
        sent(dora, "PUT", "/groups/3/gold", {"start": "imported"})
        sent(dora, "POST", "/datasets/1/gold", {"source": "sample", "start": "without_balls"})
        page = open_as(open_page, dora, "/datasets/sample/statistics")
        card = page.get_by_role("region", name="Members of sample")
        expect(card.get_by_label("Role of bob here")).to_be_visible()
        for one in read(page, "/datasets/sample/members")["items"]:
            role = card.get_by_label(f"Role of {one['name']} here", exact=True)
            expect(role).to_have_value(one["single"] or "")
            expect(role.locator("option").first).to_have_text(
                f"{one['everywhere']}, as in all datasets"
            )
        gold = read(page, "/datasets/1/gold")["groups"]
        lines = page.locator(f"{GOLD} tbody tr")
        expect(lines).to_have_count(len(gold))
        for line, one in zip(lines.all(), gold, strict=True):
            expect(line.get_by_role("rowheader")).to_have_text(one["label"])
            expect(line.get_by_role("combobox")).to_have_value(one["start"])
            expect(line.get_by_role("cell").nth(1)).to_have_text(TRUTH[one["source"]])
            expect(line.get_by_role("cell").nth(2)).to_have_text(one["marked_by"])
        for row in MEMBERS:
            users = {one["name"]: one["id"] for one in read(page, "/datasets/1/members")["items"]}
            carry_out(page, row, users)
        before = {one["group"]: one for one in gold}
        before[4]["start"] = "bare"
        del before[3]
        after = {one["group"]: one for one in read(page, "/datasets/1/gold")["groups"]}
        assert after == before

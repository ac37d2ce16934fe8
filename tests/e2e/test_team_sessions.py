"""The server of a team: tokens, second factors, single sign-on, and a session that ends amid the work."""

from __future__ import annotations

import time
from datetime import datetime
from pathlib import Path
from typing import Any

import httpx
import pyotp
from playwright.sync_api import Page, expect

from app.db.store import Store
from app.features.groups.submit import load_group_state
from app.features.maintenance.service import clear_banner, set_banner
from app.features.people.login_queries import delete_logins
from app.features.people.roles import Role
from app.features.people.second_factor import SecondFactors
from app.features.people.service import find_person, invite
from app.features.verdicts.service import set_verdict
from tests.e2e.screen import Screen, holding, until
from tests.e2e.team import (
    REFUSED,
    SECRET,
    OpenPage,
    in_store,
    join,
    log_in,
    log_out,
    verdict,
)
from tests.e2e.test_access import serious_in_both
from tests.provider import Provider


class TestSessions:
    def test_a_token_and_a_second_factor_are_made_and_used(
        self, open_page: OpenPage, team: str, team_home: Path, console: Any
    ) -> None:
        console.expect(REFUSED)
        join(team_home, "tina", Role.LEAD)
        page = open_page("/account", address=team)
        log_in(page, "tina")
        page.get_by_label("What it is for").fill("nightly")
        page.get_by_label("export: make exports").check()
        expect(page.get_by_label("admin: list")).to_be_disabled()
        page.locator("#token-dataset").select_option("sample")
        page.locator("#token-days").select_option("30")
        page.get_by_role("button", name="Make a token").click()
        text = page.get_by_label("Token", exact=True)
        until(page, lambda: text.count() and text.input_value().startswith("tl_"))
        given = {"Authorization": f"Bearer {text.input_value()}"}
        assert httpx.get(f"{team}/api/v1/datasets", headers=given).is_success
        (kept,) = page.request.get("/api/v1/tokens").json()["items"]
        created, expires = (datetime.fromisoformat(kept[name]) for name in ("created", "expires"))
        assert (kept["dataset"], (expires - created).days) == ("sample", 30)
        assert kept["scopes"] == ["read", "export"]
        assert serious_in_both(page) == []
        page.get_by_role("button", name="Revoke nightly").dblclick()
        page.get_by_role("button", name="Revoke for good? nightly").click()
        expect(page.get_by_role("button", name="Revoke nightly")).to_be_hidden()
        assert httpx.get(f"{team}/api/v1/datasets", headers=given).status_code == 401

        page.locator("#factor-begin").fill(SECRET)
        page.get_by_role("button", name="Begin").click()
        code = page.get_by_label("The code that it shows")
        expect(code).to_be_visible()
        totp = pyotp.TOTP(page.locator(".factor__secret").inner_text().replace(" ", ""))
        assert serious_in_both(page) == []
        # Right for half a minute more at least, however late the page is; the next is still unused.
        code.fill(totp.now())
        page.get_by_role("button", name="Confirm").click()
        expect(page.locator(".factor__codes li")).to_have_count(10)
        page.get_by_role("button", name="I have saved them").click()
        log_out(page)
        log_in(page, "tina")
        expect(page.get_by_label("Code of your second factor")).to_be_focused()
        page.get_by_label("Code of your second factor").fill(totp.at(time.time() + 30))
        page.keyboard.press("Enter")
        expect(page.get_by_role("link", name="tina")).to_be_visible()

    def test_a_passkey_is_made_and_logs_in_without_a_password(
        self, open_page: OpenPage, team: str, team_home: Path, console: Any
    ) -> None:
        console.expect(REFUSED)
        join(team_home, "paula", Role.LEAD)
        page = open_page("/account", address=team.replace("127.0.0.1", "localhost"))
        device = page.context.new_cdp_session(page)
        device.send("WebAuthn.enable")
        kind = {"protocol": "ctap2", "transport": "internal", "hasResidentKey": True}
        able = {"hasUserVerification": True, "isUserVerified": True}
        device.send("WebAuthn.addVirtualAuthenticator", {"options": {**kind, **able}})
        log_in(page, "paula")
        page.get_by_label("Name of the passkey").fill("laptop")
        page.locator("#passkey-password").fill(SECRET)
        page.get_by_role("button", name="Make a passkey").click()
        expect(page.locator(".factor__codes li")).to_have_count(10)
        assert serious_in_both(page) == []
        page.get_by_role("button", name="I have saved them").click()

        log_out(page)
        log_in(page, "paula")
        expect(page.get_by_label("Code of your second factor")).to_be_focused()
        assert serious_in_both(page) == []
        page.get_by_role("button", name="Log in with a passkey").click()
        expect(page.get_by_role("link", name="paula")).to_be_visible()

        page.goto(page.url.rpartition("/")[0] + "/account")
        page.get_by_role("button", name="Remove laptop").click()
        page.locator("#passkey-remove").fill(SECRET)
        assert serious_in_both(page) == []
        page.locator("#passkey-remove").press("Enter")
        expect(page.get_by_role("rowheader", name="laptop")).to_be_hidden()
        expect(page.get_by_role("button", name="Remove laptop")).to_be_hidden()
        assert not in_store(team_home, lambda store: find_person(store, "paula")).second_factor

    def test_somebody_comes_by_the_provider_and_goes_on_where_they_were(
        self, open_page: OpenPage, team: str, team_home: Path, provider: Provider, console: Any
    ) -> None:
        console.expect(REFUSED)
        # The provider is another site than this name.
        here = team.replace("127.0.0.1", "localhost")
        _, link = in_store(team_home, lambda store: invite(store, "pia", Role.LEAD, actor="local"))
        provider.who = {"sub": "s-pia", "email": "pia@club.example"}
        page = open_page(f"/join#{link.token}", address=here)
        page.get_by_role("button", name="Continue with Club").click()
        expect(page.get_by_role("link", name="pia")).to_be_visible()

        page.goto(f"{here}/account")
        expect(page.get_by_text("pia@club.example")).to_be_visible()
        assert serious_in_both(page) == []
        page.get_by_role("button", name="Begin").click()
        code = page.get_by_label("The code that it shows")
        expect(code).to_be_visible()
        totp = pyotp.TOTP(page.locator(".factor__secret").inner_text().replace(" ", ""))
        code.fill(totp.now())
        page.get_by_role("button", name="Confirm").click()
        expect(page.locator(".factor__codes li")).to_have_count(10)
        page.get_by_role("button", name="I have saved them").click()
        log_out(page)
        page.goto(f"{here}/jobs?state=failed")
        # A key that comes before goes to the field that the page gives the focus.
        expect(page.get_by_label("Name")).to_be_focused()
        page.get_by_role("button", name="Log in with Club").press("Enter")
        expect(page.get_by_label("Code of your second factor")).to_be_focused()
        # What the provider brought leaves the address bar.
        until(page, lambda: "code=" not in page.url)
        assert serious_in_both(page) == []
        page.get_by_label("Code of your second factor").fill(totp.at(time.time() + 30))
        page.keyboard.press("Enter")
        expect(page.get_by_role("link", name="pia")).to_be_visible()
        expect(page).to_have_url(f"{here}/jobs?state=failed")

        page.get_by_role("link", name="pia").click()
        log_out(page)
        provider.who = {"sub": "s-stranger"}
        page.get_by_role("button", name="Log in with Club").click()
        expect(page.get_by_text("No person here is linked")).to_be_visible()
        expect(page.get_by_role("link", name="Back to the login")).to_be_focused()
        assert serious_in_both(page) == []

    def test_a_session_that_ends_amid_the_work_loses_nothing(
        self, open_page: OpenPage, team: str, team_home: Path, console: Any
    ) -> None:
        console.expect(REFUSED)
        join(team_home, "rita", Role.REVIEWER)
        page = open_page("/review/1", address=team)
        expect(page.get_by_role("heading", name="Log in")).to_be_visible()
        expect(page.locator(".image-panel")).to_have_count(0)
        log_in(page, "rita")
        screen = Screen(page)
        screen.ready()
        defer_as_the_session_ends(page, team_home, "rita")
        again = page.get_by_role("dialog", name="Your session has ended")
        expect(again).to_be_visible()
        expect(again).to_contain_text("1 unsaved change")
        assert serious_in_both(page) == []
        page.get_by_label("Password").fill(SECRET)
        page.keyboard.press("Enter")
        expect(again).to_be_hidden()
        until(page, lambda: verdict(page)["state"] == "deferred")
        assert verdict(page)["by"] == "rita"

    def test_every_page_before_somebody_is_let_in_has_the_notice_of_maintenance(
        self, open_page: OpenPage, team: str, team_home: Path, console: Any
    ) -> None:
        console.expect(REFUSED)
        console.expect("the server responded with a status of 404")
        # Parts of the account page may ask before it knows that a second factor is required.
        console.expect("the server responded with a status of 403")
        join(team_home, "nora", Role.ADMIN)
        _, invited = in_store(
            team_home, lambda store: invite(store, "nils", Role.VIEWER, actor="local")
        )
        in_store(team_home, lambda store: set_banner(store, "Back at noon", actor="local"))
        page = open_page("/groups", address=team)
        for path, heading in {
            "/groups": "Log in",
            "/login?error=access_denied&state=x": "You are not logged in",
            f"/join#{invited.token}": "Welcome, nils",
            "/join#used-up": "Your link",
        }.items():
            page.goto("about:blank")
            page.goto(f"{team}{path}")
            expect(page.get_by_role("heading", name=heading)).to_be_visible()
            expect(page.get_by_text("Back at noon")).to_be_visible()
        page.goto(f"{team}/account")
        log_in(page, "nora")
        expect(page.get_by_role("heading", name="Sessions")).to_be_visible()
        in_store(team_home, lambda store: SecondFactors(store).set_required(True, actor="local"))
        try:
            page.reload()
            expect(page.get_by_role("heading", name="requires a second factor")).to_be_visible()
            expect(page.get_by_text("Back at noon")).to_be_visible()
        finally:
            in_store(
                team_home, lambda store: SecondFactors(store).set_required(False, actor="local")
            )
        page.reload()
        expect(page.get_by_role("heading", name="Sessions")).to_be_visible()
        in_store(team_home, lambda store: end_sessions(store, "nora"))
        again = page.get_by_role("dialog", name="Your session has ended")
        page.evaluate("() => dispatchEvent(new Event('focus'))")
        expect(again).to_be_visible()
        expect(again.get_by_text("Back at noon")).to_be_visible()
        in_store(team_home, lambda store: clear_banner(store, actor="local"))

    def test_addresses_that_nobody_made_are_answered_in_plain_words(
        self, open_page: OpenPage, team: str, console: Any
    ) -> None:
        console.expect(REFUSED)
        console.expect("the server responded with a status of 404")
        page = open_page("/groups", address=team)
        for path, sentence in {
            f"/join#{'x' * 300}": "This link is no longer valid",
            "/join#what%20is%20this?": "This link is no longer valid",
            f"/login?state={'x' * 300}&code=x": "This address does not belong to a login",
            f"/login?state=x&code={'x' * 5000}": "This address does not belong to a login",
            "/login?state=x&code=x": "This login has expired, was completed already",
            "/login?error=KeyError": "The provider refused the request of this server",
        }.items():
            page.goto("about:blank")
            page.goto(f"{team}{path}")
            expect(page.get_by_role("alert")).to_contain_text(sentence)

    def test_what_others_said_while_the_page_did_not_listen_yet_is_shown(
        self, open_page: OpenPage, team: str, team_home: Path, console: Any
    ) -> None:
        console.expect(REFUSED)
        join(team_home, "lena", Role.REVIEWER)
        page = open_page("/groups", address=team)
        log_in(page, "lena")
        expect(page.get_by_role("link", name="lena")).to_be_visible()
        with holding(page, "**/api/v1/events*") as streams:
            page.goto("/review/4")
            Screen(page).ready()
            streams.arrive()
            in_store(team_home, defer_the_fourth)
        words = "Another person or window changed this group; the page shows the new state."
        expect(page.get_by_text(words)).to_have_count(1)
        assert verdict(page, 4) == {"state": "deferred", "by": "local"}

    def test_nobody_sends_what_another_person_left(
        self, open_page: OpenPage, team: str, team_home: Path, console: Any
    ) -> None:
        console.expect(REFUSED)
        for name in ("mine", "other"):
            join(team_home, name, Role.REVIEWER)
        page = open_page("/review/2", address=team)
        log_in(page, "mine")
        Screen(page).ready()
        defer_as_the_session_ends(page, team_home, "mine")
        expect(page.get_by_role("dialog", name="Your session has ended")).to_be_visible()
        log_in(page, "other")
        expect(page.get_by_role("link", name="other")).to_be_visible()
        page.goto("/review/2")
        Screen(page).ready()
        assert verdict(page, 2)["state"] is None
        page.goto("/account")
        log_out(page)
        log_in(page, "mine")
        expect(page.get_by_role("link", name="mine")).to_be_visible()
        until(page, lambda: verdict(page, 2)["state"] == "deferred")
        assert verdict(page, 2)["by"] == "mine"


def defer_as_the_session_ends(page: Page, home: Path, name: str) -> None:
    """The verdict is on its way when the session ends: what else the page asks cannot tell first."""
    with holding(page, "**/verdict") as verdicts:
        page.keyboard.press("s")
        verdicts.arrive()
        in_store(home, lambda store: end_sessions(store, name))


def end_sessions(store: Store, name: str) -> None:
    person = find_person(store, name)
    with store.write() as session:
        delete_logins(session, person.id)


def defer_the_fourth(store: Store) -> None:
    etag = load_group_state(store, 4).etag
    set_verdict(store, 4, "deferred", if_match=etag, actor="local")

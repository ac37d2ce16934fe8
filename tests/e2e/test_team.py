"""The server of a team: coming in by a link, people, and a session that ends amid the work."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import httpx
import pyotp
import pytest
from playwright.sync_api import Page, expect

from app.config import Settings
from app.review.people import links
from app.review.people.members import give_role
from app.review.people.people import find_person, invite, list_people
from app.review.people.roles import Role
from app.review.takes.guidelines import read_guidelines, write_guidelines
from app.review.work.batches import NewBatch, make_batch
from app.store.logins import delete_logins
from app.store.session import Store
from tests.e2e.screen import Screen, hears, holding, until
from tests.e2e.service import serving
from tests.e2e.test_access import serious_in_both
from tests.e2e.test_adjudication import annotate
from tests.homes import copy_home
from tests.provider import CLIENT, Provider, providing
from tests.provider import SECRET as CLIENT_SECRET

OpenPage = Callable[..., Page]
SECRET = "three plain words"
REFUSED = "the server responded with a status of 401"
WHO_IS_THERE = """async () => (await import(
  document.querySelector('script[src$="main.js"]').src.replace('main.js', 'state/me.js')
)).askWhoIsThere()"""


@pytest.fixture(scope="module")
def team_home(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A home that one person worked in alone so far."""
    return copy_home(sample, tmp_path_factory)


@pytest.fixture(scope="module")
def provider() -> Iterator[Provider]:
    """By which people of the team may come in."""
    with providing() as found:
        yield found


@pytest.fixture(scope="module")
def team(team_home: Path, provider: Provider) -> Iterator[str]:
    """Address of a team's server over it."""
    said = {"ISSUER": provider.address, "CLIENT_ID": CLIENT, "CLIENT_SECRET": CLIENT_SECRET}
    with pytest.MonkeyPatch.context() as patch:
        for name, value in {**said, "LABEL": "Club"}.items():
            patch.setenv(f"TOUCHLINE_SSO_{name}", value)
        with serving(team_home, "--team") as address:
            yield address


def in_store(home: Path, work: Callable[[Store], Any]) -> Any:
    """Do something in the database, as a command beside the server does."""
    with closing(Store.open(Settings(home=home))) as store:
        return work(store)


def join(home: Path, name: str, role: Role) -> None:
    """Somebody who has an account and a password."""

    def come(store: Store) -> None:
        _, link = invite(store, name, role, actor="local")
        links.use(store, link.token, SECRET)

    in_store(home, come)


def log_in(page: Page, name: str) -> None:
    # By id: the page that is left may have fields of these names, too.
    page.locator("#login-name").fill(name)
    page.locator("#login-password").fill(SECRET)
    page.locator("#login-password").press("Enter")


def log_out(page: Page) -> None:
    """Log out, and wait for the page that comes then: the one before may still take keys."""
    page.get_by_role("button", name="Log out").click()
    expect(page.get_by_role("heading", name="Log in")).to_be_visible()


class TestTeam:
    def test_the_first_admin_comes_by_the_link_that_the_server_printed(
        self, open_page: OpenPage, team: str, team_home: Path
    ) -> None:
        page = open_page(None, address=team)
        log = team_home / "server.log"
        until(page, lambda: "/join#" in log.read_text())
        address = next(word for word in log.read_text().split() if "/join#" in word)
        page.goto(address.removeprefix(team))
        expect(page.get_by_role("heading", name="Become the first admin")).to_be_visible()
        # The token leaves the address bar.
        until(page, lambda: "#" not in page.url)
        assert serious_in_both(page) == []
        page.get_by_label("Name").fill("Ada")
        page.get_by_label("Password").fill(SECRET)
        page.keyboard.press("Enter")
        expect(page.get_by_role("link", name="ada")).to_be_visible()
        expect(page.locator(".queue-row a").first).to_be_visible()

        page.goto("/people")
        page.get_by_label("Name", exact=True).fill("bob")
        page.get_by_role("button", name="Make a link").click()
        link = page.get_by_label("Link", exact=True)
        until(page, lambda: link.count() and "/join#" in link.input_value())
        expect(page.get_by_role("button", name="Disable bob")).to_be_visible()
        expect(page.get_by_role("button", name="Disable ada")).to_be_disabled()
        assert serious_in_both(page) == []
        page.get_by_role("button", name="Disable bob").click()
        expect(page.get_by_role("button", name="Enable bob")).to_be_visible()
        told = in_store(team_home, list_people)
        assert [(one.name, one.disabled) for one in told] == [("ada", False), ("bob", True)]

        page.goto("/account")
        expect(page.get_by_text("(this one)")).to_be_visible()
        assert serious_in_both(page) == []
        log_out(page)
        assert serious_in_both(page) == []

    def test_a_token_and_a_second_factor_are_made_and_used(
        self, open_page: OpenPage, team: str, team_home: Path, console: Any
    ) -> None:
        console.expect(REFUSED)
        join(team_home, "tina", Role.LEAD)
        page = open_page("/account", address=team)
        log_in(page, "tina")
        page.get_by_label("What it is for").fill("nightly")
        page.get_by_label("export: make exports").check()
        expect(page.get_by_label("admin: look")).to_be_disabled()
        page.get_by_role("button", name="Make a token").click()
        text = page.get_by_label("Token", exact=True)
        until(page, lambda: text.count() and text.input_value().startswith("tl_"))
        given = {"Authorization": f"Bearer {text.input_value()}"}
        assert httpx.get(f"{team}/api/v1/datasets", headers=given).is_success
        assert serious_in_both(page) == []
        page.get_by_role("button", name="End nightly").click()
        expect(page.get_by_role("button", name="End nightly")).to_be_hidden()
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
        page.get_by_role("button", name="I have kept them").click()
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
        page.get_by_role("button", name="I have kept them").click()

        log_out(page)
        log_in(page, "paula")
        expect(page.get_by_label("Code of your second factor")).to_be_focused()
        assert serious_in_both(page) == []
        page.get_by_role("button", name="Log in with a passkey").click()
        expect(page.get_by_role("link", name="paula")).to_be_visible()

        page.goto(page.url.rpartition("/")[0] + "/account")
        page.get_by_role("button", name="Take away laptop").click()
        page.locator("#passkey-remove").fill(SECRET)
        assert serious_in_both(page) == []
        page.locator("#passkey-remove").press("Enter")
        expect(page.get_by_role("rowheader", name="laptop")).to_be_hidden()
        expect(page.get_by_role("button", name="Take away laptop")).to_be_hidden()
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
        page.get_by_role("button", name="Come in with Club").click()
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
        page.get_by_role("button", name="I have kept them").click()
        log_out(page)
        page.goto(f"{here}/jobs?state=failed")
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
        expect(page.get_by_text("Nobody here is linked")).to_be_visible()
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
        expect(again).to_contain_text("1 change of yours waits")
        assert serious_in_both(page) == []
        page.get_by_label("Password").fill(SECRET)
        page.keyboard.press("Enter")
        expect(again).to_be_hidden()
        until(page, lambda: verdict(page)["state"] == "deferred")
        assert verdict(page)["by"] == "rita"

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

    def test_a_mention_rings_in_the_other_window_and_leads_to_its_words(
        self, open_page: OpenPage, team: str, team_home: Path, console: Any
    ) -> None:
        console.expect(REFUSED)
        for name, role in (("mia", Role.REVIEWER), ("noa", Role.ANNOTATOR), ("olga", Role.NONE)):
            join(team_home, name, role)
        mia = open_page("/review/4", address=team)
        log_in(mia, "mia")
        Screen(mia).ready()
        noa = open_page("/groups", address=team)
        log_in(noa, "noa")
        bell = noa.get_by_role("button", name="Bell")
        expect(bell).to_contain_text("nothing new")
        hears(noa)
        hears(mia)

        mia.keyboard.press("Shift+c")
        expect(mia.locator("#comment-new")).to_be_focused()
        mia.keyboard.type("<b>Look</b> @n")
        expect(mia.get_by_role("option", name="@noa")).to_be_visible()
        mia.keyboard.press("Backspace")
        mia.keyboard.type("ol")
        expect(mia.get_by_role("option")).to_have_count(0)
        mia.keyboard.press("Backspace")
        mia.keyboard.press("Backspace")
        mia.keyboard.type("no")
        expect(mia.get_by_role("option", name="@noa")).to_be_visible()
        mia.keyboard.press("Enter")
        mia.keyboard.press("Control+Enter")
        expect(mia.locator(".talk__text")).to_have_text("<b>Look</b> @noa")
        assert serious_in_both(mia) == []

        expect(bell).to_contain_text("1")
        noa.keyboard.press("Shift+b")
        ring = noa.get_by_role("link", name="mia mentioned you")
        expect(ring).to_be_visible()
        assert serious_in_both(noa) == []
        ring.press("Enter")
        expect(noa.locator(".talk__thread[data-named=true]")).to_contain_text("Look")
        expect(bell).to_contain_text("nothing new")
        noa.get_by_role("button", name="Resolve").click()
        expect(mia.get_by_text("show 1 resolved")).to_be_visible()

    def test_the_history_shows_an_edit_before_and_after_and_the_audit_who_did_it(
        self, open_page: OpenPage, team: str, team_home: Path, console: Any
    ) -> None:
        console.expect(REFUSED)
        join(team_home, "lena", Role.LEAD)
        page = open_page("/review/5", address=team)
        log_in(page, "lena")
        Screen(page).ready()
        page.keyboard.press("Shift+2")
        until(page, lambda: not view_of(page, 5, 1)["included"])
        page.keyboard.press("Shift+t")
        entry = page.get_by_role("button", name="Left view B out")
        expect(entry).to_contain_text("lena")
        page.keyboard.press("ArrowDown")
        expect(entry).to_be_focused()
        page.keyboard.press("Enter")
        expect(page.get_by_role("img", name="View B before")).to_be_visible()
        expect(page.get_by_role("img", name="View B after")).to_be_visible()
        expect(page.get_by_text("After · not used")).to_be_visible()
        assert serious_in_both(page) == []
        page.keyboard.press("Escape")
        expect(page).to_have_url(f"{team}/review/5")

        page.goto("/audit?family=edit")
        row = page.get_by_role("row").filter(has_text="leaving out")
        expect(row).to_contain_text("lena")
        assert serious_in_both(page) == []
        row.get_by_role("link").click()
        expect(page.get_by_role("img", name="View B after")).to_be_visible()

    def test_a_role_that_is_taken_away_amid_the_work_loses_nothing(
        self, open_page: OpenPage, team: str, team_home: Path, console: Any
    ) -> None:
        for refused in (REFUSED, "a status of 403", "net::ERR_"):
            console.expect(refused)
        join(team_home, "vera", Role.NONE)
        in_store(team_home, lambda store: give(store, "vera", Role.REVIEWER))
        page = open_page("/review/3", address=team)
        log_in(page, "vera")
        screen = Screen(page)
        screen.ready()
        accept = page.get_by_role("button", name="Accept A")
        expect(accept).not_to_have_attribute("aria-disabled", "true")

        # What it has asked before is answered, and it does not hear more before it asks for something.
        hears(page)
        page.evaluate(WHO_IS_THERE)
        page.route("**/api/v1/session", lambda route: route.abort())
        page.route("**/api/v1/events", lambda route: route.abort())
        in_store(team_home, lambda store: give(store, "vera", Role.VIEWER))
        page.keyboard.press("s")
        bar = page.get_by_role("alert").filter(has_text="waits here")
        expect(bar).to_contain_text("needs the role reviewer")
        assert verdict(page, 3)["state"] is None
        page.unroute("**/api/v1/session")
        page.unroute("**/api/v1/events")
        page.evaluate("() => dispatchEvent(new Event('focus'))")
        expect(page.get_by_text("Your rights were changed: viewer in ")).to_be_visible()
        expect(accept).to_have_attribute("aria-disabled", "true")
        expect(accept).to_have_attribute("title", re.compile("needs the role reviewer"))
        page.keyboard.press("x")
        expect(page.get_by_text("Judging or exporting needs the role reviewer")).to_be_visible()
        assert serious_in_both(page) == []

        in_store(team_home, lambda store: give(store, "vera", Role.REVIEWER))
        page.evaluate("() => dispatchEvent(new Event('focus'))")
        expect(bar).to_be_hidden()
        until(page, lambda: verdict(page, 3)["state"] == "deferred")
        assert verdict(page, 3)["by"] == "vera"

    def test_an_older_version_of_the_guidelines_is_read_compared_and_taken_back(
        self, open_page: OpenPage, team: str, team_home: Path, console: Any
    ) -> None:
        console.expect(REFUSED)
        join(team_home, "gwen", Role.LEAD)
        page = open_page("/groups", address=team)
        log_in(page, "gwen")
        expect(page.get_by_role("link", name="gwen")).to_be_visible()
        for number, text in enumerate(("Draw tight boxes.", "Draw very tight boxes.")):
            in_store(
                team_home,
                lambda store, n=number, said=text: write_guidelines(
                    store, "sample", said, based_on=n, actor="gwen"
                ),
            )
        page.goto("/datasets/sample/statistics")
        page.get_by_text("Versions, and what each changed").click()
        page.get_by_role("button", name="What it changed in version 2").click()
        expect(page.locator(".guidelines__changes ins")).to_have_text("added: very")
        page.get_by_role("button", name="Read version 1").click()
        expect(page.locator(".guidelines__shown")).to_contain_text("Draw tight boxes.")
        assert serious_in_both(page) == []
        page.get_by_role("button", name="Take back version 1").click()
        expect(page.get_by_text("3 versions, the last by gwen")).to_be_visible()
        now = in_store(team_home, lambda store: read_guidelines(store, "sample"))
        assert (now.number, now.text) == (3, "Draw tight boxes.")


def view_of(page: Page, group: int, index: int) -> Any:
    return page.request.get(f"/api/v1/groups/{group}").json()["views"][index]


def give(store: Store, name: str, role: Role) -> None:
    give_role(store, 1, find_person(store, name).id, role, actor="local")


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


def verdict(page: Page, group: int = 1) -> Any:
    """The last word on a group, as history has it."""
    entries = page.request.get(f"/api/v1/groups/{group}/history").json()["items"]
    last = [entry for entry in entries if entry["kind"] == "verdict"]
    return (
        {"state": last[-1]["body"]["state"], "by": last[-1]["actor"]} if last else {"state": None}
    )


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
        expect(tove.get_by_role("button", name="Give out…")).to_be_enabled()
        tove.keyboard.press("Shift+D")
        dialog = tove.get_by_role("dialog", name="Give out groups")
        dialog.get_by_label("Name").fill("A few")
        dialog.get_by_label("The first so many").fill("3")
        dialog.get_by_role("button", name="Give out", exact=True).click()
        tove.get_by_role("button", name="See the work").click()
        go_on = tove.get_by_role("button", name="Go on: 3 groups of A few")
        expect(go_on).to_be_focused()
        assert serious_in_both(tove) == []
        tove.keyboard.press("Enter")
        screen = Screen(tove)
        screen.ready()
        expect(tove.get_by_role("link", name="group 1 of 3")).to_be_visible()
        first = screen.group

        ivo = open_page("/work", address=team)
        log_in(ivo, "ivo")
        expect(ivo.get_by_role("button", name="Go on: 3 groups of A few")).to_be_focused()
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
            expect(here).to_contain_text("tove is here")
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
        expect(nora.get_by_role("button", name="Go on: 2 groups of B")).to_be_focused()
        nora.keyboard.press("Enter")
        Screen(nora).ready()
        nora.keyboard.press("Shift+F")
        until(nora, lambda: "/review/7" in nora.url)

        ralf = open_page(f"/review/6?q=batch%3A{given.id}", address=team)
        log_in(ralf, "ralf")
        Screen(ralf).ready()
        expect(ralf.get_by_role("button", name="Hand back to nora…")).to_be_visible()
        ralf.keyboard.press("Shift+U")
        dialog = ralf.get_by_role("dialog", name="Hand back to nora")
        expect(dialog.get_by_label("Why")).to_be_focused()
        assert serious_in_both(ralf) == []
        ralf.keyboard.type("The far goal line is missing")
        ralf.keyboard.press("Enter")
        expect(dialog).to_be_hidden()
        until(ralf, lambda: ralf.url.endswith("/work"))

        bell = nora.get_by_role("button", name="Bell")
        expect(bell).to_contain_text("2")
        nora.goto("/work")
        back = nora.get_by_role("list", name="Handed back to you")
        expect(back).to_contain_text("by ralf: “The far goal line is missing”")
        assert serious_in_both(nora) == []
        back.get_by_role("link").press("Enter")
        expect(nora.get_by_text("ralf handed this back")).to_be_visible()
        Screen(nora).ready()
        nora.keyboard.press("Shift+F")
        until(nora, lambda: "/review/7" in nora.url)
        groups = nora.request.get(f"/api/v1/batches/{given.id}/groups").json()["items"]
        assert [one["handed_in_by"] for one in groups] == ["nora", None]

    def test_two_who_annotate_the_same_group_blind_differ_and_the_lead_decides(
        self, open_page: OpenPage, team: str, team_home: Path, console: Any
    ) -> None:
        console.expect(REFUSED)
        join(team_home, "lotte", Role.LEAD)
        lotte = open_page("/groups?q=id%3A9", address=team)
        log_in(lotte, "lotte")
        for name in ("uma", "ulf"):
            join(team_home, name, Role.REVIEWER)
        expect(lotte.get_by_role("button", name="Give out…")).to_be_enabled()
        lotte.keyboard.press("Shift+D")
        dialog = lotte.get_by_role("dialog", name="Give out groups")
        dialog.get_by_label("Name").fill("Twice")
        dialog.get_by_label("People who annotate each group").fill("2")
        for name in ("uma", "ulf"):
            dialog.get_by_role("group", name="Annotators").get_by_label(name).check()
        dialog.get_by_role("button", name="Give out", exact=True).click()
        expect(lotte.get_by_role("button", name="See the work")).to_be_visible()

        copies: dict[str, int] = {}
        for name, keys in (("uma", ["s"]), ("ulf", ["x", "1"])):
            page = open_page("/work", address=team)
            log_in(page, name)
            copies[name] = judge_alone(page, "Twice", keys, unseen=copies)
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
        expect(page.get_by_label("Why, in a sentence")).to_be_focused()
        page.keyboard.type("Too far right")
        page.keyboard.press("Enter")
        expect(page.get_by_text("Nothing waits")).to_be_visible()
        rows = page.get_by_role("region", name="Own annotations").get_by_role("row")
        expect(rows.filter(has_text="udo")).to_contain_text("handed back by lars")
        assert serious_in_both(page) == []
        rows.filter(has_text="ute").get_by_role("link").press("Enter")
        Screen(page).ready()
        accept = page.get_by_role("button", name="Accept A")
        expect(accept).to_have_attribute("title", re.compile("ute has handed this in"))
        page.keyboard.press("Shift+R")
        expect(page.get_by_role("dialog", name="Take over ute’s annotation")).to_be_visible()
        expect(page.get_by_role("button", name="Take over Enter")).to_be_focused()
        page.keyboard.press("Enter")
        until(page, lambda: "/review/8" in page.url)
        expect(page.get_by_text("ute’s annotation is in the group now")).to_be_visible()
        assert verdict(page, 8) == {"state": "accepted", "by": "ute"}


def judge_alone(page: Page, batch: str, keys: list[str], *, unseen: dict[str, int]) -> int:
    """Judge the copy that somebody is given of a batch of one group; those of others are not there."""
    page.get_by_role("button", name=f"Go on: 1 group of {batch}").press("Enter")
    screen = Screen(page)
    screen.ready()
    copy = screen.group
    for name, other in unseen.items():
        assert page.request.get(f"/api/v1/groups/{other}").status == 404
        assert name not in page.locator("main").inner_text()
    assert len(page.request.get("/api/v1/datasets/sample/takes").json()["items"]) == 1
    for key in keys:
        screen.press(key)
        screen.drawn()
    until(page, lambda: verdict(page, copy)["state"] in ("deferred", "rejected"))
    return copy


def batch_in(page: Page) -> str:
    """Id of the batch that a page walks."""
    return str(page.evaluate("() => new URLSearchParams(location.search).get('q').slice(6)"))

"""The pages around the review: reached, readable for everybody, and doing their work."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from time import sleep

import httpx
import pytest
from playwright.sync_api import Page, Route, expect

from tests.e2e.screen import JOB_IS_OVER, TWO_FRAMES, until
from tests.e2e.test_access import (
    BEYOND_ITS_FRAME,
    NESTED_SCROLLERS,
    SIZES,
    resize,
    serious_in_both,
    soon,
)

OpenPage = Callable[..., Page]

PAGES = {
    "/datasets": ".dataset-card",
    "/datasets/sample/yield": ".funnel",
    "/datasets/sample/policy": ".policy__text",
    "/datasets/sample/statistics": ".spread",
    "/datasets/sample/versions": ".empty",
    "/datasets/sample/evaluation": ".run-form",
    "/datasets/sample/agreement": ".agreement__limits",
    "/import": "#import-dataset",
    "/jobs": ".page__main > *:nth-child(2)",
    "/exports": ".page__main > *:nth-child(2)",
}
TOO_WIDE = """() => [document.documentElement, document.querySelector('.page__main'),
  document.querySelector('.header')]
  .filter((element) => element.scrollWidth > element.clientWidth + 1)
  .map((element) => element.className || element.tagName)"""
FOCUS_INSIDE = """() => document.activeElement === document.body
  || document.activeElement.closest('dialog[open], [popover]:popover-open') !== null"""


def ask_for_modules(route: Route) -> None:
    """The page as it is where its modules are not joined."""
    answer = route.fetch()
    text = answer.text()
    assert "/built/main.js" in text
    apart = re.sub(r'<link rel="modulepreload"[^>]*>', "", text).replace("/built/", "/")
    route.fulfill(response=answer, body=apart)


class TestEveryPage:
    def test_is_usable_by_everybody_and_fits(self, open_page: OpenPage) -> None:
        page = open_page("/datasets")
        for path, waited in PAGES.items():
            page.goto(path)
            page.wait_for_selector(waited)
            found = {"axe": serious_in_both(page)}
            for width, height in SIZES:
                resize(page, width, height)
                found[f"too wide at {width}"] = soon(page, TOO_WIDE)
                found[f"scrolls twice at {width}"] = soon(page, NESTED_SCROLLERS)
                found[f"cut off at {width}"] = soon(page, BEYOND_ITS_FRAME)
            assert {name: what for name, what in found.items() if what} == {}, path


def usable(page: Page) -> None:
    """Everybody can use what is shown now, and it fits at every size."""
    found = {"axe": serious_in_both(page)}
    before = page.viewport_size
    for width, height in SIZES:
        resize(page, width, height)
        found[f"too wide at {width}"] = soon(page, TOO_WIDE)
        found[f"scrolls twice at {width}"] = soon(page, NESTED_SCROLLERS)
        found[f"cut off at {width}"] = soon(page, BEYOND_ITS_FRAME)
    assert before is not None
    page.set_viewport_size(before)
    assert {name: what for name, what in found.items() if what} == {}


class TestNavigation:
    def test_the_menu_leads_to_every_page_of_a_dataset(self, open_page: OpenPage) -> None:
        page = open_page("/datasets")
        page.wait_for_selector(".dataset-card")
        page.get_by_role("button", name="Dataset and pages").click()
        menu = page.locator("#dataset-menu")
        expect(menu.get_by_role("link", name="sample")).to_be_visible()
        menu.get_by_role("link", name="Statistics").click()
        page.wait_for_url("**/datasets/sample/statistics")
        expect(menu).to_be_hidden()
        expect(page.locator(".spread").first).to_be_visible()

    def test_the_palette_finds_pages_groups_and_actions(self, open_page: OpenPage) -> None:
        page = open_page("/groups")
        page.wait_for_selector(".queue-row a")
        page.keyboard.press("Control+k")
        field = page.get_by_role("combobox", name="Page, dataset, group or action")
        expect(field).to_be_focused()
        page.keyboard.type("yield")
        expect(page.locator(".palette [aria-selected=true]")).to_contain_text("Yield")
        page.keyboard.press("Enter")
        page.wait_for_url("**/datasets/sample/yield")
        expect(page.locator("dialog[open]")).to_have_count(0)
        page.keyboard.press("Control+k")
        field.fill("7")
        expect(page.get_by_role("option", name="Group 7")).to_be_visible()
        page.keyboard.press("Enter")
        page.wait_for_url("**/review/7")

    def test_keys_typed_before_the_palette_stands_are_its_own(self, open_page: OpenPage) -> None:
        page = open_page(None)
        held: list[Route] = []
        # Of modules that are joined, none has to be waited for.
        page.route("**/review/1", ask_for_modules)
        page.route("**/views/palette.js*", lambda route: held.append(route))
        page.goto("/review/1")
        page.wait_for_selector(".image-panel__stage[data-ready=true]")
        before = page.request.get("/api/v1/groups/1").json()["verdict"]
        page.keyboard.press("Control+k")
        page.keyboard.type("statistiks")
        page.keyboard.press("Backspace")
        page.keyboard.press("Backspace")
        page.keyboard.type("cs")
        page.keyboard.press("Enter")
        until(page, lambda: held)
        for route in held:
            route.continue_()
        page.wait_for_url("**/datasets/sample/statistics")
        assert page.request.get("/api/v1/groups/1").json()["verdict"] == before

    def test_a_number_typed_in_one_go_opens_its_group(self, open_page: OpenPage) -> None:
        page = open_page("/groups")
        page.wait_for_selector(".queue-row a")
        page.keyboard.press("Control+k")
        page.keyboard.type("7")
        page.keyboard.press("Enter")
        page.wait_for_url("**/review/7")

    def test_a_dataset_that_is_not_there_says_so(self, open_page: OpenPage) -> None:
        page = open_page("/datasets/nowhere/yield")
        expect(page.locator(".empty h2")).to_have_text("There is no dataset “nowhere”")
        usable(page)

    def test_an_address_that_is_none_leads_back(self, open_page: OpenPage) -> None:
        page = open_page("/review/nowhere")
        expect(page.get_by_role("heading")).to_have_text("There is no such page")
        usable(page)
        page.get_by_role("link", name="Open the queue").click()
        page.wait_for_selector(".queue-row a")

    def test_a_dataset_alone_is_its_yield(self, open_page: OpenPage) -> None:
        page = open_page("/datasets/sample")
        expect(page.locator(".funnel")).to_be_visible()


class TestAlone:
    def test_a_page_of_accounts_says_that_there_are_none(self, open_page: OpenPage) -> None:
        page = open_page("/account")
        for path in ("/account", "/people"):
            page.goto(path)
            expect(page.get_by_role("heading", name="There are no accounts")).to_be_visible()
            assert serious_in_both(page) == []


class TestDialogs:
    """Opened, used by everybody, left by Escape; the focus then is where it was."""

    @pytest.mark.parametrize(
        ("path", "opener"),
        [
            ("/datasets", "Export…"),
            ("/datasets", "Delete…"),
            ("/datasets/sample/versions", "Freeze a version…"),
            ("/datasets/sample/evaluation", "Upload predictions…"),
            ("/jobs", "Help"),
            ("/jobs", "Dataset and pages"),
        ],
    )
    def test_give_the_focus_back(self, open_page: OpenPage, path: str, opener: str) -> None:
        page = open_page(path)
        page.wait_for_selector(".page__main > :nth-child(2)")
        button = page.get_by_role("button", name=opener).first
        button.focus()
        page.keyboard.press("Enter")
        dialog = page.locator("dialog[open], [popover]:popover-open")
        expect(dialog).to_be_visible()
        modal = dialog.evaluate("element => element.matches('dialog')")
        if modal:
            until(page, lambda: page.evaluate(FOCUS_INSIDE))
        usable(page)
        for _ in range(12 if modal else 0):
            page.keyboard.press("Tab")
            until(page, lambda: page.evaluate(FOCUS_INSIDE))
        page.keyboard.press("Escape")
        expect(dialog).to_have_count(0)
        expect(button).to_be_focused()

    def test_the_palette_gives_the_focus_back(self, open_page: OpenPage) -> None:
        page = open_page("/datasets")
        button = page.get_by_role("button", name="Export…").first
        button.focus()
        page.keyboard.press("Control+k")
        expect(page.get_by_role("combobox")).to_be_focused()
        usable(page)
        page.keyboard.press("Escape")
        expect(page.locator("dialog")).to_have_count(0)
        expect(button).to_be_focused()


class TestYield:
    def test_a_moved_slider_redraws_the_funnel_and_saves_nothing(self, open_page: OpenPage) -> None:
        page = open_page("/datasets/sample/yield")
        page.wait_for_selector(".funnel")
        expect(page.locator(".yield__difference")).to_contain_text("The saved policy")
        before = page.locator(".yield__difference").inner_text()
        slider = page.get_by_label("Smallest share of field lines that fit, slider")
        slider.press("End")
        expect(page.locator(".yield__difference")).to_contain_text("0 pass")
        expect(page.locator(".funnel tr").last).to_contain_text("0")
        page.wait_for_url("**/yield?min_jac=*")
        page.reload()
        expect(page.locator(".yield__difference")).to_contain_text("0 pass")
        page.get_by_role("button", name="Reset").click()
        page.wait_for_url("**/yield")
        expect(page.locator(".yield__difference")).to_have_text(before)
        page.get_by_label("As numbers").or_(page.get_by_text("As numbers")).click()
        expect(page.locator(".chart__numbers tbody tr")).to_have_count(101)

    def test_a_link_and_back_set_the_thresholds_of_their_address(self, open_page: OpenPage) -> None:
        page = open_page("/datasets/sample/yield?min_jac=0.9")
        slider = page.get_by_label("Smallest share of field lines that fit, slider")
        expect(slider).to_have_value("0.9")
        reset = page.get_by_role("button", name="Reset")
        page.get_by_role("navigation").get_by_role("link", name="Yield", exact=True).click()
        expect(slider).not_to_have_value("0.9")
        reset.click(force=True)
        expect(page.get_by_text("Nothing is changed.")).to_be_visible()
        page.go_back()
        expect(slider).to_have_value("0.9")
        expect(reset).to_have_attribute("aria-disabled", "false")
        page.wait_for_url("**/yield?min_jac=0.9")

    def test_one_that_is_still_counted_says_how_far_it_is_and_comes(
        self, open_page: OpenPage, console
    ) -> None:
        page = open_page("/datasets")
        asked: list[str] = []
        seen: list[str] = []

        def count_first(route: Route) -> None:
            asked.append(route.request.url)
            if seen:
                route.continue_()
                return
            told = "the yield is being counted: 40,000 groups are read, about 60,000 are left"
            problem = {"title": "Overloaded", "status": 503, "detail": told}
            route.fulfill(status=503, json=problem, content_type="application/problem+json")

        console.expect("503")
        page.route("**/api/v1/datasets/*/yield", count_first)
        page.goto("/datasets/sample/yield")
        expect(page.get_by_role("alert")).to_contain_text("40,000 groups are read")
        seen.append("how far it is")
        expect(page.locator(".funnel")).to_be_visible()
        expect(page.get_by_role("alert")).to_have_count(0)


class TestStatistics:
    def test_a_bar_opens_its_groups_in_the_queue_by_keyboard(self, open_page: OpenPage) -> None:
        page = open_page("/datasets/sample/statistics")
        spread = page.locator(".spread").first
        spread.wait_for()
        bars = spread.locator(".spread__bar")
        spread.locator("a[tabindex='0']").press("End")
        expect(bars.last).to_be_focused()
        bars.last.press("ArrowLeft")
        bar = bars.nth(bars.count() - 2)
        expect(bar).to_be_focused()
        said = bar.get_attribute("aria-label") or ""
        bar.press("Enter")
        page.wait_for_url("**/groups?**")
        groups = said.rsplit(": ", 1)[1].split()[0]
        expect(page.locator(".save")).to_contain_text(f"{groups} of 14 match")


class TestNoise:
    @pytest.mark.parametrize("place", ["statistics", "policy"])
    def test_the_noise_of_the_clicks_stands_beside_what_the_policy_says(
        self, open_page: OpenPage, place: str
    ) -> None:
        card = open_page(f"/datasets/sample/{place}").get_by_label("Annotation noise")
        expect(card).to_contain_text("Sigma of a point on a line")
        # One line for each number, those of lines too: nothing contradicts them.
        expect(card.get_by_role("row")).to_have_count(5)

    @pytest.mark.parametrize(("noise", "said"), [("fixed", 1), ("estimated", 0)])
    def test_beside_sigma_stands_whether_noise_is_assumed(
        self, open_page: OpenPage, noise: str, said: int
    ) -> None:
        page = open_page(None)

        def judged(route: Route) -> None:
            answer = route.fetch()
            body = answer.json()
            for item in body.get("items", [body]):
                item["policy"]["noise"] = noise
            route.fulfill(response=answer, json=body)

        page.route(re.compile(r"/api/v1/datasets(\?.*)?$"), judged)
        page.route(re.compile(r"/api/v1/groups/\d+(\?.*)?$"), judged)
        sigma_of = {
            "/datasets/sample/statistics": "#spread-sigma",
            "/groups?dataset=sample": ".histogram[aria-label='σ, m'] rect >> nth=0",
            "/review/1": "[data-number=sigma]",
        }
        for address, sigma in sigma_of.items():
            page.goto(address)
            expect(page.locator(sigma)).to_be_visible()
            expect(page.get_by_text("assumed noise")).to_have_count(said)

    def test_the_button_says_what_it_changes_and_the_noise_is_asked_once_for_each_policy(
        self, open_page: OpenPage
    ) -> None:
        page, asked, version = open_page(None), [], [1]
        share = {"name": "box_sigma_share", "label": "Of its diameter", "unit": "share"}
        numbers = {"present": 0.04, "estimate": 0.08, "low": 0.07, "high": 0.09, "agrees": False}
        noise = {"groups": 3, "solved": 3, "ball": {}, "follows": False, "notices": []}
        own = [{"camera": "cam2", "person": None, "ratio": 1.8}]
        noise |= {"factors": own, "used": [], "is_new": True, "stations": [], "people": []}
        noise["stations"] = [
            {"source": "cam2", "sigma_px": 1.8, "low": 1.5, "high": 2.2, "differs": True}
        ]
        noise |= {"advice": [share | numbers], "values": {"box_sigma_share": 0.08}}
        job = {"id": 999, "kind": "solve", "title": "Solve", "dataset": "sample", "done": 0}
        job |= {"total": 1, "sentence": "", "result": None, "problem": None, "ended": None}
        job |= {"created": "2026-01-01T00:00:00Z", "started": None, "actor": "local"}

        held: list[Route] = []

        def policy(route: Route) -> None:
            if version[-1] == 2 and not held:
                # The job is over before this is answered: the page gives it up and reads anew.
                held.append(route)
                return
            answer = route.fetch()
            route.fulfill(response=answer, json={**answer.json(), "version": version[-1]})

        def tell(route: Route) -> None:
            if route.request.method == "POST":
                version.append(version[-1] + 1)
                route.fulfill(status=202, json={**job, "state": "running"})
                return
            asked.append(version[-1])
            route.fulfill(json=noise)

        page.route("**/api/v1/datasets/*/policy", policy)
        page.route("**/api/v1/datasets/*/noise", tell)
        ended: list[bool] = []
        page.route(
            "**/api/v1/jobs/999",
            lambda route: route.fulfill(json={**job, "state": "done" if ended else "running"}),
        )
        page.goto("/datasets/sample/policy")
        card = page.get_by_label("Annotation noise")
        expect(card).to_contain_text("sets “Of its diameter” to 0.08 (now 0.04)")
        expect(card).to_contain_text("differ from the dataset for camera cam2 (1.80 times)")
        button = card.get_by_role("button", name="Use the estimates and solve")
        button.click()
        expect(button).to_have_attribute("aria-disabled", "true")
        until(page, lambda: held)
        ended.append(True)
        expect(button).to_have_attribute("aria-disabled", "false")
        expect(page.get_by_role("heading", name="version 2")).to_be_visible()
        until(page, lambda: len(asked) > 1)
        # It would be asked once more by what is drawn next.
        page.evaluate(TWO_FRAMES)
        assert asked == [1, 2]


@pytest.fixture
def wrong_pitch(server: str) -> Iterator[tuple[int, int]]:
    """The match of the sample that is solved on too small a pitch: its place, its first group."""
    path = f"{server}/api/v1/datasets/sample/pitches"
    items = httpx.get(path).json()["items"]
    which = max(range(len(items)), key=lambda place: items[place]["groups"])

    def solve_on(length: float, width: float) -> None:
        answer = httpx.get(path)
        body = {"match": answer.json()["items"][which]["match"], "length": length, "width": width}
        job = httpx.patch(path, json=body, headers={"If-Match": answer.headers["etag"]})
        assert job.is_success, job.text
        state = f"{server}/api/v1/jobs/{job.json()['id']}"
        while httpx.get(state).json()["state"] not in JOB_IS_OVER:
            sleep(0.1)

    solve_on(103.0, 66.0)
    yield which, items[which]["group_id"]
    solve_on(105.0, 68.0)


class TestPitchSizes:
    def test_a_proposed_size_is_accepted_and_taken_back_by_keyboard(
        self, open_page: OpenPage, wrong_pitch: tuple[int, int]
    ) -> None:
        which, group = wrong_pitch
        page = open_page(f"/review/{group}")
        page.get_by_role("link", name="See pitch sizes on the Statistics page").click()
        page.wait_for_url("**/datasets/sample/statistics")
        card = page.get_by_role("region", name="Pitch sizes")
        heading = card.get_by_role("heading")
        row = card.locator("tbody tr").nth(which)
        expect(row.get_by_role("cell").first).to_have_text("103 × 66 m")
        expect(heading).to_contain_text("1 proposed")
        expect(card.get_by_role("columnheader").last).to_have_text("actions")
        name = row.get_by_role("rowheader").inner_text().split("\n")[0]
        use = row.get_by_role("button", name=f" for {name}").filter(has_text="Use ")
        expect(use).not_to_have_attribute("aria-disabled", "true")
        size = use.inner_text().split("\n")[0].removeprefix("Use ").split(" for ")[0]
        use.press("Enter")
        expect(row.get_by_role("cell").first).to_have_text(size)
        expect(heading).to_be_focused()
        back = row.get_by_role("button", name=f"Restore previous for {name}")
        expect(back).to_have_attribute("aria-disabled", "false")
        back.press("Enter")
        expect(row.get_by_role("cell").first).to_have_text("103 × 66 m")
        expect(heading).to_be_focused()


@pytest.fixture
def sharing_policy(server: str) -> Iterator[None]:
    """The sample is judged by a policy that uses the positions that matches share."""
    path = f"{server}/api/v1/datasets/sample/policy"

    def use(share: bool) -> None:
        answer = httpx.get(path)
        body = {"values": {"calibration.share_position": share}}
        job = httpx.put(path, json=body, headers={"If-Match": answer.headers["etag"]})
        assert job.is_success, job.text
        state = f"{server}/api/v1/jobs/{job.json()['id']}"
        while httpx.get(state).json()["state"] not in JOB_IS_OVER:
            sleep(0.1)

    use(True)
    yield
    use(False)


class TestMainCameras:
    def test_their_position_is_shared_and_taken_back_by_keyboard(
        self, open_page: OpenPage, sharing_policy: None
    ) -> None:
        page = open_page("/datasets/sample/statistics")
        card = page.get_by_role("region", name="Main cameras")
        row = card.locator("tbody tr").first
        expect(row).to_contain_text("none of")
        share = row.get_by_role("button", name="Share")
        expect(share).not_to_have_attribute("aria-disabled", "true")
        share.press("Enter")
        expect(row).to_contain_text("use a shared position")
        expect(card.get_by_role("heading")).to_be_focused()
        back = row.get_by_role("button", name="Restore previous")
        expect(back).to_have_attribute("aria-disabled", "false")
        back.press("Enter")
        expect(row).to_contain_text("none of")

"""What is asked of exports and jobs leaves as said; their numbers and the camera's are those of the server."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from math import atan, degrees
from pathlib import Path
from typing import Any

from playwright.sync_api import Page, Response, expect

from app.db.store import Store
from app.features.jobs.queries import NewJob, insert_job, update_job
from tests.e2e.conftest import Console
from tests.e2e.crew import Crew, judged, open_as
from tests.e2e.forms import DIALOG, Json, Row, carry_out, fixed, press, read, says, tick
from tests.e2e.screen import passing
from tests.e2e.team import OpenPage, in_store
from tests.e2e.test_calibration_editor import Editor, longest

BEGUN = f"{datetime.now(UTC) - timedelta(hours=2):%Y-%m-%dT%H:%M:%SZ}"
ENDED = f"{datetime.now(UTC) - timedelta(hours=1):%Y-%m-%dT%H:%M:%SZ}"
OLD_JOBS = 56
"""More than the page of jobs shows at first."""


EXPORTS = [
    Row(
        "exports as it is proposed",
        [press("Export sample…"), press("Export", DIALOG)],
        {
            "POST /exports": {
                "dataset": "sample",
                "format": "soccernet-v3d",
                "all": False,
                "boxes": "optimized",
                "images": "none",
                "views": "valid",
                "version": None,
            }
        },
        {".export__result": "Ready"},
    ),
    Row(
        "exports otherwise",
        [
            lambda page: page.locator(DIALOG).get_by_role("radio", name="COCO").check(),
            lambda page: page.locator(DIALOG).get_by_role("radio", name="All groups").check(),
            lambda page: page.locator(DIALOG).get_by_role("radio", name="Annotated boxes").check(),
            tick("Copy the frames into the zip", DIALOG),
            tick("COCO and YOLO: include balls that no other view confirms", DIALOG),
            press("Export", DIALOG),
        ],
        {
            "POST /exports": {
                "dataset": "sample",
                "format": "coco",
                "all": True,
                "boxes": "annotated",
                "images": "copy",
                "views": "all",
                "version": None,
            }
        },
        {".export__result": "Ready: 14 groups"},
    ),
    Row(
        "exports tight boxes",
        [
            lambda page: page.locator(DIALOG).get_by_role("radio", name="YOLO").check(),
            lambda page: page.locator(DIALOG).get_by_role("radio", name="Exact outlines").check(),
            tick("Copy the frames into the zip", DIALOG, on=False),
            press("Export", DIALOG),
        ],
        {
            "POST /exports": {
                "dataset": "sample",
                "format": "yolo",
                "all": True,
                "boxes": "exact",
                "images": "none",
                "views": "all",
                "version": None,
            }
        },
        {".export__result": "Export finished, but incomplete"},
    ),
]


def size_text(size: int) -> str:
    """Bytes as people read them."""
    for power, unit in ((2, "MB"), (1, "kB")):
        if size >= 1000**power:
            return f"{size / 1000**power:.1f} {unit}"
    return f"{size} B"


class TestExports:
    def test_what_is_asked_of_an_export_leaves_as_said_and_its_row_has_its_numbers(
        self, open_page: OpenPage, crew: Crew
    ) -> None:
        ada = crew.log_in("ada")
        judged(ada, 1, "accepted")
        page = open_as(open_page, ada, "/exports")
        expect(page.get_by_role("heading", name="No export yet")).to_be_visible()
        for row in EXPORTS:
            carry_out(page, row, {})
        (counts,) = [one for one in read(page, "/datasets")["items"] if one["name"] == "sample"]
        dialog = page.locator(DIALOG)
        expect(dialog).to_contain_text(f"Accepted groups · {counts['accepted']}")
        expect(dialog).to_contain_text(f"All groups · {counts['groups']}")
        expect(dialog.get_by_role("button", name="Export", exact=True)).to_be_enabled()
        # What a format does not use cannot be chosen, and is not sent.
        dialog.get_by_role("radio", name="Game state").check()
        expect(dialog.get_by_role("radio", name="Exact outlines")).to_be_disabled()
        expect(dialog.get_by_label("COCO and YOLO: include balls")).to_be_disabled()
        expect(dialog.get_by_label("Copy the frames into the zip")).to_be_enabled()
        page.keyboard.press("Escape")
        items = read(page, "/exports")["items"]
        assert len(items) == len(EXPORTS)
        lines = page.locator("main tbody tr")
        expect(lines).to_have_count(len(items))
        for line, one in zip(lines.all(), items, strict=True):
            asked, cells = one["request"], line.get_by_role("cell")
            groups = "all groups" if asked["all"] else "accepted groups"
            held = [
                f"{n:,} {name.replace('_', ' ').removesuffix('s' if n == 1 else '')}"
                for name, n in one["counts"].items()
            ]
            expect(line.get_by_role("rowheader")).to_have_text(f"sample{asked['format']}")
            what = " · ".join([groups, f"{asked['boxes']} boxes", *held])
            expect(cells.nth(0)).to_contain_text(what)
            for why, n in one["left_out"].items():
                expect(cells.nth(0)).to_contain_text(f"{n} {why.replace('_', ' ')}")
            expect(cells.nth(1)).to_have_text(
                one["status"] if one["incomplete"] is None else "incomplete"
            )
            expect(cells.nth(2)).to_have_text(size_text(one["bytes"]))
            expect(cells.nth(3).locator("time")).to_have_attribute("datetime", one["created"])
            expect(line.get_by_role("link")).to_have_attribute("href", one["content"])
        with page.expect_download() as download:
            page.get_by_role("link", name=f"Download export {items[1]['id']}").click()
        assert download.value.path().stat().st_size == items[1]["bytes"]
        middle = items[1]["id"]
        delete = Row(
            "deletes an export",
            [press(f"Delete export {middle}"), press(f"Delete for good? export {middle}")],
            {"DELETE /exports/{export}": None},
            hides="a[href='/api/v1/exports/{export}/content']",
        )
        carry_out(page, delete, {"export": middle})
        status = {one["id"]: one["status"] for one in read(page, "/exports")["items"]}
        assert [name for name, state in status.items() if state == "ready"] == [
            items[0]["id"],
            items[2]["id"],
        ]


def past_jobs(store: Store) -> dict[str, int]:
    """Many jobs that are over, and some that say more, the newest last; one runs, that nobody does."""
    over: dict[str, Any] = {"started": BEGUN, "ended": ENDED}
    problem = {"detail": "the disk is full", "hint": "Make room.", "pointer": None}
    result = {"outcome": "partial", "new": 3, "changed": 1, "unchanged": 2}
    result |= {"skipped": [{}, {}], "more_skipped": 5, "without_picture": 1}
    with store.write() as session:
        for number in range(OLD_JOBS):
            new = NewJob("freeze", f"Freeze no {number}", "ada", 1)
            update_job(session, insert_job(session, new), state="done", **over)
        failed = insert_job(session, NewJob("solve", "Solve in vain", "bob", 1))
        update_job(session, failed, state="failed", problem=problem, **over)
        partial = insert_job(session, NewJob("import", "Import a part", "carl"))
        update_job(session, partial, state="done", result=result, **over)
        runs = insert_job(session, NewJob("evaluate", "Evaluate for long", "dora", 1))
        update_job(session, runs, state="running", started=BEGUN, done=3, total=9)
    return {"failed": failed, "partial": partial, "runs": runs}


def end_job(store: Store, job: int) -> None:
    with store.write() as session:
        update_job(session, job, state="cancelled", ended=ENDED)


class TestJobs:
    def test_older_jobs_come_one_is_cancelled_and_each_says_what_came_of_it(
        self, open_page: OpenPage, crew: Crew, team_home: Path, console: Console
    ) -> None:
        ids = in_store(team_home, past_jobs)
        page = open_as(open_page, crew.log_in("ada"), "/jobs")
        cards = page.locator("main li section")
        oldest = page.get_by_role("region", name="Freeze no 0")
        runs = page.get_by_role("region", name=f"Job {ids['runs']}: Evaluate for long")
        expect(runs.get_by_role("progressbar")).to_have_attribute("aria-valuenow", "33")
        expect(runs).to_contain_text("3 of 9")
        expect(runs).to_contain_text("evaluate · sample · dora · started")
        expect(runs.locator("time")).to_have_attribute("datetime", BEGUN)
        failed = page.get_by_role("region", name=f"Job {ids['failed']}: Solve in vain")
        expect(failed.locator(".pill")).to_have_text("failed")
        expect(failed).to_contain_text("The disk is full")
        expect(failed).to_contain_text("Make room.")
        expect(failed.get_by_role("link")).to_have_attribute("href", "/groups?dataset=sample")
        ended = failed.locator("time").last
        expect(ended).to_have_attribute("datetime", ENDED)
        part = page.get_by_role("region", name=f"Job {ids['partial']}: Import a part")
        expect(part.locator(".pill")).to_have_text("partly done")
        expect(part).to_contain_text("6 groups · 7 records left out · 1 group without any picture")
        cursor = read(page, "/jobs?limit=50")["next"]
        expect(oldest).to_have_count(0)
        cancel = Row(
            "cancels the one that runs",
            [press("Cancel Evaluate for long")],
            {"DELETE /jobs/{runs}": None},
        )
        carry_out(page, cancel, ids)
        in_store(team_home, lambda store: end_job(store, ids["runs"]))
        self.keeps_asking_for_older_ones(page, console)
        more = Row(
            "asks for older ones",
            [press("Older jobs")],
            {f"GET /jobs?limit=50&cursor={cursor}": None},
        )
        carry_out(page, more, ids)
        everything = read(page, "/jobs?limit=500")["items"]
        expect(cards).to_have_count(len(everything))
        expect(oldest).to_have_count(1)
        expect(page.get_by_role("button", name="Older jobs")).to_have_count(0)
        titles = [title for title in cards.locator("strong").all_inner_texts() if "Freeze" in title]
        assert titles == [one["title"] for one in everything if one["kind"] == "freeze"]

    def keeps_asking_for_older_ones(self, page: Page, console: Console) -> None:
        """Also where they could not be read once."""
        console.expect("503")
        page.route("**/jobs?*cursor=*", lambda route: route.fulfill(status=503), times=1)
        press("Older jobs")(page)
        expect(page.get_by_role("heading", name="The jobs cannot be shown")).to_be_visible()


class TestCamera:
    def test_its_numbers_and_those_before_and_after_are_those_of_the_server(
        self, open_page: OpenPage, crew: Crew
    ) -> None:
        page = open_as(open_page, crew.log_in("dora"), "/groups")
        editor = Editor(page, crew.address, passing(page, 0), 1)
        solution = editor.document()["solution"]
        solved = self.solved_of(solution, editor.key)
        calibration = solved["calibration"]
        says(
            page,
            {
                f'.camera-card [data-number="{name}"]': text
                for name, text in camera_texts(calibration, editor.view["width"]).items()
            },
        )
        before = compared_texts(solution, solved)
        assert {name: editor.compared(name)[0] for name in before} == before

        answers: list[Response] = []
        page.on("response", lambda answer: answers.append(answer))
        editor.choose(longest(editor.lines))
        editor.press(".", "Shift+ArrowDown", "Shift+ArrowDown")
        editor.staged(1)
        editor.previewed()
        (*_, last) = [one for one in answers if one.url.endswith("/preview")]
        staged = last.json()["solution"]
        after = compared_texts(staged, self.solved_of(staged, editor.key))
        assert after != before
        assert {name: editor.compared(name)[1] for name in after} == after
        editor.press("Control+Delete")
        editor.staged(0)

    def solved_of(self, solution: Json, view: str) -> Json:
        return next(one for one in solution["views"] if one["view"] == view)


def camera_texts(calibration: Json, width: int) -> dict[str, str]:
    """The camera card's numbers, each with how far it may be off."""
    camera, sigma = calibration["camera"], calibration["sigma"]
    x, y, z = camera["position_meters"]
    off = dict(zip(("x", "y", "height"), sigma["position_meters"], strict=True))
    numbers = {
        "pan": (camera["pan_degrees"], 2, "°", sigma["pan_degrees"]),
        "tilt": (camera["tilt_degrees"], 2, "°", sigma["tilt_degrees"]),
        "roll": (camera["roll_degrees"], 2, "°", sigma["roll_degrees"]),
        "x": (x, 2, " m", off["x"]),
        "y": (y, 2, " m", off["y"]),
        "height": (-z, 2, " m", off["height"]),
        "focal": (camera["x_focal_length"], 0, " px", sigma["focal_px"]),
        "k1": (camera["radial_distortion"][0], 3, "", sigma["k1"]),
    }
    texts = {
        name: f"{fixed(value, digits, unit)}±{fixed(error, digits and max(digits, 2))}"
        for name, (value, digits, unit, error) in numbers.items()
    }
    field = 2 * degrees(atan(width / (2 * camera["x_focal_length"])))
    return {**texts, "field": fixed(field, 1, "°")}


def compared_texts(solution: Json, solved: Json) -> dict[str, str]:
    """The numbers of a state as the table of before and after has them."""
    calibration, ball = solved["calibration"], solution["ball"]
    worst = max(one["largest_px"] for one in calibration["markings"] if one["largest_px"])
    passed = sum(gate["active"] and gate["passed"] for gate in solution["gates"])
    return {
        "jac 0.5": fixed(calibration["jac"]["0.5"], 2),
        "jac 1": fixed(calibration["jac"]["1"], 2),
        "jac 2": fixed(calibration["jac"]["2"], 2),
        "median": fixed(calibration["error_px"], 2, " px"),
        "worst": fixed(worst, 1, " px"),
        "ratio": fixed(solved["ball"]["size_ratio"], 2, "×"),
        "gates": str(passed),
        "views": str(len(ball["views"])),
        "x": fixed(ball["point"][0], 2, " m"),
        "y": fixed(ball["point"][1], 2, " m"),
        "height": fixed(ball["height_m"], 2, " m"),
        "sigma": fixed(ball["sigma_m"], 2, " m"),
        "parallax": fixed(ball["parallax_degrees"], 1, "°"),
    }

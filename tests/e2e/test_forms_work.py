"""What is given out and set leaves as said; how far people are stands beside it."""

from __future__ import annotations

from datetime import date, timedelta
from pathlib import Path
from typing import Any

from playwright.sync_api import Page, expect

from tests.e2e.crew import Crew, judged, open_as, sent
from tests.e2e.forms import DIALOG, Json, Row, carry_out, choose, fill, fixed, press, read, tick
from tests.e2e.screen import jobs_end
from tests.e2e.team import OpenPage

DUE = date(2040, 5, 20)
GIVEN: dict[str, Any] = {
    "size": None,
    "annotators": [],
    "reviewers": [],
    "due": None,
    "skip_given": True,
}
GIVEN |= {"verdicts": 1, "blind": True, "gold_every": None}
ANNOTATORS = f"{DIALOG} fieldset:has(legend:text('Annotators'))"
REVIEWERS = f"{DIALOG} fieldset:has(legend:text('Reviewers'))"
PRESS_GIVE = press("Assign", DIALOG)
GIVING = [
    Row(
        "gives all groups out",
        [press("Assign…"), fill("Name", " Everything ", DIALOG), PRESS_GIVE],
        {"POST /datasets/1/batches": {**GIVEN, "name": "Everything", "q": ""}},
        hides=DIALOG,
    ),
    Row(
        "gives a few to some people until a day",
        [
            press("Assign…"),
            fill("Name", "Friday", DIALOG),
            fill("Number of groups (the first of the list)", "3", DIALOG),
            fill("Due", DUE.isoformat(), DIALOG),
            tick("carl", ANNOTATORS),
            tick("bob", ANNOTATORS),
            tick("bob", ANNOTATORS, on=False),
            tick("bob", REVIEWERS),
            tick("dora", REVIEWERS),
            tick("Skip groups that are in another open batch", DIALOG, on=False),
            PRESS_GIVE,
        ],
        {
            "POST /datasets/1/batches": {
                **GIVEN,
                "name": "Friday",
                "q": "",
                "size": 3,
                "due": DUE.isoformat(),
                "annotators": ["carl"],
                "reviewers": ["bob", "dora"],
                "skip_given": False,
            }
        },
        hides=DIALOG,
    ),
    Row(
        "mixes gold groups in and lets two annotate who see each other",
        [
            press("Assign…"),
            fill("Name", "Twice", DIALOG),
            fill("Annotators per group", "2", DIALOG),
            fill("Gold groups: one in every N groups of an annotator", "4", DIALOG),
            choose("Use as gold groups", "sample", DIALOG),
            choose("A copy of a gold group starts with", "without_balls", DIALOG),
            tick("bob", ANNOTATORS),
            tick("carl", ANNOTATORS),
            tick("Annotators do not see each other’s work", DIALOG, on=False),
            tick("Skip groups that are in another open batch", DIALOG, on=False),
            PRESS_GIVE,
        ],
        {
            "POST /datasets/1/gold": {"source": "sample", "start": "without_balls"},
            "POST /datasets/1/batches": {
                **GIVEN,
                "name": "Twice",
                "q": "",
                "annotators": ["bob", "carl"],
                "skip_given": False,
                "verdicts": 2,
                "blind": False,
                "gold_every": 4,
            },
        },
        hides=DIALOG,
    ),
]
TEAM = "section[aria-labelledby=team-title]"
BATCHES = [
    Row(
        "gives a batch on",
        [
            press("Reassign… Friday"),
            fill("Name", "Saturday", DIALOG),
            fill("Due", (DUE + timedelta(days=1)).isoformat(), DIALOG),
            fill("Gold groups: one in every N groups of an annotator", "5", DIALOG),
            tick("carl", ANNOTATORS, on=False),
            tick("dora", ANNOTATORS),
            tick("bob", REVIEWERS, on=False),
            press("Save", DIALOG),
        ],
        {
            "PATCH /batches/{Friday}": {
                "name": "Saturday",
                "due": (DUE + timedelta(days=1)).isoformat(),
                "annotators": ["dora"],
                "reviewers": ["dora"],
                "gold_every": 5,
            }
        },
        hides=DIALOG,
    ),
    Row(
        "takes its day and its gold groups away",
        [
            press("Reassign… Saturday"),
            fill("Due", "", DIALOG),
            fill("Gold groups: one in every N groups of an annotator", "", DIALOG),
            press("Save", DIALOG),
        ],
        {
            "PATCH /batches/{Saturday}": {
                "name": "Saturday",
                "due": None,
                "annotators": ["dora"],
                "reviewers": ["dora"],
                "gold_every": None,
            }
        },
        hides=DIALOG,
    ),
    Row(
        "closes it",
        [press("Close Saturday")],
        {"PATCH /batches/{Saturday}": {"state": "closed"}},
        {f"{TEAM} li:has(h3:has-text('Saturday')) .pill": "closed"},
    ),
    Row(
        "opens it again",
        [press("Open again Saturday")],
        {"PATCH /batches/{Saturday}": {"state": "open"}},
        hides=f"{TEAM} li:has(h3:has-text('Saturday')) .pill",
    ),
    Row(
        "deletes another, once it has said so twice",
        [press("Delete Twice"), press("Really delete? Twice")],
        {"DELETE /batches/{Twice}": None},
        hides="h3:has-text('Twice')",
    ),
]


class TestBatches:
    def test_what_is_given_out_and_on_leaves_as_said_and_its_numbers_stand_beside_it(
        self, open_page: OpenPage, crew: Crew
    ) -> None:
        dora = crew.log_in("dora")
        page = open_as(open_page, dora, "/groups")
        *ordinary, gold = GIVING
        for row in ordinary:
            carry_out(page, row, {})
        batches = read(page, "/datasets/sample/batches")["items"]
        friday = next(one["id"] for one in batches if one["name"] == "Friday")
        given = read(page, f"/batches/{friday}/groups")["items"]
        first, second = (one["group"] for one in given[:2])
        judged(crew.log_in("bob"), first, "rejected", reason="bad_calibration")
        carl = crew.log_in("carl")
        sent(carl, "PUT", f"/batches/{friday}/groups/{second}/lease", {"take_over": False})
        sent(carl, "PUT", f"/batches/{friday}/groups/{second}/submission")
        # From then on its annotators do not see the groups themselves.
        page.reload()
        carry_out(page, gold, {})
        page.goto("/work")
        self.shows_how_far_they_are(page)
        for row in BATCHES:
            batches = read(page, "/datasets/sample/batches")["items"]
            carry_out(page, row, {one["name"]: one["id"] for one in batches})

    def shows_how_far_they_are(self, page: Page) -> None:
        items = read(page, "/datasets/1/team-work")["items"]
        assert {one["batch"]["name"] for one in items} == {"Everything", "Friday", "Twice"}
        for one in items:
            batch = one["batch"]
            item = page.locator(f"{TEAM} .work__item")
            item = item.filter(has=page.get_by_role("link", name=batch["name"], exact=True))
            handed = batch["submitted"] and batch["annotators"] and batch["verdicts"] == 1
            words = [
                f"{batch['settled']} of {batch['groups']} groups done",
                f"{batch['submitted']} submitted" if handed else "",
                f"{batch['waiting']} open",
            ]
            expect(item).to_contain_text(" · ".join(filter(None, words)))
            if one["gold_every"]:
                expect(item).to_contain_text(f"one gold group in {one['gold_every']}")
            if batch["due"]:
                expect(item).to_contain_text("due 20 May 2040")
            if batch["name"] == "Friday":
                assert (batch["settled"], batch["submitted"], batch["waiting"]) == (1, 1, 1)
                assert [pace["name"] for pace in one["people"]] == ["bob", "carl"]
            for pace in one["people"]:
                line = item.get_by_role("row").filter(has_text=pace["name"])
                numbers = [str(pace["submitted"]), str(pace["judged"]), fixed(pace["minutes"], 0)]
                numbers += [fixed(pace["minutes_a_group"], 1), fixed(pace["groups_an_hour"], 0)]
                expect(line.get_by_role("cell")).to_have_text(numbers)
        for mine in read(page, "/work")["items"]:
            left, name = mine["left"], mine["batch"]["name"]
            groups = f"{left} group{'' if left == 1 else 's'}"
            go_on = page.get_by_role("button", name=f"Continue: {groups} of {name}", exact=True)
            expect(go_on).to_have_count(1 if left else 0)


TEXT = "Policy as YAML"


class TestPolicy:
    def test_a_policy_leaves_as_it_is_chosen_or_written_and_its_values_are_listed(
        self, open_page: OpenPage, crew: Crew, tmp_path: Path
    ) -> None:
        page = open_as(open_page, crew.log_in("dora"), "/datasets/sample/policy")
        self.shows_what_is_in_force(page, "paper")
        before = read(page, "/datasets/1/policy")
        text = page.get_by_label(TEXT)
        other = before["yaml"].replace("min_jac: 0.75", "min_jac: 0.8")
        other = other.replace("name: paper", "name: mine")

        text.fill(other)
        press("Reset")(page)
        expect(text).to_have_value(before["yaml"])
        with page.expect_download() as download:
            press("Download")(page)
        assert download.value.suggested_filename == "sample-policy.yaml"
        assert download.value.path().read_text() == before["yaml"]
        file = tmp_path / "other.yaml"
        file.write_text(other)
        page.locator("input[type=file]").set_input_files(file)
        expect(text).to_have_value(other)
        written = Row(
            "saves what stands in the file",
            [press("Save and solve")],
            {"PUT /datasets/1/policy": {"yaml": other}},
            tagged="/datasets/1/policy",
        )
        carry_out(page, written, {})
        expect(page.locator(".job .pill")).to_have_text("done")
        assert read(page, "/datasets/1/policy")["values"]["min_jac"] == 0.8
        for name in ("strict", "paper"):
            chosen = Row(
                f"uses {name}",
                [press(f"Use {name}")],
                {"PUT /datasets/1/policy": {"name": name}},
                tagged="/datasets/1/policy",
            )
            carry_out(page, chosen, {})
            self.shows_what_is_in_force(page, name)

    def shows_what_is_in_force(self, page: Page, name: str) -> None:
        jobs_end(page)
        policy = read(page, "/datasets/1/policy")
        assert policy["name"] == name
        title = page.locator("#values-title")
        expect(title).to_contain_text(f"{name}, version {policy['version']} {policy['hash']}")
        expect(
            page.locator("section[aria-labelledby=shipped-title] tr", has_text=name)
        ).to_contain_text("in force")
        inner = {f"calibration.{key}": one for key, one in policy["values"]["calibration"].items()}
        values = {**policy["values"], **inner}
        fields = read(page, "/policies")["fields"]
        lines = page.locator("section[aria-labelledby=values-title] tr")
        shown = [line.split("\t") for line in lines.all_inner_texts()]
        assert shown == [
            [one["label"], value_text(values[one["name"]], one["unit"])] for one in fields
        ]
        past = page.locator("section[aria-labelledby=history-title] tbody tr")
        rows = [
            [str(one["version"]), one["name"], one["hash"][:12], one["actor"]]
            for one in reversed(policy["history"])
        ]
        expect(past).to_have_count(len(rows))
        cells = [line.split("\t") for line in past.all_inner_texts()]
        assert [[*line[:3], line[4]] for line in cells] == rows


def value_text(value: Json, unit: str) -> str:
    """A threshold as the page has it."""
    if value is None:
        return "not set"
    if isinstance(value, bool):
        text = "yes" if value else "no"
    else:
        text = f"{value:g}" if isinstance(value, float) else str(value)
    return f"{text} {'' if unit == 'share' else unit}".strip()

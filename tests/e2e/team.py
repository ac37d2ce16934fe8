"""A team at its server, as browser tests meet it: people, logging in, what is said in between."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

from playwright.sync_api import Page, expect

from app.config import Settings
from app.db.store import Store
from app.features.agreement.service import compare_or_adopt_submission
from app.features.groups.edit import make_set_ball_edit
from app.features.groups.submit import load_group_state, submit_edit
from app.features.independent_annotations.service import begin_annotation
from app.features.people import links
from app.features.people.roles import Role
from app.features.people.service import find_person, give_role, invite
from app.features.verdicts.service import set_verdict

OpenPage = Callable[..., Page]
SECRET = "three plain words"
REFUSED = "the server responded with a status of 401"


def in_store(home: Path, work: Callable[[Store], Any]) -> Any:
    """Do something in the database, as a command beside the server does."""
    with closing(Store.open(Settings(home=home))) as store:
        return work(store)


def join(home: Path, name: str, role: Role) -> None:
    """Somebody who has an account and a password."""

    def come(store: Store) -> None:
        _, link = invite(store, name, role, actor="local")
        links.set_password_by_link(store, link.token, SECRET)

    in_store(home, come)


def log_in(page: Page, name: str) -> None:
    # By id: the page that is left may have fields of these names, too.
    page.locator("#login-name").fill(name)
    page.locator("#login-password").fill(SECRET)
    page.locator("#login-password").press("Enter")


def log_out(page: Page) -> None:
    """Log out, and wait for the page that comes then: the one before may still take keys."""
    page.get_by_role("button", name="Log out", exact=True).click()
    expect(page.get_by_role("heading", name="Log in")).to_be_visible()


def give(store: Store, name: str, role: Role) -> None:
    give_role(store, 1, find_person(store, name).id, role, actor="local")


def verdict(page: Page, group: int = 1) -> Any:
    """The last word on a group, as history has it."""
    entries = page.request.get(f"/api/v1/groups/{group}/history").json()["items"]
    last = [entry for entry in entries if entry["kind"] == "verdict"]
    return (
        {"state": last[-1]["body"]["state"], "by": last[-1]["actor"]} if last else {"state": None}
    )


def annotate(store: Store, group: int, person: str, moved: float) -> str | None:
    """Hand in what a person made of a group; its ball moved by so many pixels."""
    copy = begin_annotation(store, group, person=person).group
    state = load_group_state(store, copy)
    view = next(view for view in state.group.views if view.ball and view.ball.box)
    if moved and view.ball and view.ball.box:
        ball = replace(view.ball, box=replace(view.ball.box, x=view.ball.box.x + moved))
        state = submit_edit(
            store, copy, make_set_ball_edit(view.key, ball), if_match=state.etag, actor=person
        )
    set_verdict(store, copy, "accepted", None, "seen", if_match=state.etag, actor=person)
    return compare_or_adopt_submission(store, copy)

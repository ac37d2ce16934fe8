"""Commands on accounts: invite people, list them, disable them, give them another role or password."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.commands.opened import opened_store
from app.commands.options import Json, acting, read_settings
from app.commands.terminal import print_json, print_values, say

if TYPE_CHECKING:
    from app.review.people.links import Link
    from app.review.people.people import Person
    from app.review.people.roles import Role

commands = typer.Typer(help="Who may log in to the server of a team.", no_args_is_help=True)

Name = Annotated[str, typer.Argument(help="Name of the person.")]


def _role(said: str) -> Role:
    from app.review.people.roles import Role

    try:
        return Role(said.strip().lower())
    except ValueError:
        known = ", ".join(Role)
        raise typer.BadParameter(f'"{said}" is no role; there are {known}') from None


@commands.command()
def add(
    name: Name,
    role: Annotated[
        str, typer.Option(help="viewer, annotator, reviewer, lead or admin.")
    ] = "reviewer",
    json_: Json = False,
) -> None:
    """Make an account, and print the link with which its person chooses a password."""
    from app.review.people.people import invite

    wanted = _role(role)
    with opened_store() as store:
        person, link = invite(store, name, wanted, actor=acting())
    _print_link(person, link, json_)


@commands.command("list")
def list_(json_: Json = False) -> None:
    """List everybody with an account."""
    from app.review.people.people import list_people

    with opened_store() as store:
        found = [_values(person) for person in list_people(store)]
    if json_:
        print_json(found)
        return
    for value in found:
        say(f"{value['name']:40} {value['role']:10} {value['state']:12} {value['seen'] or ''}")


@commands.command()
def disable(name: Name, json_: Json = False) -> None:
    """Let somebody in no more, and log them out everywhere; what they did stays."""
    _change(name, json_, disabled=True)


@commands.command()
def enable(name: Name, json_: Json = False) -> None:
    """Let somebody in again, with the password that they had."""
    _change(name, json_, disabled=False)


@commands.command()
def role(
    name: Name,
    role: Annotated[str, typer.Argument(help="viewer, annotator, reviewer, lead or admin.")],
    json_: Json = False,
) -> None:
    """Give somebody another role."""
    _change(name, json_, role=_role(role))


@commands.command()
def reset(name: Name, json_: Json = False) -> None:
    """Print a link with which somebody chooses another password; it logs them out when it is used."""
    from app.review.people.people import find_person, renew_link

    with opened_store() as store:
        person, link = renew_link(store, find_person(store, name).id, actor=acting())
    _print_link(person, link, json_)


def _change(name: str, json_: bool, **change: Any) -> None:
    from app.review.people.people import change_person, find_person

    with opened_store() as store:
        found = find_person(store, name)
        person = change_person(store, found.id, actor=acting(), **change)
    print_values(_values(person), json_)


def _values(person: Person) -> dict[str, Any]:
    waits = "invited" if person.invited else "without link"
    state = "disabled" if person.disabled else "active" if person.joined else waits
    return {"name": person.name, "role": str(person.role), "state": state, "seen": person.seen}


def _print_link(person: Person, link: Link, json_: bool) -> None:
    settings = read_settings()
    base = settings.url or f"http://{settings.host}:{settings.port}"
    values = {"name": person.name, "role": str(person.role)}
    print_values({**values, "link": link.address(base), "expires": link.expires}, json_)

"""Commands on accounts: invite people, list them, disable them, give them another role or password."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from app.errors import InputError
from app.terminal.options import Json, get_current_actor, read_settings
from app.terminal.server import open_store
from app.terminal.terminal import print_error, print_json, print_values, say

if TYPE_CHECKING:
    from app.features.people.access_tokens import AccessToken
    from app.features.people.invitations import InvitationOutcome, LinkMailer
    from app.features.people.roles import Role
    from app.features.people.service import Person

commands = typer.Typer(help="Who may log in to the server of a team.", no_args_is_help=True)

Name = Annotated[str, typer.Argument(help="Name of the person.")]
Email = Annotated[str | None, typer.Option(metavar="ADDRESS", help="Send the link there by mail.")]
Dataset = Annotated[str, typer.Argument(help="Name or id of the dataset.")]


def _parse_role(text: str) -> Role:
    from app.features.people.roles import Role

    try:
        return Role(text.strip().lower())
    except ValueError:
        known = ", ".join(Role)
        raise typer.BadParameter(f'"{text}" is not a role; the roles are {known}') from None


@commands.command()
def add(
    name: Name,
    role: Annotated[
        str, typer.Option(help="none, viewer, annotator, reviewer, lead or admin.")
    ] = "reviewer",
    email: Email = None,
    json_: Json = False,
) -> None:
    """Make an account, and print or mail the link with which its person chooses a password."""
    from app.features.people.invitations import invite_person

    wanted, post = _parse_role(role), _make_mailer()
    with open_store(may_create=True) as store:
        _, row = invite_person(store, name, wanted, email, post, actor=get_current_actor())
    _print_link(row, json_)


@commands.command("invite-many")
def invite_many(
    file: Annotated[
        typer.FileText,
        typer.Argument(help="A line of name,role,email for each person; - reads standard input."),
    ],
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Only report what would happen.")
    ] = False,
    json_: Json = False,
) -> None:
    """Make many accounts at once; mail or print each link. 1 if a row was refused."""
    from app.features.people.invitations import invite_many as invite
    from app.features.people.invitations import parse_invitation_list

    try:
        text = file.read()
    except UnicodeDecodeError as error:
        raise InputError(f"{file.name} is not UTF-8 text", hint="Save it as CSV UTF-8.") from error
    rows, post = parse_invitation_list(text), _make_mailer()
    with open_store(may_create=True) as store:
        report = invite(store, rows, post, actor=get_current_actor(), dry_run=dry_run)
    refused = sum(row.state == "refused" for row in report)
    if json_:
        print_json([vars(row) for row in report])
    else:
        for row in report:
            details = [row.link, "link sent by mail" if row.mailed else None, row.problem]
            more = "; ".join(part for part in details if part)
            say(f"row {row.row:<4} {row.name:24} {row.role:10} {row.state:9} {more}".rstrip())
        say(f"{len(report) - refused} {'possible' if dry_run else 'invited'}, {refused} refused")
    if refused:
        raise typer.Exit(1)


def _make_mailer() -> LinkMailer:
    from app.db.locks import read_server_address
    from app.features.people.invitations import LinkMailer
    from app.mail import read_mail_server

    settings = read_settings()
    base = settings.url or read_server_address(settings)
    if base is None:
        base = f"http://{settings.host}:{settings.port}"
        print_error(
            f"no server of this home is running; the address {base} in links is assumed",
            "Set TOUCHLINE_URL to the address that people open.",
        )
    return LinkMailer(read_mail_server(settings), settings.url, base)


@commands.command("list")
def list_(json_: Json = False) -> None:
    """List everybody with an account."""
    from app.features.people.service import list_people

    with open_store() as store:
        found = [_person_to_dict(person) for person in list_people(store)]
    if json_:
        print_json(found)
        return
    for value in found:
        single = ", ".join(f"{one}: {role}" for one, role in value.get("datasets", {}).items())
        seen = value["seen"] or ""
        more = ", ".join(part for part in (value.get("sign_on"), single) if part)
        say(f"{value['name']:40} {value['role']:10} {value['state']:12} {seen:33} {more}".rstrip())


@commands.command()
def disable(name: Name, json_: Json = False) -> None:
    """Stop letting somebody in, and log them out everywhere; what they did stays."""
    _change_person(name, json_, disabled=True)


@commands.command()
def enable(name: Name, json_: Json = False) -> None:
    """Let somebody in again, with the password that they had."""
    _change_person(name, json_, disabled=False)


@commands.command()
def role(
    name: Name,
    role: Annotated[str, typer.Argument(help="none, viewer, annotator, reviewer, lead or admin.")],
    json_: Json = False,
) -> None:
    """Give somebody another role, in every dataset in which they have none of their own."""
    _change_person(name, json_, role=_parse_role(role))


@commands.command()
def grant(
    name: Name,
    dataset: Dataset,
    role: Annotated[
        str, typer.Argument(help="none (sees nothing of it), viewer, annotator, reviewer or lead.")
    ],
    json_: Json = False,
) -> None:
    """Give somebody a role in one dataset, in place of what they are in all of them."""
    _give_role(name, dataset, _parse_role(role), json_)


@commands.command()
def take(name: Name, dataset: Dataset, json_: Json = False) -> None:
    """Take somebody's role in one dataset: what they are in all of them counts there again."""
    _give_role(name, dataset, None, json_)


@commands.command()
def adopt(name: Name, json_: Json = False) -> None:
    """Show what was done before there were accounts as somebody's; once. The log keeps its names."""
    from app.features.audit.service import assign_local_work as give
    from app.features.people.service import find_person

    with open_store() as store:
        found = give(store, find_person(store, name).id, actor=get_current_actor())
    print_values({"name": found, "shown as theirs": "what was done until now as local"}, json_)


@commands.command()
def reset(
    name: Name,
    second_factor: Annotated[
        bool, typer.Option("--second-factor", help="Take away their second factor, too.")
    ] = False,
    email: Email = None,
    json_: Json = False,
) -> None:
    """Print or mail a link with which somebody chooses another password; using it logs them out."""
    from app.features.people.invitations import renew_invitation
    from app.features.people.second_factor import SecondFactors
    from app.features.people.service import find_person

    post = _make_mailer()
    with open_store() as store:
        found = find_person(store, name)
        if second_factor:
            SecondFactors(store).clear(found.id, actor=get_current_actor())
        _, row = renew_invitation(store, found.id, email, post, actor=get_current_actor())
    _print_link(row, json_)


@commands.command()
def unlink(name: Name, json_: Json = False) -> None:
    """Take away the account of the provider by which somebody comes in, and end those sessions."""
    from app.features.people.service import find_person
    from app.features.people.sign_on_rules import unlink_person

    with open_store() as store:
        found = find_person(store, name)
        unlink_person(store, found.id, actor=get_current_actor())
        person = find_person(store, name)
    print_values(_person_to_dict(person), json_)


def _give_role(name: str, dataset: str, role: Role | None, json_: bool) -> None:
    from app.features.people.service import find_person, give_role

    with open_store() as store:
        found = find_person(store, name)
        one = give_role(store, dataset, found.id, role, actor=get_current_actor())
    print_values({"name": one.name, "dataset": dataset, "role": str(one.role)}, json_)


@commands.command("require-second-factor")
def require_second_factor(
    switch: Annotated[Literal["on", "off"], typer.Argument(metavar="on|off")], json_: Json = False
) -> None:
    """Let everybody need a second factor: whoever has none makes one before anything else."""
    from app.features.people.second_factor import SecondFactors

    with open_store() as store:
        SecondFactors(store).set_required(switch == "on", actor=get_current_actor())
    print_values({"second_factor_required": switch == "on"}, json_)


@commands.command()
def tokens(
    name: Annotated[
        str | None, typer.Argument(help="Of this person; default: everybody's.")
    ] = None,
    end: Annotated[int | None, typer.Option(metavar="ID", help="End the token of this id.")] = None,
    json_: Json = False,
) -> None:
    """List the tokens with which scripts ask, or end one; they are made in the browser."""
    from app.features.people.access_tokens import AccessTokens
    from app.features.people.service import find_person

    with open_store() as store:
        access_tokens = AccessTokens(store)
        person = None if name is None else find_person(store, name).id
        found = (
            access_tokens.list_of_person(person)
            if end is None
            else [access_tokens.end(end, person, actor=get_current_actor())]
        )
    _print_tokens(found, json_, ended=end is not None)


def _print_tokens(found: list[AccessToken], json_: bool, *, ended: bool) -> None:
    state = ["expired" if one.expired else "ended" if ended else "good" for one in found]
    if json_:
        print_json([{**vars(one), "state": word} for one, word in zip(found, state, strict=True)])
        return
    for one, word in zip(found, state, strict=True):
        where = one.dataset or "all datasets"
        say(
            f"{one.id:4} {one.person:20} {one.name:24} {one.start}...  {','.join(one.scopes):24} "
            f"{where}, {word}, until {one.expires[:10]}, used {(one.used or 'never')[:10]}"
        )


def _change_person(name: str, json_: bool, **change: Any) -> None:
    from app.features.people.service import change_person, find_person

    with open_store() as store:
        found = find_person(store, name)
        person = change_person(store, found.id, actor=get_current_actor(), **change)
    print_values(_person_to_dict(person), json_)


def _person_to_dict(person: Person) -> dict[str, Any]:
    datasets = {one.dataset: str(one.role) for one in person.datasets}
    values = {
        "name": person.name,
        "role": str(person.role),
        "state": person.state,
        "seen": person.seen,
    }
    linked = {"sign_on": person.sign_on} if person.sign_on else {}
    return values | linked | ({"datasets": datasets} if datasets else {})


def _print_link(row: InvitationOutcome, json_: bool) -> None:
    values = {key: value for key, value in vars(row).items() if key not in ("row", "state")}
    print_values({key: value for key, value in values.items() if value not in (None, False)}, json_)

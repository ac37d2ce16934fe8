"""Policies: the one of a dataset and those before it, and policies as text, both ways."""

from __future__ import annotations

import math
import re
from collections.abc import Hashable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Any

import yaml

from app.db.json_columns import Json
from app.db.session import Session
from app.db.store import Store
from app.errors import InputError
from app.features.datasets.service import read_dataset_head, save_policy
from app.features.groups.state import require_etag
from app.features.policies.queries import PolicyVersion, read_policy_history
from app.soccer.codec import digest_json
from app.soccer.group import Group
from app.soccer.policy import (
    CALIBRATION,
    ESTIMATED,
    FIXED,
    LINE_SIGMAS,
    PAPER,
    POLICIES,
    SIGMAS,
    TOUCHLINE,
    Policy,
    copy_click_sigmas,
    is_builtin_policy,
)
from app.soccer.thresholds import THRESHOLDS, Threshold

LEAST_SHARE = 0.5
"""Of the views whose paint could place their camera, so many must have a picture."""
MAX_CHARACTERS = 20_000
MAX_DEPTH = 4
CUSTOM = "custom"
"""Name of a policy that has none."""
_BY_NAME = {threshold.name: threshold for threshold in THRESHOLDS}
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9 ._+-]{0,79}")


@dataclass(frozen=True)
class PolicyState:
    """What judges a dataset now; ``history`` is oldest first and ends with it."""

    dataset_id: int
    dataset: str
    policy: Policy
    history: tuple[PolicyVersion, ...]

    @property
    def version(self) -> int:
        """How many policies there have been."""
        return len(self.history)

    @property
    def etag(self) -> str:
        """Quoted, for ETag and If-Match."""
        return (
            f'"{digest_json([self.dataset_id, self.version, self.policy.name, self.policy.hash])}"'
        )


def read_policy(store: Store, dataset: str | int) -> PolicyState:
    """The policy of a dataset and its history.

    Raises:
        NotFoundError: There is no such dataset.
    """
    with store.read() as session:
        return _read_policy_state(session, dataset)


def change_policy(
    store: Store, dataset: str | int, policy: Policy, *, if_match: str | None, actor: str
) -> PolicyState:
    """Judge a dataset by another policy; what that leaves without a solution is stale.

    The same policy again changes nothing. Calibrations are known wherever the calibration part
    of the policy is.

    Args:
        store: The database.
        dataset: Name or id.
        policy: The policy.
        if_match: ETag of the policy that the change builds on; None: whatever it is.
        actor: Who wants it.

    Raises:
        NotFoundError: There is no such dataset.
        StaleRevisionError: It was changed meanwhile.
    """
    with store.write() as session:
        return apply_policy(session, dataset, policy, if_match=if_match, actor=actor)


def apply_policy(
    session: Session, dataset: str | int, policy: Policy, *, if_match: str | None, actor: str
) -> PolicyState:
    """``change_policy`` within a write session."""
    state = require_policy_etag(session, dataset, if_match)
    if policy.noise == state.policy.noise == ESTIMATED:
        # What was estimated is the dataset's: it stays until the next solve.
        policy = copy_click_sigmas(policy, state.policy)
    if policy == state.policy:
        return state
    save_policy(session, state.dataset_id, policy, actor)
    return _read_policy_state(session, state.dataset_id)


def require_policy_etag(session: Session, dataset: str | int, if_match: str | None) -> PolicyState:
    """The policy of a dataset; raises StaleRevisionError where it is not that of an ETag, if given."""
    state = _read_policy_state(session, dataset)
    if if_match is not None:
        require_etag(state.etag, if_match, f'the policy of "{state.dataset}"')
    return state


def _read_policy_state(session: Session, dataset: str | int) -> PolicyState:
    found = read_dataset_head(session, dataset)
    return PolicyState(found.id, found.name, found.policy, read_policy_history(session, found.id))


def choose_first_policy(groups: Iterable[Group]) -> Policy:
    """``touchline`` where most cameras can be drawn onto the paint of their pictures, else ``paper``.

    Args:
        groups: Those with which the dataset begins.
    """
    views = [view for group in groups for view in group.views if view.can_use_paint]
    pictures = sum(view.media is not None for view in views)
    return TOUCHLINE if pictures > LEAST_SHARE * len(views) else PAPER


def policy_from_yaml(text: str) -> Policy:
    """The policy that a YAML text describes; thresholds that it does not name are those of
    the shipped policy of its name, else as in ``paper``.

    Raises:
        InputError: It is no plain YAML, or a field is unknown or impossible; ``pointer`` says
            which one.
    """
    if len(text) > MAX_CHARACTERS:
        raise InputError(f"a policy has at most {MAX_CHARACTERS} characters")
    try:
        value = yaml.load(text, _PlainLoader)
    except (yaml.YAMLError, ValueError) as error:
        # ValueError: a scalar that looks like a date and is none.
        raise InputError(f"this is not a policy in YAML: {_describe_yaml_error(error)}") from error
    except RecursionError as error:
        raise InputError("this is not a policy in YAML: it is nested too deeply") from error
    if not isinstance(value, dict):
        raise InputError("a policy in YAML consists of lines `name: value`")
    name = value.pop("name", CUSTOM)
    return replace_thresholds(POLICIES.get(str(name), PAPER), value, name=name)


def unknown_policy_error(name: str, otherwise: str, *, pointer: str | None = None) -> InputError:
    """What to say of a name that no shipped policy has; ``otherwise``: what else it is not."""
    nearest = get_close_matches(name.lower(), POLICIES, n=1)
    meant = f"did you mean {nearest[0]}?" if nearest else f"there are {', '.join(POLICIES)}"
    return InputError(
        f'there is no policy "{name}", and {otherwise}; {meant}',
        hint="To make a policy of your own, send its thresholds.",
        pointer=pointer,
    )


def policy_to_yaml(policy: Policy) -> str:
    """A policy as YAML with every threshold, each with a comment that says what it is."""
    lines = [f"name: {_yaml_scalar(policy.name)}", ""]
    inner = [""]
    for threshold in THRESHOLDS:
        name = threshold.name.removeprefix(f"{CALIBRATION}.")
        line = f"{name}: {_yaml_scalar(threshold.value(policy))}"
        if name == threshold.name:
            lines.append(f"{line:30}  # {threshold.label_with_unit}")
        else:
            inner.append(f"  {line:28}  # {threshold.label_with_unit}")
    return "\n".join([*lines, "", f"{CALIBRATION}:", *inner[1:], ""])


def policy_to_values(policy: Policy) -> dict[str, Json]:
    """Every threshold by name; those of the calibration's part in a mapping of their own."""
    values: dict[str, Json] = {CALIBRATION: {}}
    for threshold in THRESHOLDS:
        inner = threshold.name.removeprefix(f"{CALIBRATION}.")
        place = values if inner == threshold.name else values[CALIBRATION]
        place[inner] = threshold.value(policy)
    return values


def replace_thresholds(
    policy: Policy, values: Mapping[str, Any], *, name: object = None, pointer: str = ""
) -> Policy:
    """A policy with other thresholds and, where one is given, another name.

    Args:
        policy: What is not named stays as it is here.
        values: Thresholds by name, those of the calibration's part nested or dotted.
        name: Of the new policy; a shipped policy's name belongs to its values.
        pointer: Where the values stand in the request, for errors.

    Raises:
        InputError: Unknown or impossible.
    """
    flat = dict(_flatten_values(values, pointer))
    for key, value in flat.items():
        flat[key] = _check_threshold(_BY_NAME[key], value, pointer)
    if "noise" not in flat and any(
        flat.get(key, there) != there for key, there in _list_noise_thresholds(policy)
    ):
        # Who says a number means it: no estimate takes its place.
        flat["noise"] = FIXED
    inner = {key.partition(".")[2]: flat.pop(key) for key in list(flat) if "." in key}
    calibration = replace(policy.calibration, **inner)
    chosen = policy.name if name is None else _validate_policy_name(name)
    changed = replace(policy, **{**flat, CALIBRATION: calibration, "name": chosen})
    _require_unchanged_shipped_policy(changed)
    return changed


def _list_noise_thresholds(policy: Policy) -> Iterator[tuple[str, float | None]]:
    """The noise of a policy by name."""
    for name in (*SIGMAS, *(f"{CALIBRATION}.{name}" for name in LINE_SIGMAS)):
        yield name, _BY_NAME[name].value(policy)


def _flatten_values(values: Mapping[str, Any], pointer: str) -> Iterator[tuple[str, Any]]:
    for key, value in values.items():
        if key == CALIBRATION:
            if not isinstance(value, dict):
                raise InputError(
                    f"{CALIBRATION} must be a mapping of thresholds",
                    pointer=f"{pointer}/{CALIBRATION}",
                )
            yield from _flatten_values(
                {f"{CALIBRATION}.{inner}": item for inner, item in value.items()}, pointer
            )
        elif key not in _BY_NAME:
            place = str(key).replace("~", "~0").replace("/", "~1").replace(".", "/")
            raise InputError(
                f'a policy has no threshold "{key}"',
                hint=f"It has {', '.join(_BY_NAME)}.",
                pointer=f"{pointer}/{place}",
            )
        else:
            yield key, value


def _check_threshold(
    threshold: Threshold, value: object, pointer: str
) -> float | bool | str | None:
    name, place = threshold.name, f"{pointer}/{threshold.name.replace('.', '/')}"
    if isinstance(threshold.default, bool):
        if not isinstance(value, bool):
            raise InputError(f"{name} must be true or false", pointer=place)
        return value
    if value is None and threshold.optional:
        return None
    if threshold.has_word_choices:
        if not isinstance(value, str) or value not in threshold.choices:
            raise InputError(f"{name} is {' or '.join(map(str, threshold.choices))}", pointer=place)
        return value
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not number or not math.isfinite(float(value)):  # type: ignore[arg-type]
        raise InputError(f"{name} must be a number", pointer=place)
    found = float(value)  # type: ignore[arg-type]
    low, high = threshold.minimum, threshold.maximum
    if (low is not None and found < low) or (high is not None and found > high):
        unit = f" {threshold.unit}" if threshold.unit else ""
        raise InputError(f"{name} must lie between {low:g} and {high:g}{unit}", pointer=place)
    return found


def _validate_policy_name(name: object) -> str:
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise InputError(
            "the name of a policy begins with a letter or digit and has 1 to 80 characters: A to Z, a to z, digits, spaces and . _ + -",
            pointer="/name",
        )
    return name


def _require_unchanged_shipped_policy(policy: Policy) -> None:
    """Refuse the name of a shipped policy for other values: readers of exports rely on it."""
    if policy.name in POLICIES and not is_builtin_policy(policy):
        raise InputError(
            f'"{policy.name}" is the name of a policy with other thresholds',
            hint="Choose another name for your policy.",
            pointer="/name",
        )


def _yaml_scalar(value: object) -> str:
    """A value as YAML; names are quoted where YAML would read something else."""
    text: str = yaml.safe_dump(value, allow_unicode=True, width=1000)
    return text.removesuffix("\n").removesuffix("...").strip()


def _describe_yaml_error(error: Exception) -> str:
    mark = getattr(error, "problem_mark", None)
    problem = str(getattr(error, "problem", None) or "it cannot be read")
    return problem if mark is None else f"line {mark.line + 1}: {problem}"


class _PlainLoader(yaml.SafeLoader):
    """Reads plain values alone: no references, no deep nests, no key twice."""

    def __init__(self, stream: str):
        super().__init__(stream)
        self._depth = 0

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        """The next node; an alias could make a small text a huge value."""
        if self.check_event(yaml.AliasEvent):
            raise self._make_error("references are not allowed")
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise self._make_error("it is nested too deeply")
        node: yaml.Node | None = super().compose_node(parent, index)
        self._depth -= 1
        return node

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        """A mapping; of a key that stands twice, nobody knows which one was meant."""
        seen = set()
        for key, _ in node.value:
            problem = None
            if not isinstance(key, yaml.ScalarNode):
                problem = "the name of a threshold must be text"
            elif key.value in seen:
                problem = f'"{key.value}" is given twice'
            if problem is not None:
                raise yaml.MarkedYAMLError(problem=problem, problem_mark=key.start_mark)
            seen.add(key.value)
        return super().construct_mapping(node, deep)

    def _make_error(self, problem: str) -> yaml.MarkedYAMLError:
        mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
        return yaml.MarkedYAMLError(problem=problem, problem_mark=mark)

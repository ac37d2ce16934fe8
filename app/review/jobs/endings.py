"""Endings: what a finished job says of itself, as a result and no longer as what is being done."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from app.plural import counted, plural
from app.review.exporting.formats import lacking
from app.store.stored_json import Json


def ending(kind: str, result: Json) -> str | None:
    """The sentence of a job that is done; None where its result says nothing that is known here."""
    tell = _ENDINGS.get(kind)
    try:
        return None if tell is None else tell(result)
    except (AttributeError, KeyError, TypeError):
        # The work is done, whatever can be said of it.
        return None


def _solved(result: Json) -> str:
    pitches = _estimated(result)
    if not result["solved"] and not result["failed"]:
        return pitches or "Nothing was left to solve."
    passed, rest = result["passed"], result["solved"] - result["passed"]
    return (
        f"{plural(result['solved'], 'group')} solved: {passed:,} pass, {rest:,} do not; "
        f"{plural(result['failed'], 'error')}." + (f" {pitches}" if pitches else "")
    )


def _estimated(result: Json) -> str:
    """What solving found of pitches, "" where it estimated none; results of older servers say nothing."""
    if not result.get("estimated"):
        return ""
    matches = plural(result["estimated"], "match", "matches")
    proposed = plural(result["proposed"], "match", "matches")
    found = (
        f"another size is proposed for {proposed}"
        if result["proposed"]
        else "no other size is proposed"
    )
    return f"The pitch of {matches} was estimated: {found}."


def _imported(result: Json) -> str:
    counts = {name: result.get(name, 0) for name in ("new", "changed", "unchanged")}
    would = " (dry run: nothing was changed)" if result.get("dry_run") else ""
    told = ", ".join(f"{count:,} {name}" for name, count in counts.items())
    left = len(result.get("skipped", ())) + result.get("more_skipped", 0)
    more = f"; {plural(left, 'record')} left out" if left else ""
    return f"{plural(sum(counts.values()), 'group')} read: {told}{more}{would}."


def _exported(result: Json) -> str:
    counts = result["counts"]
    told = ", ".join(counted(count, name) for name, count in counts.items())
    lacks = lacking(result.get("format", ""), counts)
    return f"Written: {told}." + ("" if lacks is None else f" {lacks}.")


def _frozen(result: Json) -> str:
    return f"Version {result['name']} holds {plural(result['counts']['groups'], 'group')}."


def _verified(result: Json) -> str:
    return str(result["sentence"])


def _evaluated(result: Json) -> str:
    return f"Evaluation {result['name']} is ready."


def _accepted(result: Json) -> str:
    refused = sum(result["refused"].values())
    more = f"; {plural(refused, 'view')} refused" if refused else ""
    groups = plural(result["groups"], "group")
    return f"{plural(result['changed'], 'view')} of {groups} have a ball from predictions{more}."


def _practice(result: Json) -> str:
    groups = plural(result["groups"], "practice group")
    return f"{groups} made." if result["made"] else f"The {groups} were there already."


def _rig(result: Json) -> str:
    cameras = plural(len(result["cameras"]), "camera")
    if result["accepted"] is None:
        return f"An adjustment of {cameras} is proposed."
    return f"The adjustment of {cameras} was accepted ({result['accepted']})."


def _positions(result: Json) -> str:
    shared, matches = result["shared"], plural(result["matches"], "match", "matches")
    return f"{plural(shared, 'picture')} of {matches} share the position of their camera."


def _painted(result: Json) -> str:
    return f"The paint of {plural(result['read'], 'picture')} was read."


def _proposed(result: Json) -> str:
    looked = result["proposed"] + result["unsure"] + result["nothing"]
    return (
        f"{plural(looked, 'view')} looked at: {result['proposed']:,} proposed, "
        f"{result['unsure']:,} unsure, {result['nothing']:,} without a proposal."
    )


def _pictures(result: Json) -> str:
    items = result["items"]
    proposed = sum(item["proposed"] is not None for item in items)
    matches = plural(len(items), "match", "matches")
    return f"{matches} estimated, {proposed:,} with a proposal."


_ENDINGS: Mapping[str, Callable[[Json], str]] = {
    "solve": _solved,
    "import": _imported,
    "export": _exported,
    "freeze": _frozen,
    "verify": _verified,
    "evaluate": _evaluated,
    "bulk": _accepted,
    "practice": _practice,
    "rig": _rig,
    "positions": _positions,
    "paint": _painted,
    "proposals": _proposed,
    "pictures": _pictures,
}
"""By the kind of the job."""

"""What a job that is done came to, in one sentence."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from app.db.json_columns import Json
from app.formats.export_formats import describe_missing_content
from app.wording import format_named_count, plural


def describe_result(kind: str, result: Json) -> str | None:
    """The sentence of a job that is done; None where its result says nothing that is known here."""
    tell = _ENDINGS.get(kind)
    try:
        return None if tell is None else tell(result)
    except (AttributeError, KeyError, TypeError):
        # The work is done, whatever can be said of it.
        return None


def _describe_solving(result: Json) -> str:
    pitches = _describe_pitch_estimates(result)
    if not result["solved"] and not result["failed"]:
        return pitches or "Nothing was left to solve."
    passed, rest = result["passed"], result["solved"] - result["passed"]
    gates = ", ".join(f"{gate} {count:,}" for gate, count in result.get("failing", {}).items())
    why = f" (first failing gate: {gates})" if gates else ""
    return (
        f"{plural(result['solved'], 'group')} solved: {passed:,} pass, {rest:,} do not{why}; "
        f"{plural(result['failed'], 'error')}."
        + (f" {pitches}" if pitches else "")
        + (f" {advice}" if (advice := result.get("advice")) else "")
    )


def _describe_pitch_estimates(result: Json) -> str:
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


def _describe_import(result: Json) -> str:
    counts = {name: result.get(name, 0) for name in ("new", "changed", "unchanged")}
    would = " (dry run: nothing was changed)" if result.get("dry_run") else ""
    counted_groups = ", ".join(f"{count:,} {name}" for name, count in counts.items())
    left = len(result.get("skipped", ())) + result.get("more_skipped", 0)
    more = f"; {plural(left, 'record')} left out" if left else ""
    return f"{plural(sum(counts.values()), 'group')} read: {counted_groups}{more}{would}."


def _describe_export(result: Json) -> str:
    counts = result["counts"]
    written = ", ".join(format_named_count(count, name) for name, count in counts.items())
    missing = describe_missing_content(result.get("format", ""), counts)
    return f"Written: {written}." + ("" if missing is None else f" {missing}.")


def _describe_version(result: Json) -> str:
    return f"Version {result['name']} holds {plural(result['counts']['groups'], 'group')}."


def _describe_verification(result: Json) -> str:
    return str(result["sentence"])


def _describe_evaluation(result: Json) -> str:
    return f"Evaluation {result['name']} is ready."


def _describe_acceptance(result: Json) -> str:
    refused = sum(result["refused"].values())
    more = f"; {plural(refused, 'view')} refused" if refused else ""
    groups = plural(result["groups"], "group")
    return f"{plural(result['changed'], 'view')} of {groups} have a ball from predictions{more}."


def _describe_practice(result: Json) -> str:
    if "recording" in result:
        made = "The practice recording"
        return f"{made} is made." if result["made"] else f"{made} already exists."
    groups = plural(result["groups"], "practice group")
    return f"{groups} made." if result["made"] else f"The {groups} already exist."


def _describe_rig_adjustment(result: Json) -> str:
    cameras = plural(len(result["cameras"]), "camera")
    if result["accepted"] is None:
        return f"An adjustment of {cameras} is proposed."
    return f"The adjustment of {cameras} was accepted ({result['accepted']})."


def _describe_shared_positions(result: Json) -> str:
    shared, matches = result["shared"], plural(result["matches"], "match", "matches")
    return f"{plural(shared, 'picture')} of {matches} share the position of their camera."


def _describe_paint_reading(result: Json) -> str:
    return f"The paint of {plural(result['read'], 'picture')} was read."


def _describe_line_proposals(result: Json) -> str:
    looked = result["proposed"] + result["unsure"] + result["nothing"]
    return (
        f"{plural(looked, 'view')} looked at: {result['proposed']:,} proposed, "
        f"{result['unsure']:,} unsure, {result['nothing']:,} without a proposal."
    )


def _describe_picture_estimates(result: Json) -> str:
    items = result["items"]
    proposed = sum(item["proposed"] is not None for item in items)
    matches = plural(len(items), "match", "matches")
    return f"{matches} estimated, {proposed:,} with a proposal."


def _describe_recording_index(result: Json) -> str:
    shots, frames = plural(result["shots"], "shot"), plural(result["frames"], "frame")
    return f"{result['name']} has {frames} in {shots}."


def _describe_instants(result: Json) -> str:
    there = f"; {result['unchanged']:,} were there before" if result["unchanged"] else ""
    changed, views, outside = (
        result.get(name, 0) for name in ("changed", "linked_views", "outside")
    )
    if changed:
        there += f"; {plural(changed, 'group')} {'would get' if result.get('dry_run') else 'got'} views of replays"
    if views or outside:
        there += f"; {plural(views, 'view')} of linked replays added, {outside:,} missing"
    would = "would be " if result.get("dry_run") else ""
    return f"{plural(result['new'], 'group')} {would}made of {result['name']}{there}."


def _describe_ball_tracking(result: Json) -> str:
    there = f"; {result['unchanged']:,} were up to date" if result["unchanged"] else ""
    count = len(result["without"])
    without = f"; {count:,} {'has' if count == 1 else 'have'} no track" if count else ""
    stretches = plural(result["made"], "stretch", "stretches")
    return f"The ball was tracked over {stretches}{there}{without}."


def _describe_camera_tracking(result: Json) -> str:
    counts = ", ".join(f"{result[name]:,} {name}" for name in ("tracked", "bridged", "lost"))
    given = f"; {plural(result['groups'], 'group')} got another camera" if result["groups"] else ""
    return f"{plural(result['frames'], 'frame')} of {result['name']}: {counts}{given}."


def _describe_link(result: Json) -> str:
    live, replay = result["rays"]
    seen = f"{live:,} rays of the live shot, {replay:,} of the replay"
    left = f", {result['left_out']:,} left out" if result["left_out"] else ""
    told = "The times were found" if result["reason"] is None else result["reason"].rstrip(".")
    return f"{told} ({seen}{left})."


_ENDINGS: Mapping[str, Callable[[Json], str]] = {
    "solve": _describe_solving,
    "import": _describe_import,
    "export": _describe_export,
    "freeze": _describe_version,
    "verify": _describe_verification,
    "evaluate": _describe_evaluation,
    "bulk": _describe_acceptance,
    "practice": _describe_practice,
    "rig": _describe_rig_adjustment,
    "positions": _describe_shared_positions,
    "paint": _describe_paint_reading,
    "proposals": _describe_line_proposals,
    "pictures": _describe_picture_estimates,
    "recording": _describe_recording_index,
    "instants": _describe_instants,
    "ball": _describe_ball_tracking,
    "track": _describe_camera_tracking,
    "link": _describe_link,
}
"""By the kind of the job."""
RESULT_KINDS = tuple(_ENDINGS)
"""Kinds of jobs whose result has a sentence."""

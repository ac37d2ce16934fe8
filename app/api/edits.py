"""From the bodies of requests to edits."""

from __future__ import annotations

from app.api.schemas.annotation import points_of
from app.api.schemas.preview import PreviewRequest, ViewPreview
from app.errors import InputError
from app.review.editing.edit import Edit, IncludeView, SetBall, SetLines, SetPicture
from app.soccer.group import Group


def preview_edits(group: Group, request: PreviewRequest) -> list[Edit]:
    """The edits that a what-if asks for, in the order of its views.

    Raises:
        InputError: The group has no such view.
    """
    edits: list[Edit] = []
    for key, change in request.views.items():
        if group.view(key) is None:
            raise InputError(
                f"the group has no view {key}",
                hint=f"Its views are {', '.join(view.key for view in group.views)}.",
                pointer=f"/views/{key.replace('~', '~0').replace('/', '~1')}",
            )
        edits.extend(_view_edits(key, change))
    return edits


def _view_edits(key: str, change: ViewPreview) -> list[Edit]:
    edits: list[Edit] = []
    if change.lines:
        edits.append(SetLines(key, points_of(change.lines)))
    if "ball" in change.model_fields_set:
        edits.append(SetBall(key, None if change.ball is None else change.ball.ball()))
    if change.included is not None:
        edits.append(IncludeView(key, change.included))
    if "picture" in change.model_fields_set:
        edits.append(SetPicture(key, None if change.picture is None else change.picture.picture()))
    return edits

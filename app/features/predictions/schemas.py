"""Predictions: what to read, what was read, and which of them a person accepts."""

from __future__ import annotations

from datetime import datetime
from operator import attrgetter
from typing import Annotated, Literal, Self

from pydantic import (
    AliasPath,
    BaseModel,
    BeforeValidator,
    Field,
    StrictBool,
    StrictInt,
    model_validator,
)

from app.features.predictions.accept import (
    SHOWN,
    AcceptPlan,
    AcceptReport,
    AcceptRequest,
    GroupPredictions,
)
from app.features.predictions.queries import PredictedBox, PredictionSet
from app.features.queue.query import MAX_LENGTH
from app.http.documents import Document, ListDocument, RequestBody
from app.json_text import MAX_ID
from app.soccer.choices import AnyPredictionFormat
from app.soccer.frames import MAX_SIDE, ImageSize

Upload = Annotated[str, Field(min_length=1, max_length=64, description="Id of an upload.")]
Side = Annotated[int, Field(strict=True, ge=2, le=MAX_SIDE)]
Size = tuple[Side, Side]
ViewId = Annotated[int, Field(strict=True, ge=1, le=MAX_ID)]
MAX_VIEWS = 200
StoredBox = Annotated[
    tuple[float, float, float, float],
    BeforeValidator(attrgetter("x", "y", "width", "height")),
]
"""As it was predicted: x, y of the top-left corner, width, height; whatever the file said."""


class PredictionFilesRequest(
    RequestBody, examples=[{"name": "yolo11l", "format": "coco", "upload": "9b2f0c6e5d7a4c18"}]
):
    """Files of predictions: ball boxes, cameras, or both."""

    name: Annotated[str, Field(min_length=1, max_length=100)] | None = Field(
        default=None,
        description="Name of the set; unique in its dataset. null: the set that came of the very "
        "same reading, where there is one; else a new one, named after its file.",
    )
    format: AnyPredictionFormat = Field(
        default="coco", description="`auto`: by the endings of the files."
    )
    upload: Upload | None = Field(
        default=None, description="Ball boxes; of the format `tracks`, `ball.csv` and `events.csv`."
    )
    images_upload: Upload | None = Field(
        default=None,
        description="The COCO document whose images the numbers in COCO results mean.",
    )
    cameras_upload: Upload | None = Field(
        default=None, description="A zip of SoccerNet camera JSON, or one such file."
    )
    category: Annotated[int, Field(strict=True, ge=0, le=100_000)] | None = Field(
        default=None, description="The class that is the ball, where the file has several."
    )
    size: Size | None = Field(
        default=None,
        description="Width and height of the images that boxes in pixels refer to; null: the "
        "annotated size of each frame.",
    )
    cameras_size: Size | None = Field(
        default=None,
        description="Width and height of the images of the cameras; null: the annotated size of "
        "each frame.",
    )

    @model_validator(mode="after")
    def _require_upload(self) -> PredictionFilesRequest:
        if self.upload is None and self.cameras_upload is None:
            raise ValueError("give an upload, a cameras_upload, or both")
        return self


class UnknownFrame(BaseModel):
    """A frame that a file names and the dataset does not have."""

    frame: str
    boxes: int
    problem: str


class PredictionProblem(BaseModel):
    """Something in a file that could not be read, with its place."""

    file: str
    record: str | None
    field: str | None
    problem: str


class PredictionReadingReport(BaseModel):
    """What reading the files met; lists are cut after 100 entries, counts are whole."""

    read: int = Field(default=0, description="Boxes that the file holds.")
    without_score: int = Field(default=0, description="Boxes without a score; they count as sure.")
    other_classes: int = 0
    unknown_boxes: int = 0
    unknown_frames: list[UnknownFrame] = []
    unknown_cameras: list[UnknownFrame] = []
    problems: list[PredictionProblem] = []
    more_problems: int = 0
    model: str | None = Field(default=None, description="SHA-256 of a detector's model.")


class PredictionSetDocument(Document):
    """A set of predictions."""

    id: int
    name: str
    format: Literal["coco", "yolo", "csv", "tracks", "cameras", "detect"]
    source: str
    created: datetime
    actor: str
    digest: str
    frames: int = Field(description="Frames with at least one box.")
    boxes: int
    cameras: int
    tracks: int = Field(description="Stretches over which the ball was predicted in 3D.")
    unknown: int = Field(description="Frames that the dataset does not have.")
    report: PredictionReadingReport


class PredictionSetList(ListDocument[PredictionSetDocument]):
    """The sets of a dataset, the newest first."""


class ViewPrediction(Document):
    """A ball that was predicted in a view: no annotation until a person accepts it."""

    id: int
    predictions: int = Field(description="Id of its set.")
    name: str = Field(description="Name of its set.")
    box: StoredBox
    score: float
    scored: bool = Field(description="`false`: its set came without scores, each counts as 1.")

    @classmethod
    def of(cls, found: PredictionSet, box: PredictedBox) -> Self:
        """The document of a box of a set."""
        return cls.model_validate(
            {
                **vars(box),
                "view": box.view_id,
                "predictions": found.id,
                "name": found.name,
                "box": box,
                "scored": not found.report.get("without_score"),
            }
        )


class ViewPredictions(ListDocument[ViewPrediction]):
    """What was predicted for a view, the newest set first, the surest box first."""


class GroupPrediction(ViewPrediction):
    """A ball that was predicted in one of a group's views."""

    view: int = Field(description="Id of the view.")


class AcceptedPrediction(Document):
    """Where a ball of the group comes from that a person took over from a prediction."""

    view: int = Field(validation_alias="view_id", description="Id of the view.")
    name: str = Field(description="Name of the set.")
    score: float | None = Field(description="As predicted; null where the set is gone.")
    by: str | None = Field(
        validation_alias="actor", description="Who accepted it; null where it was imported so."
    )
    at: datetime | None


class GroupPredictionsDocument(ListDocument[GroupPrediction]):
    """What was predicted for a group: by view, the newest set first, the surest box first."""

    sets: int = Field(description="Sets that the dataset has; 0: no group has predictions.")
    accepted: list[AcceptedPrediction]

    @staticmethod
    def of(found: GroupPredictions) -> GroupPredictionsDocument:
        """The document of a group's predictions."""
        items = [GroupPrediction.of(item, box) for item, box in found.boxes]
        return GroupPredictionsDocument(sets=found.sets, items=items, accepted=found.accepted)


class AcceptBody(
    RequestBody,
    examples=[
        {"dataset": "sample", "predictions": 3, "q": "gate:ball", "min_score": 0.5},
        {"dataset": "sample", "predictions": 3, "views": [31], "replace": True},
    ],
):
    """Which predictions become annotations: the surest one of each view."""

    dataset: Annotated[str, Field(max_length=200, description="Name or id.")]
    predictions: Annotated[int, Field(strict=True, ge=1, le=MAX_ID)]
    q: Annotated[str, Field(max_length=MAX_LENGTH)] | None = Field(
        default=None, description="Query of the queue that chooses groups; a job accepts them."
    )
    views: Annotated[list[ViewId], Field(min_length=1, max_length=MAX_VIEWS)] | None = Field(
        default=None, description="Ids of views; their predictions are accepted at once."
    )
    min_score: Annotated[float, Field(ge=0, le=1)] = 0.0
    replace: StrictBool = Field(
        default=False, description="Also where the view has another ball; else it is refused."
    )
    dry_run: StrictBool = False

    @model_validator(mode="after")
    def _require_query_or_views(self) -> AcceptBody:
        if (self.q is None) == (self.views is None):
            raise ValueError('give "q" or "views"; an empty "q" means every group')
        return self

    def to_accept_request(self) -> AcceptRequest:
        """The request as the review floor takes it."""
        views = None if self.views is None else tuple(self.views)
        return AcceptRequest(self.predictions, self.q, views, self.min_score, self.replace)


class ViewThatWouldGetBall(Document):
    """A view that would get a ball."""

    view: int = Field(validation_alias="view_id")
    key: str = Field(validation_alias="view")
    group: int = Field(validation_alias="group_id")
    group_key: str = Field(validation_alias="group")
    box: StoredBox
    score: float = Field(validation_alias=AliasPath("box", "score"))


class AcceptOutcome(Document):
    """What accepting does, or did.

    `refused` counts views by reason: `below_score`, `annotated`, `the_same`,
    `not_a_ball` (the prediction cannot be one in this image), `changed_meanwhile`.
    """

    dry_run: bool
    changed: StrictInt = Field(description="Views that get a ball.")
    groups: int
    refused: dict[str, int]
    sample: list[ViewThatWouldGetBall] = Field(description="The first views of a dry run.")

    @staticmethod
    def of_plan(plan: AcceptPlan) -> AcceptOutcome:
        """The document of a dry run."""
        return AcceptOutcome(
            dry_run=True,
            changed=len(plan.changes),
            groups=plan.group_count,
            refused=plan.refused,
            sample=plan.changes[:SHOWN],
        )

    @staticmethod
    def of_report(report: AcceptReport) -> AcceptOutcome:
        """The document of what was done."""
        return AcceptOutcome(
            dry_run=False,
            changed=report.views,
            groups=report.groups,
            refused=report.refused,
            sample=[],
        )


def parse_image_size(size: Size | None) -> ImageSize | None:
    """A size as a value."""
    return None if size is None else ImageSize(*size)

"""Documents of imports and uploads."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any

from pydantic import Field, StrictBool, model_validator

from app.features.imports.jobs import ImportRequest
from app.features.imports.uploads import FolderItem
from app.http.documents import Document, ListDocument, RequestBody
from app.soccer.choices import CalibrationChoice, ImportFormat, PolicyName
from app.soccer.frames import MAX_SIDE

Camera = Annotated[int, Field(ge=0, le=999)]
Offset = Annotated[int, Field(ge=-999_999, le=999_999)]
Side = Annotated[int, Field(ge=2, le=MAX_SIDE)]


class UploadOrFolder(RequestBody):
    """Where files are: exactly one of an upload and a folder, which may be `s3://NAME/...` in a store."""

    upload: Annotated[str, Field(pattern=r"^[0-9a-f]{32}$")] | None = None
    folder: Annotated[str, Field(min_length=1, max_length=4000)] | None = None

    @model_validator(mode="after")
    def _check_one_place(self) -> UploadOrFolder:
        if (self.upload is None) == (self.folder is None):
            raise ValueError("name an upload or a folder, and not both")
        return self

    def to_place_by_kind(self) -> dict[str, str]:
        """The place that was given, by its kind."""
        return {"upload": self.upload} if self.upload else {"folder": self.folder or ""}


class ImportOptions(RequestBody):
    """What the files do not say themselves."""

    calibration: CalibrationChoice | None = Field(
        default=None,
        description="Which calibration counts where a view has a given camera and lines; null: the "
        "given one. Of `issia` and `issia-3d`, `given` leaves the lines of given cameras aside, "
        "which otherwise measure them.",
    )
    frame_offset: Offset | dict[Camera, Offset] = Field(
        default=8, description="ISSIA: XGTF frame minus video frame, for all or by camera."
    )
    flipped: list[Camera] = Field(
        default=[], max_length=100, description="ISSIA: cameras whose videos are mirrored."
    )
    size: tuple[Side, Side] | None = Field(
        default=None,
        description="Width and height of the annotated images, where files lack it; of cameras: of the "
        "images that they were made for.",
    )
    ball_category: Annotated[str, Field(max_length=200)] = Field(
        default="",
        description="COCO: name or id of the category that is the ball; empty: by names such as "
        "ball, sports_ball and soccer-ball.",
    )
    grouping: Annotated[str, Field(max_length=200)] = Field(
        default="",
        description="frames: which pictures are one group: `folder`, or a pattern of their names such "
        "as `{instant}_{camera}.jpg`; empty: each picture is a group.",
    )
    propose: StrictBool = Field(
        default=True, description="frames: whether a job proposes cameras for them afterwards."
    )
    lines: UploadOrFolder | None = Field(
        default=None, description="ISSIA: line files of the static cameras."
    )
    frames: UploadOrFolder | None = Field(
        default=None,
        description="A JSON list of where frames lie in object stores, apart from the labels; it needs a "
        "lead of all datasets.",
    )


class ImportBody(
    RequestBody,
    examples=[
        {
            "dataset": "league",
            "format": "soccernet-v3",
            "source": {"folder": "soccernet/england_epl"},
            "dry_run": True,
        }
    ],
):
    """What to import."""

    dataset: Annotated[str, Field(min_length=1, max_length=200)]
    format: ImportFormat
    source: UploadOrFolder
    options: ImportOptions = ImportOptions()
    policy: PolicyName | None = Field(
        default=None,
        description=(
            "Policy of a new dataset; null: `touchline` if most views have a picture with enough "
            "paint to place the camera, else `paper`."
        ),
    )
    dry_run: StrictBool = Field(
        default=False, description="The same as the parameter: report, and save nothing."
    )

    def to_import_request(self, *, dry_run: bool = False) -> ImportRequest:
        """The import as the review floor takes it; options that were not given are left out."""
        options: dict[str, Any] = self.options.model_dump(
            mode="json", exclude_defaults=True, exclude={"lines", "frames"}
        )
        lines, frames = self.options.lines, self.options.frames
        return ImportRequest(
            self.dataset,
            self.format,
            self.source.to_place_by_kind(),
            None if lines is None else lines.to_place_by_kind(),
            options,
            dry_run or self.dry_run,
            self.policy,
            None if frames is None else frames.to_place_by_kind(),
        )


class FolderDocument(ListDocument[FolderItem]):
    """What is in a folder that the operator allows; without a path, the folders themselves."""

    path: str
    format: str | None = Field(description="Format that its files most likely have.")
    more: bool = Field(description="Whether there is more than is listed.")


class UploadDocument(Document):
    """An uploaded file."""

    id: str = Field(
        description="Digest of its name and content; of one that comes in parts, of what its sender "
        "says of it."
    )
    name: str
    bytes: int = Field(description="How many are here.")
    size: int = Field(
        validation_alias="whole_size",
        description="How many the file has; more than `bytes` until the last part has come.",
    )
    created: datetime
    kept: bool = Field(description="Whether a dataset reads frames from it; it then stays.")
    format: str | None = Field(description="Format that it most likely has.")


class UploadList(ListDocument[UploadDocument]):
    """Uploads, the newest first."""

    max_bytes: int = Field(description="Largest file that is taken.")
    days: int = Field(description="After so many days an upload expires.")
    used_bytes: int = Field(
        description="What one's own uploads have together, with those that are on their way."
    )
    quota_bytes: int | None = Field(
        description="What they may have together; null: there is no limit."
    )

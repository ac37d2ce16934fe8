"""Propose: a camera for a frame that nobody has annotated, or the reason why there is none.

The best cameras of the search are snapped onto the paint and ranked by how much of the visible
markings has paint (supported) times how much of the paint has a marking (explained). Of the two
cameras that the half turn of a pitch makes equal, the one with y > 0 is given: main cameras
stand there by convention.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from app.geometry.arrays import BoolArray
from app.geometry.camera import Camera
from app.paint.agreement import (
    PaintAgreement,
    measure_agreement,
    measure_agreement_with_clear_paint,
    measure_strength_near_markings,
)
from app.paint.candidates import MAIN, WIDE, CameraSearchSpace, make_search_space_of_known_cameras
from app.paint.evidence import PreparedPicture, prepare_picture
from app.paint.goal import measure_goal_height
from app.paint.grass import explain_missing_field, find_field_of_play
from app.paint.ranking import (
    MOST_UNCERTAIN_M,
    VISIBLE_PX,
    WELL_PAINTED,
    WINDOWS,
    WORK_WIDTH,
    FrameToSearch,
    Image,
    RankedCamera,
    measure_weakest_marking,
    merge_ranked_cameras,
    move_to_known_position,
    rank_cameras,
    snap_with_known_position,
)
from app.paint.ridges import Strength, find_straight_pieces, measure_line_strength
from app.paint.search import PictureToScore, get_kernel_executor
from app.paint.snap import SnappedCamera
from app.soccer.choices import ProposalOutcome
from app.soccer.frames import ImageSize
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.solving.observations import principal_point

SEARCH_VERSION = 5
"""Of the search and what decides: where nothing was proposed, a later one looks again."""
ENLARGED_WIDTH, ENLARGED = 640, 2
"""Narrower pictures are read so many times as large: their paint is hardly a pixel broad."""
LEAST_SIDE = 160
"""Pixels: in a smaller picture lines are narrower than a pixel."""
SHAPES = (1.29, 2.45)
"""Width by height of broadcast pictures, from 4:3 to the widest films."""
BORDER_PX = 4
"""At the border of a picture ridges are no paint."""
MOST_PIECES = 8
WELL_SUPPORTED = 0.75
"""Where less of the markings has paint, each that would be seen has to have it nearly whole."""
LEAST_SUPPORTED, LEAST_SCORE, LEAST_LEAD, LEAST_SUM = 0.50, 0.30, 0.06, 0.52
"""The less of the paint a camera explains, the farther all others have to lie behind it."""
LEAST_KNOWN = 0.25, 0.40
"""As the second and the last of the above where the match knows the position and most of the markings have paint."""
SOLE_LEAD = 0.15
"""What counts as lead where the search found no other camera."""
LAST_WINDOWS = (5.0, 3.0, 3.0)
CLOSER = 6
"""Cameras of an unsure frame that are looked at once more."""


@dataclass(frozen=True)
class FrameProposal:
    """What is proposed for a frame.

    Attributes:
        outcome: ``proposed``, ``unsure`` or ``nothing``.
        reason: Why nothing is proposed; None where something is.
        camera: The best camera, pixels of the frame; of an unsure one for looking at only.
        agreement: Of that camera with the paint.
        snapped: How that camera lies on the paint.
        runner_up: How much less supported x explained the next best camera has that shows
            something else; None where there is no other.
    """

    outcome: ProposalOutcome
    reason: str | None
    camera: Camera | None = None
    agreement: PaintAgreement | None = None
    snapped: SnappedCamera | None = None
    runner_up: float | None = None
    weakest: float | None = None


def propose_camera(
    image: Image,
    pitch: Pitch | None = None,
    known: Sequence[Camera] = (),
    policy: CalibrationPolicy | None = None,
) -> FrameProposal:
    """A camera for a frame.

    Args:
        image: Red green blue, shape (H, W, 3).
        pitch: The pitch.
        known: Cameras of other frames of the match: it is looked for at their positions, and with
            their lenses, first.
        policy: Prior of the distortion.
    """
    frame = resize_and_prepare_frame(image)
    if isinstance(frame, str):
        return FrameProposal("nothing", frame)
    return propose_for_frame(
        frame, image, pitch or Pitch(), known, policy or CalibrationPolicy(), (MAIN, WIDE)
    )


def propose_for_frame(
    frame: FrameToSearch,
    image: Image,
    pitch: Pitch,
    known: Sequence[Camera],
    policy: CalibrationPolicy,
    libraries: Sequence[CameraSearchSpace],
) -> FrameProposal:
    """As ``propose_camera``, for a frame that is read already.

    Args:
        frame: In the width in which it is searched.
        image: In its own size, red green blue, shape (H, W, 3).
        libraries: Where it is looked for after the positions of ``known``.
    """
    ranked: list[RankedCamera] = []
    match = make_search_space_of_known_cameras(known) if known else None
    for library in [*([match] if match else []), *libraries]:
        found = rank_cameras(frame, library, pitch, policy)
        if match is not None and library is not match:
            found = [move_to_known_position(frame, item, match, pitch) for item in found]
        ranked = merge_ranked_cameras(frame, ranked, found)
        if explain_uncertain_camera(ranked) is None:
            break
    else:
        closer = _rank_at_full_resolution(image, frame, ranked, pitch)
        if explain_uncertain_camera(closer) is None:
            return _choose_proposal(image, frame, closer, pitch)
    return _choose_proposal(image, frame, ranked, pitch)


def enlarge_small_picture(image: Image) -> Image:
    """A small picture as it is read."""
    cubic = cv2.INTER_CUBIC
    return np.asarray(cv2.resize(image, None, fx=ENLARGED, fy=ENLARGED, interpolation=cubic))


def explain_too_small_picture(image: Image) -> str | None:
    """Why no line can be followed in a picture of that size; None where lines can."""
    height, width = image.shape[:2]
    if min(height, width) >= LEAST_SIDE:
        return None
    return f"the picture is too small ({width} x {height} pixels): no line can be followed"


def resize_and_prepare_frame(image: Image) -> FrameToSearch | str:
    """A frame ready to be searched, or why there is nothing to search for."""
    if (small := explain_too_small_picture(image)) is not None:
        return small
    height, width = image.shape[:2]
    if width < ENLARGED_WIDTH:
        image = enlarge_small_picture(image)
    elif width > WORK_WIDTH:
        size = (WORK_WIDTH, max(round(height * WORK_WIDTH / width), 1))
        image = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA))
    field = find_field_of_play(image)
    reason = explain_missing_field(image, field)
    if reason is not None:
        return reason
    return prepare_frame_to_search(
        image, field, line_strength(image, field), prepare_picture(image, field)
    )


def prepare_frame_to_search(
    image: Image, field: BoolArray, strength: Strength, reading: PreparedPicture
) -> FrameToSearch | str:
    """A frame that is read, ready to be searched, or why there is nothing to search for.

    Args:
        image: In the width in which it is searched, red green blue, shape (H, W, 3).
        field: The field of play, shape (H, W).
        strength: As of ``line_strength``, shape (H, W).
        reading: Of the same image and field.
    """
    pieces = find_straight_pieces(strength > 0, MOST_PIECES)
    if not len(pieces):
        return "no straight line is seen on the grass"
    center = principal_point(ImageSize(image.shape[1], image.shape[0]))
    picture = PictureToScore.of(strength > 0, field, center)
    return FrameToSearch(image, field, strength, pieces, picture, reading)


def line_strength(image: Image, field: BoolArray) -> Strength:
    """Strength of what looks like paint, shape (H, W); at the border of a picture nothing does."""
    strength = measure_line_strength(image, field)
    for border in (slice(0, BORDER_PX), slice(-BORDER_PX, None)):
        strength[border] = strength[:, border] = 0.0
    return strength


def _rank_at_full_resolution(
    image: Image, frame: FrameToSearch, ranked: Sequence[RankedCamera], pitch: Pitch
) -> list[RankedCamera]:
    """The best cameras of a frame once more, in the picture's own size and by clear paint alone.

    Far lines are there that were too thin before, and cameras that only looked different end in
    one. Pictures that were not made smaller are not drawn again. A camera that is contradicted stays so.
    """
    if not ranked or ranked[0].is_contradicted:
        return []
    height, width = image.shape[:2]
    factor = width / frame.field.shape[1]
    looked, again = frame, [*ranked[:CLOSER]]
    if factor > 1:
        field = _resize_field(frame, width, height)
        looked = replace(
            frame,
            image=image,
            field=field,
            strength=line_strength(image, field),
            reading=prepare_picture(image, field),
        )
        drawn = get_kernel_executor().map(
            lambda item: _snap_at_full_resolution(looked, item, factor, pitch), again
        )
        again = [item for item in drawn if item is not None]
    if not again:
        return []
    best = max(again, key=lambda item: item.score).snapped.camera
    paint = measure_strength_near_markings(best, looked.field, looked.strength, pitch)
    seen = get_kernel_executor().map(
        lambda item: measure_agreement_with_clear_paint(
            item.snapped.camera, looked.field, looked.strength, pitch, paint
        ),
        again,
    )
    clear = [replace(item, agreement=one) for item, one in zip(again, seen, strict=True)]
    return merge_ranked_cameras(frame, [], clear)


def _snap_at_full_resolution(
    looked: FrameToSearch, item: RankedCamera, factor: float, pitch: Pitch
) -> RankedCamera | None:
    """A camera drawn onto the paint of the picture in its own size, from near and from afar; the
    better of both."""
    height, width = looked.field.shape
    start = scale_snapped_camera(item.snapped, height, width).camera
    found = []
    for windows in (LAST_WINDOWS, WINDOWS):
        snapped = snap_with_known_position(
            looked.reading, start, pitch, windows, item.policy, item.known
        )
        if snapped.reason is None:
            seen = measure_agreement(snapped.camera, looked.field, looked.paint, pitch)
            weakest = measure_weakest_marking(looked.reading, snapped, pitch, VISIBLE_PX * factor)
            found.append(replace(item, snapped=snapped, agreement=seen, weakest=weakest))
    return max(found, key=lambda item: item.score, default=None)


def _resize_field(frame: FrameToSearch, width: int, height: int) -> BoolArray:
    """The field of play in the picture as it is."""
    size, small = (width, height), frame.field.astype(np.uint8)
    return cv2.resize(small, size, interpolation=cv2.INTER_NEAREST).astype(np.bool_)


def measure_score_lead(ranked: Sequence[RankedCamera]) -> float | None:
    """How far the second camera lies behind the first, in supported x explained."""
    if len(ranked) < 2:
        return None
    return ranked[0].score - ranked[1].score


def explain_uncertain_camera(ranked: Sequence[RankedCamera]) -> str | None:
    """Why the best camera cannot be proposed; None where it can."""
    if not ranked:
        return "no camera was found that fits the paint"
    best, lead = ranked[0], measure_score_lead(ranked)
    if best.is_contradicted:
        return "the best camera shows a marking where there is no paint"
    supported = best.agreement.supported
    is_patchy = supported < WELL_SUPPORTED and best.weakest < WELL_PAINTED
    if is_patchy or supported < LEAST_SUPPORTED:
        return "the best camera shows many markings where there is no paint"
    # Where the match knows the position no paint has to tell it.
    is_known = best.known is not None
    if best.position_sigma_m > MOST_UNCERTAIN_M and not is_known:
        return "too few markings are seen to determine where the camera stands"
    lead = SOLE_LEAD if lead is None else lead
    if lead < LEAST_LEAD:
        return "another camera fits the paint nearly as well"
    is_well_known = is_known and supported >= WELL_SUPPORTED
    least, least_sum = LEAST_KNOWN if is_well_known else (LEAST_SCORE, LEAST_SUM)
    if best.score < least or best.score + lead < least_sum:
        return "much of what looks like paint does not fit a marking of the best camera"
    return None


def explain_non_square_pixels(image: Image, camera: Camera, pitch: Pitch) -> str | None:
    """Why the pixels of a picture may not be square; None where nothing speaks against it.

    Args:
        image: Red green blue, shape (H, W, 3).
        camera: On its paint, pixels of it.
        pitch: The pitch.
    """
    seen = measure_goal_height(image, camera, pitch)
    if seen is not None and seen.has_expected_height:
        return None
    if seen is not None and seen.is_certain:
        return (
            f"the pixels are not square: the goal looks {seen.share:.1f} times as high as the "
            "grass says; import the picture in its original shape"
        )
    height, width = image.shape[:2]
    if not SHAPES[0] < width / height < SHAPES[1]:
        return (
            "the aspect ratio is not that of a broadcast, and no goal shows that the pixels are "
            "square; import the picture in its original shape"
        )
    return None


def _choose_proposal(
    image: Image, frame: FrameToSearch, ranked: list[RankedCamera], pitch: Pitch
) -> FrameProposal:
    reason = explain_uncertain_camera(ranked)
    if not ranked:
        return FrameProposal("unsure", reason)
    best, lead = ranked[0], measure_score_lead(ranked)
    snapped = best.snapped
    height, width = image.shape[:2]
    rows, columns = frame.field.shape
    small = snapped.camera
    if snapped.size != (rows, columns):
        small = small.scaled(columns / width, rows / height)
    reason = reason or explain_non_square_pixels(frame.image, small, pitch)
    if width < ENLARGED_WIDTH:
        snapped = scale_snapped_camera(snapped, height, width)
    elif (height, width) != snapped.size:
        snapped = _snap_at_full_size(image, frame, best, pitch)
    return FrameProposal(
        "unsure" if reason else "proposed",
        reason,
        snapped.camera,
        best.agreement,
        snapped,
        lead,
        best.weakest,
    )


def _snap_at_full_size(
    image: Image, frame: FrameToSearch, best: RankedCamera, pitch: Pitch
) -> SnappedCamera:
    """A camera drawn once more onto the paint of the picture as it is; where that says otherwise,
    as it was found in the small one."""
    height, width = image.shape[:2]
    reading = prepare_picture(image, _resize_field(frame, width, height))
    found = scale_snapped_camera(best.snapped, height, width)
    last = snap_with_known_position(
        reading, found.camera, pitch, LAST_WINDOWS, best.policy, best.known
    )
    return last if last.reason is None else found


def scale_snapped_camera(snapped: SnappedCamera, height: int, width: int) -> SnappedCamera:
    """A camera on the paint, and that paint, in the pixels of the picture at another size."""
    factor = width / snapped.size[1]
    return replace(
        snapped,
        camera=snapped.camera.scaled(factor, height / snapped.size[0]),
        evidence=snapped.evidence.scaled(factor),
        error_px=None if snapped.error_px is None else snapped.error_px * factor,
        moved_px=snapped.moved_px * factor,
        size=(height, width),
    )

"""Figures: players, goalkeepers and the referee in their kits, and where their limbs are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import cv2
import numpy as np

from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.sample.fixture import Colour, MatchAppearance, Outfit
from app.sample.play import TEAM, Instant
from app.sample.props import Image, Patch

JOINTS = (
    "pelvis", "chest", "head",
    "hip_l", "knee_l", "ankle_l", "toe_l", "hip_r", "knee_r", "ankle_r", "toe_r",
    "shoulder_l", "elbow_l", "hand_l", "shoulder_r", "elbow_r", "hand_r",
)  # fmt: skip
INDEX = {name: number for number, name in enumerate(JOINTS)}

LIMBS: tuple[tuple[str, str, float, float], ...] = (
    ("pelvis", "chest", 0.078, 0.090),
    ("hip_l", "knee_l", 0.050, 0.036),
    ("knee_l", "ankle_l", 0.034, 0.022),
    ("hip_r", "knee_r", 0.050, 0.036),
    ("knee_r", "ankle_r", 0.034, 0.022),
    ("shoulder_l", "elbow_l", 0.032, 0.024),
    ("elbow_l", "hand_l", 0.024, 0.019),
    ("shoulder_r", "elbow_r", 0.032, 0.024),
    ("elbow_r", "hand_r", 0.024, 0.019),
    ("head", "head", 0.062, 0.062),
)
"""Joint, joint and the radius at each, as a share of body height."""


@dataclass(frozen=True)
class Pose:
    """Joints of everybody: pitch frame, metres, shape (people, 17, 3)."""

    joints: FloatArray

    def joint_positions(self, name: str) -> FloatArray:
        """One joint of everybody, shape (people, 3)."""
        return self.joints[:, INDEX[name]]


def pose_people(instant: Instant) -> Pose:
    """Joints of everybody at that moment."""
    effort = np.clip(instant.speed / 6.0, 0.06, 1.0)
    local = np.zeros((len(effort), len(JOINTS), 3))  # forward, left, up; share of height
    lean = 0.04 + 0.20 * effort
    chest_up = np.array([0.29])
    _set_joint(local, "pelvis", 0 * lean, 0.0, 0.51)
    _set_joint(local, "chest", np.sin(lean) * chest_up, 0.0, 0.51 + np.cos(lean) * chest_up)
    _set_joint(local, "head", np.sin(lean) * 0.43, 0.0, 0.51 + np.cos(lean) * 0.42)
    for side, sign in (("l", 1.0), ("r", -1.0)):
        _place_leg_joints(local, side, sign, effort, instant.stride)
        _place_arm_joints(local, side, sign, effort, instant.stride, lean)
    lowest = np.minimum(local[:, INDEX["ankle_l"], 2], local[:, INDEX["ankle_r"], 2])
    local[:, :, 2] += (0.035 - lowest)[:, None]
    return Pose(_to_pitch_frame(local, instant))


def _place_leg_joints(
    local: FloatArray, side: str, sign: float, effort: FloatArray, stride: FloatArray
) -> None:
    phase = stride + (0.0 if sign > 0 else np.pi)
    thigh = effort * 0.85 * np.sin(phase) + 0.06
    bend = 0.10 + effort * (0.55 + 0.85 * np.cos(phase))
    hip = np.array([0.0, 0.055 * sign, 0.50])
    knee_f, knee_u = 0.245 * np.sin(thigh), 0.50 - 0.245 * np.cos(thigh)
    shin = thigh - np.clip(bend, 0.03, 1.9)
    ankle_f, ankle_u = knee_f + 0.235 * np.sin(shin), knee_u - 0.235 * np.cos(shin)
    spread = (0.060 + 0.03 * (1 - effort)) * sign
    _set_joint(local, f"hip_{side}", hip[0], hip[1], hip[2])
    _set_joint(local, f"knee_{side}", knee_f, (hip[1] + spread) / 2, knee_u)
    _set_joint(local, f"ankle_{side}", ankle_f, spread, ankle_u)
    foot = np.clip(shin, -1.2, 0.3)
    _set_joint(
        local,
        f"toe_{side}",
        ankle_f + 0.095 * np.cos(foot),
        spread * 1.25,
        ankle_u - 0.018 + 0.095 * np.sin(foot),
    )


def _place_arm_joints(
    local: FloatArray, side: str, sign: float, effort: FloatArray, stride: FloatArray, lean: FloatArray
) -> None:  # fmt: skip
    swing = -effort * 0.8 * np.sin(stride + (0.0 if sign > 0 else np.pi))
    bend = 0.25 + 1.2 * effort
    top_f, top_u = np.sin(lean) * 0.275, 0.51 + np.cos(lean) * 0.285
    elbow_f, elbow_u = top_f + 0.165 * np.sin(swing), top_u - 0.165 * np.cos(swing)
    hand_f, hand_u = elbow_f + 0.15 * np.sin(swing + bend), elbow_u - 0.15 * np.cos(swing + bend)
    _set_joint(local, f"shoulder_{side}", top_f, 0.098 * sign, top_u)
    _set_joint(local, f"elbow_{side}", elbow_f, 0.140 * sign, elbow_u)
    _set_joint(local, f"hand_{side}", hand_f, 0.130 * sign, hand_u)


def _set_joint(
    local: FloatArray,
    joint: str,
    forward: FloatArray | float,
    left: FloatArray | float,
    up: FloatArray | float,
) -> None:
    index = INDEX[joint]
    local[:, index, 0], local[:, index, 1], local[:, index, 2] = forward, left, up


def _to_pitch_frame(local: FloatArray, instant: Instant) -> FloatArray:
    scaled = local * instant.height[:, None, None]
    cosine, sine = np.cos(instant.heading)[:, None], np.sin(instant.heading)[:, None]
    # z points down, so left of somebody who faces +x is -y.
    x = cosine * scaled[..., 0] + sine * scaled[..., 1]
    y = sine * scaled[..., 0] - cosine * scaled[..., 1]
    joints = np.stack([x, y, -scaled[..., 2]], axis=-1)
    joints[..., :2] += instant.feet[:, None]
    return joints


SKIN: tuple[Colour, ...] = (
    (142, 176, 222),
    (112, 148, 200),
    (82, 116, 168),
    (58, 82, 124),
    (40, 56, 86),
)
HAIR: tuple[Colour, ...] = (
    (22, 24, 28),
    (34, 46, 66),
    (62, 104, 142),
    (18, 20, 22),
    (90, 150, 196),
)
BOOTS: tuple[Colour, ...] = (
    (28, 26, 26),
    (236, 238, 240),
    (90, 240, 210),
    (60, 60, 240),
    (240, 170, 40),
)
_TURNS = np.radians(np.arange(-90, 91, 15.0))


@dataclass(frozen=True)
class ProjectedPerson:
    """One person as seen in one view: joints in pixels and how large a metre is there."""

    index: int
    joints: FloatArray
    """Pixels, shape (17, 2)."""
    depths: FloatArray
    """Along the optical axis, metres, shape (17,)."""
    scale: float
    """Pixels per metre at the person."""
    turn: float
    """Angle from the way to the camera to the way the person faces, radians: 0 faces it."""
    height: float


def list_people_in_view(
    camera: Camera, instant: Instant, pose: Pose, image: Image
) -> list[ProjectedPerson]:
    """Everybody who is at least partly in the frame."""
    count, joints = pose.joints.shape[:2]
    flat = pose.joints.reshape(-1, 3)
    pixels = camera.project(flat).reshape(count, joints, 2)
    depths = camera.pitch_to_camera(flat)[:, 2].reshape(count, joints)
    rows, columns = image.shape[:2]
    people = []
    for index in range(count):
        if np.isnan(pixels[index]).any() or depths[index].min() < 1.0:
            continue
        low, high = pixels[index].min(axis=0), pixels[index].max(axis=0)
        scale = camera.focal_length[0] / float(depths[index].mean())
        margin = 0.2 * scale
        if (high + margin < 0).any() or low[0] - margin > columns or low[1] - margin > rows:
            continue
        toward = camera.position[:2] - instant.feet[index]
        turn = float(instant.heading[index] - np.arctan2(toward[1], toward[0]))
        people.append(
            ProjectedPerson(
                index, pixels[index], depths[index], scale, turn, float(instant.height[index])
            )
        )
    return people


def choose_outfit(look: MatchAppearance, index: int) -> Outfit:
    """What person ``index`` of an instant wears."""
    if index == 2 * TEAM:
        return look.referee
    if index % TEAM == 0:
        return look.home_keeper if index == 0 else look.away_keeper
    return look.home if index < TEAM else look.away


def draw_person(
    image: Image,
    person: ProjectedPerson,
    look: MatchAppearance,
    number: int,
    gain: Colour,
    lit_from: float,
) -> None:
    """Draw one person.

    Args:
        number: On the shirt; 0 for none.
        gain: Light on the person, per channel.
        lit_from: -1 where light comes from the left of the image, +1 from the right.
    """
    margin = 0.14 * person.scale
    low, high = person.joints.min(axis=0) - margin, person.joints.max(axis=0) + margin
    tall = float(high[1] - low[1])
    patch = Patch(low, high, int(np.clip(round(420 / max(tall, 1.0)), 2, 5)), image)
    if patch.is_outside_frame:
        return
    rng = np.random.default_rng([look.seed, person.index])
    skin, hair, boots = (
        choices[int(rng.integers(len(choices)))] for choices in (SKIN, HAIR, BOOTS)
    )
    painter = _PersonPainter(
        patch, person, choose_outfit(look, person.index), skin, hair, boots, lit_from
    )
    painter.draw(number)
    patch.draw_on_frame(gain)


_SHIFT = 4
_DISTANT = (
    ("knee_l", "ankle_l", 0.028, "socks"), ("knee_r", "ankle_r", 0.028, "socks"),
    ("hip_l", "knee_l", 0.050, "shorts"), ("hip_r", "knee_r", 0.050, "shorts"),
    ("shoulder_l", "hand_l", 0.030, "shirt"), ("chest", "pelvis", 0.098, "shirt"),
    ("shoulder_r", "hand_r", 0.030, "shirt"),
)  # fmt: skip
"""Joint, joint, radius as a share of body height, and what covers it: what is left of people far away."""


def draw_distant_person(
    image: Image, person: ProjectedPerson, look: MatchAppearance, gain: Colour
) -> None:
    """Draw somebody who is too small for more than the colours of the kit.

    Args:
        gain: Light on the person, per channel.
    """
    kit, metre = choose_outfit(look, person.index), person.height * person.scale
    joints = np.round(person.joints * (1 << _SHIFT)).astype(int)
    for a, b, radius, part in _DISTANT:
        colour = _apply_light(getattr(kit, part), gain)
        ends = joints[INDEX[a]].tolist(), joints[INDEX[b]].tolist()
        wide = max(1, round(2 * radius * metre))
        cv2.line(image, *ends, colour, wide, cv2.LINE_AA, _SHIFT)
    head = joints[INDEX["head"]].tolist()
    skin = _apply_light(SKIN[person.index % len(SKIN)], gain)
    cv2.circle(image, head, round(0.056 * metre * (1 << _SHIFT)), skin, -1, cv2.LINE_AA, _SHIFT)


def _apply_light(colour: Colour, gain: Colour) -> Colour:
    b, g, r = (0.86 * channel * light for channel, light in zip(colour, gain, strict=True))
    return b, g, r


@dataclass
class _PersonPainter:
    patch: Patch
    person: ProjectedPerson
    kit: Outfit
    skin: Colour
    hair: Colour
    boots: Colour
    lit_from: float

    def draw(self, number: int) -> None:
        """Limbs far from the camera first, then the torso, then the near ones."""
        parts: list[tuple[float, Callable[[], None]]] = [
            (self._mean_depth("chest", "pelvis"), partial(self._draw_torso_and_head, number))
        ]
        for side in ("l", "r"):
            nudge = self._limb_depth_offset(side)
            leg, arm = partial(self._draw_leg, side), partial(self._draw_arm, side)
            parts.append((self._mean_depth(f"hip_{side}", f"knee_{side}") + nudge, leg))
            parts.append((self._mean_depth(f"elbow_{side}", f"hand_{side}") + nudge, arm))
        for _, paint in sorted(parts, key=lambda part: -part[0]):
            paint()

    def _limb_depth_offset(self, side: str) -> float:
        # Breaks ties the way the body is turned; a limb is beside the torso, not within.
        away = np.sin(self.person.turn) * (1.0 if side == "l" else -1.0)
        return 0.03 * float(np.sign(away)) * float(abs(away) > 0.2) - 0.01

    def _mean_depth(self, a: str, b: str) -> float:
        return float(self.person.depths[INDEX[a]] + self.person.depths[INDEX[b]]) / 2

    def _joint_pixel(self, joint: str) -> FloatArray:
        point: FloatArray = self.person.joints[INDEX[joint]]
        return point

    def _height_fraction_to_pixels(self, share: float) -> float:
        return share * self.person.height * self.person.scale

    def _draw_limb(
        self, a: FloatArray, b: FloatArray, ra: float, rb: float, colour: Colour
    ) -> None:
        ra, rb = self._height_fraction_to_pixels(ra), self._height_fraction_to_pixels(rb)
        self.patch.fill_capsule(a, b, ra, rb, _dim_colour(colour, 0.66))
        shift = np.array([0.26 * self.lit_from, -0.10])
        self.patch.fill_capsule(a + shift * ra, b + shift * rb, ra * 0.72, rb * 0.72, colour)

    def _draw_leg(self, side: str) -> None:
        hip, knee, ankle, toe = (
            self._joint_pixel(f"{joint}_{side}") for joint in ("hip", "knee", "ankle", "toe")
        )
        self._draw_limb(ankle, toe, 0.024, 0.016, self.boots)
        self._draw_limb(knee, ankle, 0.033, 0.023, self.kit.socks)
        cuff = hip + 0.62 * (knee - hip)
        self._draw_limb(cuff, knee, 0.042, 0.034, self.skin)
        self._draw_limb(hip, cuff, 0.058, 0.056, self.kit.shorts)

    def _draw_arm(self, side: str) -> None:
        shoulder, elbow, hand = (
            self._joint_pixel(f"{joint}_{side}") for joint in ("shoulder", "elbow", "hand")
        )
        keeper = self.person.index in (0, TEAM)
        self._draw_limb(elbow, hand, 0.023, 0.018, self.kit.shirt if keeper else self.skin)
        if keeper:
            self.patch.fill_disc(hand, self._height_fraction_to_pixels(0.030), (230, 234, 236))
        cuff = shoulder + 0.75 * (elbow - shoulder)
        self._draw_limb(cuff, elbow, 0.025, 0.023, self.skin)
        sleeve = self.kit.second if self.kit.pattern == "halves" else self.kit.shirt
        self._draw_limb(shoulder, cuff, 0.036, 0.034, sleeve)

    def _draw_torso_and_head(self, number: int) -> None:
        self._draw_torso()
        self._draw_limb(
            self._joint_pixel("hip_l"), self._joint_pixel("hip_r"), 0.060, 0.060, self.kit.shorts
        )
        if number:
            self._draw_shirt_number(number)
        neck, head = self._joint_pixel("chest"), self._joint_pixel("head")
        self._draw_limb(
            neck + 0.42 * (head - neck), neck + 0.65 * (head - neck), 0.026, 0.026, self.skin
        )
        self._draw_head(head)

    def _draw_torso(self) -> None:
        top, low = self._joint_pixel("chest"), self._joint_pixel("pelvis")
        chest, waist = (
            self._height_fraction_to_pixels(self._compute_half_width_in_view(0.108, 0.066)),
            self._height_fraction_to_pixels(self._compute_half_width_in_view(0.080, 0.058)),
        )
        self.patch.fill_capsule(top, low, chest * 0.92, waist, _dim_colour(self.kit.shirt, 0.66))
        # The shirt is a cylinder around the spine; each strip has its own light and colour.
        for left, right in pairwise(_TURNS):
            middle = (left + right) / 2
            light = 0.80 + 0.24 * np.cos(middle - 0.6 * self.lit_from)
            rim = np.array(
                [[np.sin(left), np.sin(right), np.sin(right), np.sin(left)], [-0.25, -0.25, 0, 0]]
            )
            quad = np.array([top, top, low, low]) + rim.T * [[chest], [chest], [waist], [waist]]
            colour = self._shirt_colour_at_angle(float(middle))
            self.patch.fill_polygon(quad, _dim_colour(colour, float(light)))

    def _compute_half_width_in_view(self, side: float, front: float) -> float:
        return float(np.hypot(side * np.cos(self.person.turn), front * np.sin(self.person.turn)))

    def _shirt_colour_at_angle(self, angle: float) -> Colour:
        kit, around = self.kit, angle + self.person.turn
        second = {
            "stripes": int(np.floor(np.degrees(around) / 30.0)) % 2 == 1,
            "halves": np.sin(around) > 0,
        }
        return kit.second if second.get(kit.pattern) else kit.shirt

    def _draw_shirt_number(self, number: int) -> None:
        """On the back, where it can be read."""
        facing_away = -float(np.cos(self.person.turn))
        tall = self._height_fraction_to_pixels(0.15) * self.patch.fine
        if facing_away < 0.45 or tall < 14 or self._height_fraction_to_pixels(0.15) < 7:
            return
        text, font = str(number), cv2.FONT_HERSHEY_DUPLEX
        (width, height), _ = cv2.getTextSize(text, font, 1.0, 2)
        scale = min(
            tall / height,
            self._height_fraction_to_pixels(0.15) * facing_away * self.patch.fine / width,
        )
        bright = sum(self.kit.shirt) > 330 or self.kit.pattern == "stripes"
        ink = (30, 28, 28, 255) if bright else (240, 240, 240, 255)
        center = self._joint_pixel("chest") + 0.36 * (
            self._joint_pixel("pelvis") - self._joint_pixel("chest")
        )
        x, y = self.patch.to_enlarged_pixels(center) / 16
        origin = (int(x - width * scale / 2), int(y + height * scale / 2))
        thick = max(1, round(scale * 3))
        cv2.putText(self.patch.pixels, text, origin, font, scale, ink, thick, cv2.LINE_AA)

    def _draw_head(self, head: FloatArray) -> None:
        radius = self._height_fraction_to_pixels(0.056)
        toward = float(np.cos(self.person.turn))
        side = float(np.sin(self.person.turn))
        self.patch.fill_disc(head, radius, _dim_colour(self.hair, 0.9))
        if toward > -0.35:
            # The face: shifted the way the person looks, below the hair line.
            share = min(1.0, 0.62 + 0.4 * toward)
            face = head + np.array([-side * 0.42, 0.26]) * radius
            self.patch.fill_disc(face, radius * 0.84 * share, _dim_colour(self.skin, 0.78))
            lit = face + np.array([0.16 * self.lit_from, -0.06]) * radius
            self.patch.fill_disc(lit, radius * 0.66 * share, self.skin)


def _dim_colour(colour: Colour, light: float) -> Colour:
    b, g, r = (min(255.0, channel * light) for channel in colour)
    return b, g, r

"""Pose: where the limbs of people are, from stride and speed, in the pitch frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.geometry.arrays import FloatArray
from app.sample.instant import Instant

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

    def of(self, name: str) -> FloatArray:
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

"""Thresholds: what each number of a policy is called, measured in, and what it decides.

Their values are the fields of ``Policy``.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any, Literal, get_args, get_type_hints

from app.soccer.policy import CALIBRATION, PAPER, SUBJECTS, CalibrationPolicy, Policy
from app.soccer.solution import GATES

Asks = Literal["more than", "at least", "at most"]
_COMPARISONS: dict[str, Asks] = {
    "min_jac": "more than",
    "min_agreement": "at least",
    "tau_percent": "at most",
    "min_baseline_m": "at least",
    "min_parallax_degrees": "at least",
    "max_sigma_m": "at most",
    "min_p_value": "at least",
}
"""What equals its threshold passes; JaC alone must exceed it, as in the paper, because 6 of 8 lines
are common and shall not do."""


@dataclass(frozen=True)
class Threshold:
    """What one threshold is called, measured in, about, and between which ends it makes sense.

    Attributes:
        name: As in the policy; those of the calibration's part as ``calibration.name``.
        hint: Type of its values.
        subject: One of ``SUBJECTS``: the gate that it decides, or what else it is about.
        minimum: None, as ``maximum`` is, for a switch.
        choices: The values that forms offer where a range would promise too much; where they are
            words, there are no others.
        later: It came after the first release, see ``collect_digested_values``.
    """

    name: str
    hint: Any
    subject: str
    label: str
    unit: str
    minimum: float | None
    maximum: float | None
    choices: tuple[float | str, ...]
    later: bool = False

    @property
    def default(self) -> float | bool | str | None:
        """Its value in the policy ``paper``."""
        value: float | bool | str | None = self.value(PAPER)
        return value

    @property
    def has_word_choices(self) -> bool:
        """Whether its values are words, the choices."""
        return any(isinstance(choice, str) for choice in self.choices)

    @property
    def gate(self) -> str | None:
        """The gate that it decides, or None."""
        return self.subject if self.subject in GATES else None

    @property
    def comparison(self) -> Asks | None:
        """How a value compares with it to pass its gate; None: it is compared with no value."""
        return _COMPARISONS.get(self.name)

    @property
    def label_with_unit(self) -> str:
        """What it is, in a line."""
        text = f"{self.label}, {self.unit}" if self.unit else self.label
        return f"{text}; must be exceeded" if self.comparison == "more than" else text

    @property
    def optional(self) -> bool:
        """Whether it can be None, which asks for nothing."""
        return type(None) in get_args(self.hint)

    def value(self, policy: Policy) -> Any:
        """What a policy says."""
        value: Any = policy
        for part in self.name.split("."):
            value = getattr(value, part)
        return value


def list_thresholds(
    part: type[Policy | CalibrationPolicy], prefix: str = ""
) -> Iterator[Threshold]:
    """The thresholds of a policy or of its part for calibrations, as they are declared."""
    hints = get_type_hints(part)
    for item in fields(part):
        if item.metadata:
            name = f"{prefix}{item.name}"
            yield Threshold(name, hints[item.name], **item.metadata)


THRESHOLDS = tuple(
    sorted(
        (*list_thresholds(Policy), *list_thresholds(CalibrationPolicy, f"{CALIBRATION}.")),
        key=lambda threshold: SUBJECTS.index(threshold.subject),
    )
)
"""Every threshold, those of the gates first and in their order."""

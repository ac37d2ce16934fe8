"""The sample: synthetic matches with known truth; here what sample is ordered, with nothing heavy, so that a command
can show what it is by default.
"""

from __future__ import annotations

from dataclasses import dataclass

GROUPS, SEED = 60, 20_260_101
RECORDING_SECONDS, SHORTEST_RECORDING = 180, 36
"""Of a recording, and of the shortest that shows all kinds of shots."""


@dataclass(frozen=True)
class SampleOrder:
    """What sample is wanted.

    Attributes:
        groups: How many groups.
        seed: Whole number from 0; another one gives other groups.
        labels_only: Draw no frames.
        faults: Plant faults in about a third of the groups.
    """

    groups: int = GROUPS
    seed: int = SEED
    labels_only: bool = False
    faults: bool = True

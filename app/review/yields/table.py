"""YieldTable: the facts of every group of a dataset.

Nothing in it depends on a threshold: one table answers for every policy that calibrates alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from app.geometry.arrays import BoolArray, IntArray
from app.solving.facts import COLUMNS, NOTHING, Facts
from app.solving.facts import join as join_facts


@dataclass(frozen=True)
class YieldTable:
    """Groups with their facts.

    Attributes:
        group_id: Id of each group, shape (G,).
        inputs: Hash of what was said of each group, shape (G,).
        facts: What the gates read of them.
    """

    group_id: IntArray
    inputs: npt.NDArray[np.str_]
    facts: Facts

    @property
    def groups(self) -> int:
        """How many groups there are."""
        return len(self.group_id)

    @property
    def nbytes(self) -> int:
        """Memory of all arrays."""
        columns = sum(getattr(self.facts, name).nbytes for name in COLUMNS)
        return int(columns + self.group_id.nbytes + self.inputs.nbytes)

    def only(self, kept: BoolArray) -> YieldTable:
        """The table of some of the groups, in the same order."""
        return YieldTable(self.group_id[kept], self.inputs[kept], self.facts.only(kept))


EMPTY = YieldTable(np.empty(0, np.int64), np.empty(0, "U1"), NOTHING)


def join(tables: Sequence[YieldTable]) -> YieldTable:
    """The groups of several tables, one after the other."""
    return YieldTable(
        np.concatenate([table.group_id for table in tables]),
        np.concatenate([table.inputs for table in tables]),
        join_facts([table.facts for table in tables]),
    )

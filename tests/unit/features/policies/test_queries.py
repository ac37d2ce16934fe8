from __future__ import annotations

from dataclasses import replace

from app.db.log import NewLogEntry, append_entries
from app.features.policies.queries import PolicyVersion, read_policy_history
from app.soccer.codec import policy_to_json
from app.soccer.policy import PAPER


class TestPolicyHistory:
    def test_the_oldest_comes_first_and_other_entries_are_none(self, filled) -> None:
        other = replace(PAPER, tau_percent=0.5)
        with filled.write() as session:
            for at, kind, policy in (
                ("a", "dataset", PAPER),
                ("b", "edit", PAPER),
                ("c", "policy", other),
            ):
                append_entries(
                    session, [NewLogEntry(kind, "ann", at, {"policy": policy_to_json(policy)}, 1)]
                )
            assert read_policy_history(session, 1) == (
                PolicyVersion(1, "a", "ann", PAPER),
                PolicyVersion(2, "c", "ann", other),
            )
            assert read_policy_history(session, 2) == ()

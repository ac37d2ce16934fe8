"""A check names what is apart, whatever its keys are made of."""

from __future__ import annotations

from app.db.check import CheckResult, compare_with_log

WHOLE = CheckResult("findings", True, "2, as the log says")


class TestAsLogged:
    def test_equal_ones_are_counted(self) -> None:
        assert compare_with_log("findings", {1: "a", 2: "b"}, {1: "a", 2: "b"}, "mend") == WHOLE
        assert compare_with_log("findings", {1, 2}, {2, 1}, "mend") == WHOLE

    def test_what_is_missing_new_or_otherwise_is_named_in_the_order_of_the_keys(self) -> None:
        said, present = {2: "a", 10: "b", 30: "c"}, {2: "x", 30: "c", 4: "d"}
        found = compare_with_log("groups", said, present, "mend it")
        assert found == CheckResult("groups", False, "3 not as the log says: 2, 4, 10", "mend it")

    def test_keys_of_which_parts_are_missing_are_named_by_the_others(self) -> None:
        said = {(3, None, "7.png", "no ball"), (None, 5, None, "no lines"), (1, None, None, "old")}
        present = {(1, None, None, "old"), (3, None, None, "no ball")}
        found = compare_with_log("findings", said, present, "mend it")
        assert found.sentence == ("3 not as the log says: 3 7.png no ball, 3 no ball, 5 no lines")

    def test_keys_are_called_what_the_caller_calls_them(self) -> None:
        found = compare_with_log(
            "roles", {("eve", 3): "lead"}, {}, "mend", "{0[0]} in {0[1]}".format
        )
        assert found.sentence == "1 not as the log says: eve in 3"

from __future__ import annotations

from app.http.documents import IdentityCache


class TestIdentityCache:
    def test_calls_once_for_a_value_and_again_for_its_twin(self) -> None:
        called: list[list[int]] = []

        def make(value: list[int]) -> int:
            called.append(value)
            return sum(value)

        cache: IdentityCache[list[int], int] = IdentityCache(make, size=8)
        value, twin = [1, 2], [1, 2]
        assert [cache(value), cache(value), cache(twin)] == [3, 3, 3]
        assert len(called) == 2

    def test_calls_again_where_something_else_is_beside_it(self) -> None:
        cache: IdentityCache[list[int], int] = IdentityCache(
            lambda values, factor: factor * sum(values), size=8
        )
        value = [1, 2]
        assert [cache(value, factor) for factor in (1, 10, 10, 1)] == [3, 30, 30, 3]

    def test_a_value_that_is_gone_gives_its_id_to_nobody_else(self) -> None:
        cache: IdentityCache[list[int], int] = IdentityCache(sum, size=2)
        assert [cache([number]) for number in range(100)] == list(range(100))

    def test_forgets_what_was_not_asked_for_the_longest(self) -> None:
        called: list[str] = []
        values = ["one", "two", "three"]
        cache: IdentityCache[str, None] = IdentityCache(called.append, size=2)
        for value in [values[0], values[1], values[0], values[2], values[0], values[1]]:
            cache(value)
        assert called == ["one", "two", "three", "two"]

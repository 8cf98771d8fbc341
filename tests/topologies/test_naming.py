"""Names of agents and their order."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.errors import BadInput
from volery.topologies import check_name, natural_key

NAMES = st.from_regex(r"[A-Za-z0-9_]+", fullmatch=True)


def test_numbers_compare_as_numbers() -> None:
    """Natural order puts 2 before 10, inside a name too."""
    assert sorted(["10", "uav10", "2", "uav2", "1"], key=natural_key) == ["1", "2", "10", "uav2", "uav10"]


@given(st.lists(NAMES, unique=True))
def test_order_is_total(names: list[str]) -> None:
    """Different names never tie, so that the order does not depend on the order of arrival."""
    assert len({natural_key(name) for name in names}) == len(names)


@given(NAMES)
def test_allowed_names_are_returned(name: str) -> None:
    """A name of letters, digits and underscores is accepted as it is."""
    assert check_name(name) == name


@pytest.mark.parametrize("name", ["", "a-b", "a b", "é", "1\n", "٣", 3, None])
def test_other_names_are_refused(name: object) -> None:
    """Anything else is refused by name, line ends and foreign digits included."""
    with pytest.raises(BadInput, match="cannot be an agent's name"):
        check_name(name)


def test_long_names_are_refused() -> None:
    """A name becomes part of keys: it has at most 100 bytes."""
    assert check_name("a" * 100) == "a" * 100
    with pytest.raises(BadInput, match=r"the agent's name a+… has 101 bytes: it may have at most 100"):
        check_name("a" * 101)

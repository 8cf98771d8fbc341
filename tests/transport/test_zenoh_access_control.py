"""The rules of the wire, as the router reads them."""

from __future__ import annotations

from itertools import chain, product

from hypothesis import given
from hypothesis import strategies as st

from volery.transport.keys import CONTROL_CLIENT, Keys
from volery.transport.zenoh_access_control import access_control

RUN = Keys("run")
NAMES = [str(number) for number in range(1, 7)]
Graph = dict[str, list[str]]


@st.composite
def graphs(draw: st.DrawFn) -> Graph:
    """A random undirected graph of a few agents, lone ones included."""
    pairs = [(a, b) for a in NAMES for b in NAMES if a < b]
    edges = draw(st.lists(st.sampled_from(pairs), unique=True))
    return {name: [a if b == name else b for a, b in edges if name in (a, b)] for name in NAMES}


def matches(expression: str, key: str) -> bool:
    """Whether a key expression includes a key: `*` stands for one chunk."""
    wanted, chunks = expression.split("/"), key.split("/")
    return len(wanted) == len(chunks) and all(want in ("*", chunk) for want, chunk in zip(wanted, chunks, strict=True))


class Router:
    """What the router makes of the rules for a graph: whatever no rule allows is denied."""

    def __init__(self, graph: Graph) -> None:
        control = access_control(RUN, graph)
        assert control["enabled"]
        assert control["default_permission"] == "deny"
        assert {rule["permission"] for rule in control["rules"]} == {"allow"}
        self._rules = {rule["id"]: rule for rule in control["rules"]}
        users = {subject["id"]: subject["usernames"] for subject in control["subjects"]}
        self._mine: dict[str, list[str]] = {}
        for policy in control["policies"]:
            for user in chain.from_iterable(users[subject] for subject in policy["subjects"]):
                self._mine.setdefault(user, []).extend(policy["rules"])

    def allows(self, user: str, message: str, flow: str, key: str) -> bool:
        """Whether some rule of a user's covers this message, flow and key."""
        rules = (self._rules[name] for name in self._mine[user])
        return any(
            matches(wide, key)
            for rule in rules
            if message in rule["messages"] and flow in rule["flows"]
            for wide in rule["key_exprs"]
        )


@given(graphs())
def test_agents_reach_their_neighbours_and_nobody_else(graph: Graph) -> None:
    """An agent may put exactly on its own links to neighbours, and is brought exactly what they put on theirs to it."""
    router = Router(graph)
    for user, source, target in product(NAMES, NAMES, NAMES):
        key = RUN.link(source, target)
        edge = target in graph[source]
        assert router.allows(user, "put", "ingress", key) is (edge and user == source)
        assert router.allows(user, "put", "egress", key) is (edge and user == target)


@given(graphs())
def test_agents_speak_for_themselves_only(graph: Graph) -> None:
    """Telemetry, life and answers of others are out of reach, and so is every other run."""
    router = Router(graph)
    for user, name in product(NAMES, NAMES):
        own = user == name
        assert router.allows(user, "put", "ingress", RUN.telemetry(name)) is own
        assert router.allows(user, "put", "egress", RUN.telemetry(name)) is False
        assert router.allows(user, "liveliness_token", "ingress", RUN.alive(name, 3)) is own
        assert router.allows(user, "reply", "ingress", RUN.control(name, 3)) is own
        assert router.allows(user, "query", "ingress", RUN.control(name, 3)) is False
        assert router.allows(user, "declare_subscriber", "ingress", RUN.inbox(name)) is own
        assert not any(
            router.allows(user, "put", "ingress", Keys("another").link(user, other)) for other in graph[user]
        )


def test_the_operator_asks_the_supervisor_and_nobody_else() -> None:
    """A command line on a running swarm cannot put frames, nor give orders to agents."""
    router = Router({"1": ["2"], "2": ["1"]})
    assert router.allows(CONTROL_CLIENT, "query", "ingress", RUN.supervisor())
    assert not router.allows(CONTROL_CLIENT, "query", "ingress", RUN.control("1", 0))
    assert not router.allows(CONTROL_CLIENT, "put", "ingress", RUN.link("1", "2"))
    assert not router.allows("1", "query", "ingress", RUN.supervisor())


def test_keys_tell_who_is_meant() -> None:
    """Source of a link key, agent and incarnation of a control or alive key."""
    assert Keys.source_of(RUN.link("12", "3")) == "12"
    assert Keys.agent_of(RUN.alive("12", 4)) == Keys.agent_of(RUN.control("12", 4)) == ("12", 4)
    assert matches(RUN.inbox("3"), RUN.link("12", "3"))
    assert not matches(RUN.inbox("3"), RUN.link("3", "12"))

"""Classes of agents as a careless user writes them: each ends in a sentence that says what to do."""

from __future__ import annotations

import sys
from collections.abc import AsyncIterator, Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from volery.agents.agent import Agent, Context, Received, Sample, Timer
from volery.agents.agent_class_checks import check_agent_class
from volery.agents.plan import AgentPlan, Plan
from volery.agents.registry import AGENTS, offer_of, problems_of
from volery.errors import BadInput, RunFailed
from volery.experiments.twin import recorded
from volery.kinds import NoParameters
from volery.transport.links import LinkSettings

# mypy: disable-error-code="override, assignment, misc"


@dataclass
class Thawed:
    """Parameters that an agent could change."""


class Careful(Agent):
    """Has nothing to be refused for: constants, class variables and helpers are its own."""

    WEIGHTS = {"a": 1.0}  # noqa: RUF012
    _TABLE = np.zeros(3)
    known: ClassVar[dict[str, float]] = {}
    names = ("a", "b")

    def on_timer(self, timer: Timer, *more: float) -> None:
        """May take more than it is given."""

    def _on_reply(self) -> None:
        """A helper."""

    @staticmethod
    def largest_payload(parameters: Any) -> int:  # noqa: ARG004
        """Needs no class."""
        return 3


class NoDataclass(Agent):
    """Parameters of another type."""

    Parameters = dict


class NotFrozen(Agent):
    """Parameters that can be changed."""

    Parameters = Thawed


class Instance(Agent):
    """An object in the place of a class."""

    Parameters = NoParameters()


class Asynchronous(Agent):
    """A coroutine is never awaited."""

    async def on_timer(self, timer: Timer) -> None:
        """Would wait."""


class Generating(Agent):
    """A generator is never begun."""

    def on_sample(self, sample: Sample) -> Iterator[int]:
        """Would yield."""
        yield 1


class AsynchronouslyGenerating(Agent):
    """Nor is one that is both."""

    async def on_sample(self, sample: Sample) -> AsyncIterator[int]:
        """Would yield."""
        yield 1


class TooFew(Agent):
    """No room for the timer."""

    def on_timer(self) -> None:
        """Takes nothing."""


class TooMany(Agent):
    """Wants more than there is."""

    def on_frame(self, frame: Received, sender: str) -> None:
        """Takes two."""


class NoParametersTaken(Agent):
    """Forgets the second argument."""

    def __init__(self, context: Context) -> None:
        super().__init__(context, None)


class NoClassMethod(Agent):
    """Forgets the decorator."""

    def problems(self, plan: Plan) -> tuple[str, ...]:
        """Of the class."""
        return ()


class ClassMethod(Agent):
    """Has one decorator too many."""

    @classmethod
    def start(cls) -> None:
        """Of the object."""


class Misspelt(Agent):
    """Would never be called."""

    def on_frames(self, frame: Received) -> None:
        """One letter too many."""


class NotAMethod(Agent):
    """A number in the place of a method."""

    on_frame = 3


class Sharing(Agent):
    """One dictionary for all agents of the twin."""

    heard: dict[str, float] = {}  # noqa: RUF012


class SharingDefault(Agent):
    """One list for all calls."""

    def helper(self, seen: list[int] = []) -> None:  # noqa: B006
        """Remembers."""


class SavesOnly(Agent):
    """Would lose what it saves."""

    def save(self) -> int:
        """Something."""
        return 1


class Promising(Agent):
    """Promises in words."""

    timers_only = "yes"


class Judged(Agent):
    """An object in the place of an evaluation's class."""

    evaluation = 3


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        (NoDataclass, r"Parameters is <class 'dict'>, and must be a class with @dataclass\(frozen=True\)"),
        (NotFrozen, r"Parameters is .*Thawed'>, and must be a class with @dataclass\(frozen=True\)"),
        (Instance, r"Parameters is NoParameters\(\), and must be a class"),
        (Asynchronous, "on_timer is async or a generator, so it would never run: write a plain method"),
        (Generating, "on_sample is async or a generator"),
        (AsynchronouslyGenerating, "on_sample is async or a generator"),
        (TooFew, r"on_timer takes other arguments than \(self, timer\)"),
        (TooMany, r"on_frame takes other arguments than \(self, frame\)"),
        (NoParametersTaken, r"__init__ takes other arguments than \(self, context, parameters\)"),
        (NoClassMethod, "problems is called on the class: write @classmethod above it"),
        (ClassMethod, "start is called on the object: write it as a plain method"),
        (Misspelt, r"has on_frames, which is never called \(did you mean 'on_frame'\?\)"),
        (NotAMethod, "on_frame is 3, and must be a method"),
        (Sharing, "heard is a dict of the class, which all agents of a process share: make it in __init__"),
        (SharingDefault, "helper has a mutable default, which all calls share"),
        (SavesOnly, "overrides save and not restore"),
        (Promising, "timers_only is 'yes', and must be True or False"),
        (Judged, "evaluation is 3, and must be a class or its import string"),
    ],
)
def test_a_class_that_cannot_work_is_refused(kind: type[Agent], message: str) -> None:
    """Before anything runs, and wherever the class is found by its name."""
    with pytest.raises(BadInput, match=f"^agent kind '.*:{kind.__name__}':? {message}"):
        AGENTS.find(f"{__name__}:{kind.__qualname__}")


def test_careful_and_built_in_classes_pass() -> None:
    """What is written as the page has it is not refused."""
    for kind in (Careful, *AGENTS.classes()):
        check_agent_class(kind, "agent kind")


MODULES = {
    "fails_at_import": ("1 / 0\n", r"ZeroDivisionError: division by zero\n.*fails_at_import.py"),
    "exits_at_import": ("raise SystemExit\n", "SystemExit"),
    "no_syntax": ("class Mine(:\n", "SyntaxError: invalid syntax"),
    "missing_import": ("import no_such_library\n", "ModuleNotFoundError: .*no_such_library'\n.*py"),
    "mutable_default": (
        "from dataclasses import dataclass\n@dataclass(frozen=True)\nclass P:\n    x: list = []\n",
        "ValueError: mutable default <class 'list'> for field x",
    ),
    "another_name": ("class Other:\n    pass\n", r"module 'another_name' of .*py has no attribute 'Mine'"),
    "queue": ("class Mine:\n    pass\n", "module 'queue' is Python's own: give your file another name"),
}


@pytest.mark.parametrize("module", MODULES)
def test_a_module_that_cannot_be_loaded_says_why(module: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the lines of the user's code where it is that which fails."""
    text, message = MODULES[module]
    (tmp_path / f"{module}.py").write_text(text, "utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    before = dict(sys.modules)
    with pytest.raises(BadInput, match=f"(?s)^agent kind '{module}:Mine' cannot be loaded: {message}"):
        AGENTS.find(f"{module}:Mine")
    for name in sys.modules.keys() - before.keys():
        del sys.modules[name]


def test_a_class_inside_of_another_is_refused() -> None:
    """Other processes could not load it."""
    with pytest.raises(BadInput, match=r"Outer\.Mine is not at the top level of its module: move it there"):
        AGENTS.find(f"{__name__}:Outer.Mine")


class Failing(Agent):
    """Fails in one of its methods, as a test asks."""

    fails_in: ClassVar[str] = ""
    fail: ClassVar[Callable[[], object]] = lambda: None

    def _perhaps(self, method: str) -> None:
        if method == self.fails_in:
            type(self).fail()

    def __init__(self, context: Context, parameters: Any) -> None:
        super().__init__(context, parameters)
        self._perhaps("__init__")

    def start(self) -> None:
        """Set a timer."""
        self.context.set_timer(self.context.now_ns)
        self._perhaps("start")

    def on_timer(self, timer: Timer) -> None:
        """Send."""
        self._perhaps("on_timer")
        self.context.broadcast(b"x")

    def on_frame(self, frame: Received) -> None:
        """Receive."""
        self._perhaps("on_frame")

    @classmethod
    def briefing(cls, plan: object, name: str) -> None:
        """Before the start."""
        if cls.fails_in == "briefing":
            cls.fail()


class Orphan(Agent):
    """Does not call its base class."""

    def __init__(self, context: Context, parameters: Any) -> None:
        self.parameters = parameters


@pytest.fixture(name="plan_of_two")
def plan_of_two_fixture() -> Callable[[type[Agent]], Plan]:
    """Make a plan of two agents of a kind, linked."""

    def plan_of_two(kind: type[Agent]) -> Plan:
        name = f"{kind.__module__}:{kind.__qualname__}"
        agents = tuple(AgentPlan(me, name, NoParameters(), (you,), {"1": 1, "2": 1}) for me, you in ("12", "21"))
        links = {("1", "2"): LinkSettings(), ("2", "1"): LinkSettings()}
        return Plan("careless", 1, 50_000_000, agents, links)

    return plan_of_two


def boom() -> None:
    """Fail in a function of the user's."""
    raise ZeroDivisionError("of all things")


def leave() -> None:
    """End the program."""
    sys.exit(3)


@pytest.mark.parametrize("method", ["briefing", "__init__", "start", "on_timer", "on_frame"])
@pytest.mark.parametrize(("fail", "kind"), [(boom, "ZeroDivisionError: of all things"), (leave, "SystemExit: 3")])
def test_an_error_names_agent_method_and_the_lines_of_the_user(
    method: str,
    fail: Callable[[], None],
    kind: str,
    monkeypatch: pytest.MonkeyPatch,
    plan_of_two: Callable[[type[Agent]], Plan],
) -> None:
    """One sentence, and below it frames of the agent's own file alone."""
    monkeypatch.setattr(Failing, "fails_in", method)
    monkeypatch.setattr(Failing, "fail", fail)
    with pytest.raises(RunFailed) as raised:
        recorded(plan_of_two(Failing))
    sentence, *frames = str(raised.value).splitlines()
    assert sentence in {f"agent {name} failed in {method}: {kind}" for name in "12"}
    files = [line for line in frames if line.startswith('  File "')]
    assert files
    assert all(Path(__file__).name in line for line in files)


class Vague(Agent):
    """Says what it sends in words, and why a plan is impossible in one."""

    @classmethod
    def largest_payload(cls, parameters: Any) -> Any:
        """No whole number."""
        return 9.5

    @classmethod
    def problems(cls, plan: Plan) -> Any:
        """No list."""
        return "too few"


class VagueRate(Agent):
    """Says how often it sends in words."""

    @classmethod
    def sends_per_second(cls, parameters: Any) -> Any:
        """No number."""
        return "20"


def test_what_a_class_says_beforehand_is_checked(plan_of_two: Callable[[type[Agent]], Plan]) -> None:
    """With the class and the method named."""
    plan = plan_of_two(Vague)
    with pytest.raises(BadInput, match=r"^agent kind '.*:Vague': largest_payload is 9.5: give whole bytes, or None"):
        offer_of(plan, "1")
    with pytest.raises(BadInput, match=r"^agent kind '.*:Vague': problems returned 'too few': give a list of"):
        problems_of(plan.agents[0].kind, plan)
    with pytest.raises(BadInput, match=r"^agent kind '.*:VagueRate': sends_per_second is '20': give a number, or None"):
        offer_of(plan_of_two(VagueRate), "1")


class Impatient(Agent):
    """Sets each timer to the instant of the one before."""

    def start(self) -> None:
        """The first is due at 20 ms."""
        self.context.set_timer(20_000_000)

    def on_timer(self, timer: Timer) -> None:
        """Time does not pass."""
        self.context.set_timer(timer.time_ns)


def test_an_agent_that_lets_no_time_pass_ends_the_run(plan_of_two: Callable[[type[Agent]], Plan]) -> None:
    """Else its run would never end, and fill the memory."""
    with pytest.raises(RunFailed, match=r"^agent 1: 20,000 timers have rung at 20000000 ns, .* later than context"):
        recorded(plan_of_two(Impatient))


def test_a_class_must_call_its_base(plan_of_two: Callable[[type[Agent]], Plan]) -> None:
    """Else its context would be missing at the first call."""
    with pytest.raises(RunFailed, match=r"agent 1 failed: Orphan.__init__ must call super\(\)"):
        recorded(plan_of_two(Orphan))

"""The scenarios that come with volery, and the text of a new one."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from ruamel.yaml import YAML
from ruamel.yaml.events import ScalarEvent

from ...errors import BadInput
from ...names import LONGEST_FILE, check_length, did_you_mean

_FOLDER = Path(__file__).parents[2] / "scenarios"
_SUFFIXES = (".yaml", ".yml")

_TEMPLATE = """\
# A scenario of volery. Try it with `volery validate {name}.yaml`, run it with `volery run {name}.yaml`.
name: {name}
description: what this experiment is to show
seed: 1                               # every random decision follows from it
duration: 5 s

# Who is a neighbour of whom: hexagonal, cells, line, ring, star, complete, grid, geometric, erdos-renyi, file …
topology: {{hexagonal: 4}}

# What runs in each agent: the kind, and the parameters of that kind. Your own class: kind: package.module:Class
agents:
  kind: dfa-module
  compute: 1 ms                       # from an event to what is sent because of it
  estimator: running-sum

# The truth, and the sensors that look at it. Signals: a quantity, {{steps: …}} or {{sine: …}}
world: {{kind: plane, altitude: 0.2 m, roll: 5 deg, pitch: -5 deg, distance_noise: 5 mm}}

links:
  medium: {{kind: half-duplex, per: edge, access: {{tdma: {{cycle: 60 Hz, guard: 0.2 ms}}}}}}   # or full-duplex
  rate: 115.2 kbit/s
  bits_per_byte: 10                   # start and stop bit of a UART
  overhead: 4 B
  latency: 2 ms                       # or {{normal: {{mean: 2 ms, sd: 0.5 ms}}}}, {{uniform: …}}
  loss: {{bernoulli: 0.1}}              # or {{gilbert-elliott: {{to_bad: 0.05, to_good: 0.3}}}}, or none
  # only:
  #   - {{where: 1>2, loss: 0.5}}       # 1-2 both directions, 1>2 one, 1 all links of agent 1

faults:
  - {{at: 2 s, for: 1 s, cut: 1-2}}
  # - {{at: 3 s, until: 4 s, where: all, set: {{loss: 0.5}}}}
  # - {{at: 3 s, until: 4 s, kill: 3}}  # restarts at `until`
  # - {{at: 3 s, for: 0.2 s, pause: 3}}
"""


class BuiltIn(NamedTuple):
    """A scenario that comes with volery."""

    name: str
    paper: str
    description: str


class Source(NamedTuple):
    """The text of a scenario; `label`: its name in messages; `folder`: base of its relative paths."""

    name: str
    label: str
    text: str
    folder: Path


def _files() -> dict[str, Path]:
    return {path.stem: path for path in sorted(_FOLDER.glob("*.yaml"))}


def builtin_scenarios() -> list[BuiltIn]:
    """Name, paper and description of every built-in scenario, by name."""
    return [_builtin(path) for path in _files().values()]


def _builtin(path: Path) -> BuiltIn:
    """The texts at the head of a file; the rest is not parsed."""
    head: dict[str, str] = {}
    with path.open(encoding="utf-8") as file:
        scalars = (event.value for event in YAML(typ="safe", pure=True).parse(file) if isinstance(event, ScalarEvent))
        for key, value in zip(scalars, scalars, strict=False):
            if key not in BuiltIn._fields:
                break
            head[key] = value
    return BuiltIn(path.stem, head.get("paper", ""), " ".join(head.get("description", "").split()))


def scenario_text(name: str) -> str:
    """The YAML text of a built-in scenario.

    Raises:
        BadInput: unknown name.
    """
    files = _files()
    if name not in files:
        hint = did_you_mean(name, files)
        raise BadInput(f"there is no scenario {name!r}{hint}: `volery list` shows all; a file's name ends in .yaml")
    return files[name].read_text(encoding="utf-8")


def find_source(source: str | Path) -> Source:
    """The text of a built-in scenario, by name, or of a file, by path.

    Raises:
        BadInput: no such name, or a file that is missing, unreadable or not UTF-8.
    """
    path = Path(source)
    check_length(path.name, LONGEST_FILE, "the scenario's name")
    if isinstance(source, str) and path.name == source and path.suffix not in _SUFFIXES and not path.is_file():
        return Source(source, f"{source}.yaml", scenario_text(source), Path.cwd())
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise BadInput(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise BadInput(f"{path}: not YAML: the byte at {error.start} is not UTF-8 text") from error
    return Source(path.stem, str(path), text, path.resolve().parent)


def new_scenario_text(name: str) -> str:
    """A commented scenario to start from."""
    return _TEMPLATE.format(name=name)

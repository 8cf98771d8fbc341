"""Key expressions of a run.

volery/<run>/link/<src>/<dst>, …/air/<src>, …/control/<agent>/<incarnation>, …/telemetry/<agent>,
…/alive/<agent>/<incarnation>, …/supervisor.
"""

from __future__ import annotations

from dataclasses import dataclass

ROOT = "volery"
CONTROL_CLIENT = "control-client"


@dataclass(frozen=True)
class Keys:
    """The keys of one run."""

    run: str

    def link(self, source: str, target: str) -> str:
        """Frames and promises from one agent to a neighbour."""
        return f"{ROOT}/{self.run}/link/{source}/{target}"

    def air(self, source: str) -> str:
        """Transmissions and promises of an agent's radio; `*` for all."""
        return f"{ROOT}/{self.run}/air/{source}"

    def inbox(self, target: str) -> str:
        """All frames from neighbours to an agent."""
        return self.link("*", target)

    def supervisor(self) -> str:
        """Queries to the supervisor."""
        return f"{ROOT}/{self.run}/supervisor"

    def control(self, name: str, incarnation: int | str = "*") -> str:
        """Queries to an agent; `*` for all."""
        return f"{ROOT}/{self.run}/control/{name}/{incarnation}"

    def telemetry(self, name: str) -> str:
        """Journal batches of an agent; `*` for all."""
        return f"{ROOT}/{self.run}/telemetry/{name}"

    def alive(self, name: str, incarnation: int | str = "*") -> str:
        """Liveliness token of an agent; `*` for all."""
        return f"{ROOT}/{self.run}/alive/{name}/{incarnation}"

    @staticmethod
    def source_of(key: str) -> str:
        """The sender in a key of a link or of the air."""
        return key.split("/", 4)[3]

    @staticmethod
    def agent_of(key: str) -> tuple[str, int]:
        """The agent and incarnation in a control or alive key."""
        _, name, incarnation = key.rsplit("/", 2)
        return name, int(incarnation)

"""Access control of the Zenoh hub, generated from the graph. Everything that is not allowed is denied.

Agent i may put on link/i/j and air/i and subscribe to link/j/i and air/j for its neighbours j, put its telemetry,
answer queries on its control key, and declare its liveliness token. The control client, as `volery fault`, may query
the supervisor. Zenoh drops denied messages without an error.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from .keys import CONTROL_CLIENT, Keys

Rule = dict[str, Any]


def _rule(name: str, messages: list[str], flow: str, keys: list[str]) -> Rule:
    return {"id": name, "messages": messages, "flows": [flow], "permission": "allow", "key_exprs": keys}


def agent_rules(keys: Keys, agent: str, neighbours: Iterable[str]) -> list[Rule]:
    """Rules for one agent."""
    out = [*(keys.link(agent, other) for other in neighbours), keys.air(agent)]
    heard = [key for other in neighbours for key in (keys.link(other, agent), keys.air(other))]
    own, control = [keys.telemetry(agent)], [keys.control(agent)]
    inboxes = [keys.inbox(other) for other in neighbours]
    return [
        _rule(f"{agent}-put", ["put"], "ingress", out + own),
        _rule(f"{agent}-heard-out", ["declare_subscriber"], "egress", [*inboxes, keys.air("*"), keys.telemetry("*")]),
        _rule(f"{agent}-hear", ["put"], "egress", heard),
        _rule(f"{agent}-inbox", ["declare_subscriber"], "ingress", [keys.inbox(agent), keys.air("*")]),
        _rule(f"{agent}-asked", ["query"], "egress", [*control, keys.control("*")]),
        _rule(f"{agent}-answers", ["declare_queryable", "reply"], "ingress", control),
        _rule(f"{agent}-alive", ["liveliness_token"], "ingress", [keys.alive(agent)]),
    ]


def control_client_rules(keys: Keys) -> list[Rule]:
    """Rules for the control client: queries to the supervisor."""
    control = [keys.supervisor()]
    return [
        _rule("control-client-asks", ["query"], "ingress", control),
        _rule("control-client-hears", ["declare_queryable", "reply"], "egress", control),
    ]


def access_control(keys: Keys, neighbours: Mapping[str, Iterable[str]]) -> dict[str, Any]:
    """The hub's `access_control` section for a graph given as agent → neighbours."""
    rules = {agent: agent_rules(keys, agent, others) for agent, others in neighbours.items()}
    rules[CONTROL_CLIENT] = control_client_rules(keys)
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [rule for own in rules.values() for rule in own],
        "subjects": [{"id": f"is-{user}", "usernames": [user]} for user in rules],
        "policies": [
            {"rules": [rule["id"] for rule in own], "subjects": [f"is-{user}"]} for user, own in rules.items()
        ],
    }

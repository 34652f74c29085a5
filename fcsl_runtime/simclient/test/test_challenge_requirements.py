# SPDX-License-Identifier: Apache-2.0
"""A published problem: the state machines of an autopilot and its sensor (the first of the ten Lockheed Martin
cyber-physical challenge problems, 2016), and its thirteen requirements, in our words. The search finds those that the
logic violates."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from simclient import find_violation

SOURCE = """
TRANSITION = 0
NOMINAL = 1
MANEUVER = 2
STANDBY = 3

GOOD = 0
CHANGING = 1
FAULT = 2


class Panel:
    outputs = {"standby": "bool", "apfail": "bool", "supported": "bool", "limits": "bool"}

    def execute(self):
        pass


class Autopilot:
    inputs = {"standby": "bool", "apfail": "bool", "supported": "bool", "good": "bool"}
    outputs = {"mode": "i32", "active": "bool", "request": "bool", "pullup": "bool"}

    def execute(self):
        if self.mode == TRANSITION:
            if self.standby:
                self.mode = STANDBY
            elif self.supported and self.good:
                self.mode = NOMINAL
        elif self.mode == NOMINAL:
            if self.standby:
                self.mode = STANDBY
            elif not self.good:
                self.mode = MANEUVER
        elif self.mode == MANEUVER:
            if self.standby and self.good:
                self.mode = STANDBY
            elif self.supported and self.good:
                self.mode = TRANSITION
        elif self.apfail:
            self.mode = MANEUVER
        elif not self.standby:
            self.mode = TRANSITION
        self.active = self.mode != TRANSITION
        self.request = self.mode == TRANSITION or self.mode == NOMINAL
        self.pullup = self.mode == MANEUVER


class Sensor:
    inputs = {"limits": "bool", "active": "bool", "request": "bool"}
    outputs = {"mode": "i32", "good": "bool"}

    def execute(self):
        if self.mode == GOOD:
            if self.limits:
                self.mode = FAULT
            elif not self.request:
                self.mode = CHANGING
        elif self.mode == CHANGING:
            if self.active and self.request:
                self.mode = GOOD
        elif not self.request or not self.limits:
            self.mode = CHANGING
        self.good = self.mode != FAULT
"""
#: Of each: when it applies and what holds then; `@` is before a value of the tick before.
REQUIREMENTS = {
    "FSM-1": (
        "Limits latch a pull-up while the pilot is not in control and the system is supported and sound.",
        "panel.outputs.limits and not panel.outputs.standby and panel.outputs.supported and not panel.outputs.apfail",
        "ap.outputs.pullup",
    ),
    "FSM-2": (
        "TRANSITION becomes STANDBY with the pilot.",
        "@ap == 0 and panel.outputs.standby",
        "ap.outputs.mode == 3",
    ),
    "FSM-3": (
        "TRANSITION becomes NOMINAL.",
        "@ap == 0 and panel.outputs.supported and ap.inputs.good",
        "ap.outputs.mode == 1",
    ),
    "FSM-4": ("NOMINAL becomes MANEUVER.", "@ap == 1 and not ap.inputs.good", "ap.outputs.mode == 2"),
    "FSM-5": ("NOMINAL becomes STANDBY.", "@ap == 1 and panel.outputs.standby", "ap.outputs.mode == 3"),
    "FSM-6": (
        "MANEUVER becomes STANDBY.",
        "@ap == 2 and panel.outputs.standby and ap.inputs.good",
        "ap.outputs.mode == 3",
    ),
    "FSM-7": (
        "MANEUVER becomes TRANSITION.",
        "@ap == 2 and panel.outputs.supported and ap.inputs.good",
        "ap.outputs.mode == 0",
    ),
    "FSM-8": ("STANDBY becomes TRANSITION.", "@ap == 3 and not panel.outputs.standby", "ap.outputs.mode == 0"),
    "FSM-9": ("STANDBY becomes MANEUVER.", "@ap == 3 and panel.outputs.apfail", "ap.outputs.mode == 2"),
    "FSM-10": ("The sensor becomes FAULT.", "@sensor == 0 and panel.outputs.limits", "sensor.outputs.mode == 2"),
    "FSM-11": ("The sensor leaves NOMINAL.", "@sensor == 0 and not ap.outputs.request", "sensor.outputs.mode == 1"),
    "FSM-12": (
        "The sensor leaves FAULT.",
        "@sensor == 2 and not (ap.outputs.request and panel.outputs.limits)",
        "sensor.outputs.mode == 1",
    ),
    "FSM-13": (
        "The sensor becomes NOMINAL.",
        "@sensor == 1 and ap.outputs.request and ap.outputs.active",
        "sensor.outputs.mode == 0",
    ),
}
#: 1: an autopilot in TRANSITION waits for good data, so that limits exceeded there make it wait for ever. The others: two of
#: them demand different states in one tick, as 2 and 3 where the pilot takes control.
VIOLATED = {"FSM-1", "FSM-3", "FSM-4", "FSM-7", "FSM-8", "FSM-11"}


def machine(folder: Path, within_s: float) -> Path:
    (folder / "fsm.py").write_text(SOURCE)
    requirements = []
    for id_, (text, when, then) in REQUIREMENTS.items():
        for name in ("ap", "sensor"):
            when = when.replace(f"@{name}", f"machine.tick > 1 and previous({name}.outputs.mode)")
        limit = {"within_s": within_s} if id_ == "FSM-1" else {}
        requirements.append({"id": id_, "text": text, "when": when, "then": then, **limit})
    names = {"panel": "Panel", "ap": "Autopilot", "sensor": "Sensor"}
    config = {
        "tick_hz": 10,
        "initial_state": "RUN",
        "algorithms": {name: {"source": "fsm.py"} for name in names.values()},
        "instances": {instance: {"algorithm": name} for instance, name in names.items()},
        "connections": [
            *({"from": f"panel.{name}", "to": f"ap.{name}"} for name in ("standby", "apfail", "supported")),
            {"from": "sensor.good", "to": "ap.good", "delayed": True, "initial": True},
            {"from": "panel.limits", "to": "sensor.limits"},
            {"from": "ap.active", "to": "sensor.active"},
            {"from": "ap.request", "to": "sensor.request"},
        ],
        "states": {"RUN": {"schedule": dict.fromkeys(names, 10)}},
        "requirements": requirements,
    }
    path = folder / "fsm.json"
    path.write_text(json.dumps(config))
    return path


SWITCHES = {f"panel.outputs.{name}": [False, True] for name in ("standby", "apfail", "supported", "limits")}


@pytest.mark.parametrize("id_", REQUIREMENTS)
def test_the_search_finds_what_the_logic_violates(id_: str, tmp_path: Path) -> None:
    found = find_violation(machine(tmp_path, 0.5), SWITCHES, ticks=40, requirement=id_, examples=300)
    assert (found is not None) == (id_ in VIOLATED), found


def test_the_pull_up_that_does_not_come(tmp_path: Path) -> None:
    """Limits from the start, and a system that is supported one tick later, are enough."""
    found = find_violation(machine(tmp_path, 0.5), SWITCHES, ticks=40, requirement="FSM-1", examples=300)
    assert found is not None and found.verdict.first["ap.outputs.pullup"] is False
    assert {path.rpartition(".")[2]: own for path, own in found.inputs.items()} == {
        "standby": [(40, False)],
        "apfail": [(40, False)],
        "supported": [(1, False), (39, True)],
        "limits": [(40, True)],
    }

# SPDX-License-Identifier: Apache-2.0
"""The flights of the check `plant_bits`, as plans of the simulator (fcsl_sim/src/plan/plan.h)."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from fcsl_sim import load, plan
from fcsl_sim.plan import Plan, Statement

from ..shared.cases import ROOT
from .build import MACHINE

#: Simulation files.
_FILES = {
    "lander": ROOT / "examples/lander/sim/lander.sim.json",
    "aircraft": ROOT / "fcsl_sim/test/library/aircraft.sim.json",
}
#: Steps a second of each integrator; 0: adaptive.
_METHODS = {"euler": 300, "rk2": 200, "rk4": 100, "ab4": 700, "verlet": 250, "rk45": 0}
#: x at the start, and rates are those of _METHODS times this.
_PROBLEMS = {
    "kepler": ([0.5, 0.0, 0.0, 3.0**0.5], 1),
    "pleiades": (
        [3, 3, -1, -3, 2, -2, 2, 3, -3, 2, 0, 0, -4, 4, 0, 0, 0, 0, 0, 1.75, -1.5, 0, 0, 0, -1.25, 1, 0, 0],
        4,
    ),
}
#: Their flights, seconds of 100 ticks.
_SECONDS = 3
PLANS = (*_FILES, "balls", *_PROBLEMS)


def _bits(value: float) -> str:
    return plan.bits("f64", float(value))


def _groups(methods: dict[str, int], times: int) -> list[Statement]:
    adaptive = [_bits(v) for v in (1e-8, 1e-8, 1e-7, 0.1)]
    return [
        plan.statement("group", m, hz * times, *([_bits(0.0)] * 4 if hz else adaptive)) for m, hz in methods.items()
    ]


def _begin(ticks: int, models: dict[str, Path], machine: Path) -> list[Statement]:
    return [
        plan.library_statement("machine", MACHINE, library=machine),
        plan.statement("seed", 1),
        plan.statement("ticks", ticks),
        *(plan.library_statement("model", name, library=library) for name, library in models.items()),
    ]


def _problem(name: str, libraries: dict[str, Path]) -> list[Statement]:
    """One problem with every integrator."""
    x, times = _PROBLEMS[name]
    return [
        *_begin(_SECONDS * 100, {"problem": libraries[name]}, libraries[MACHINE]),
        *_groups(_METHODS, times),
        *(plan.statement("instance", m, "problem", i, 0, 0, 0) for i, m in enumerate(_METHODS)),
        *(plan.statement("call", m, "output") for m in _METHODS),
        *(plan.statement("set", m, "parameters.x", i, _bits(v)) for m in _METHODS for i, v in enumerate(x)),
    ]


def _balls(libraries: dict[str, Path]) -> list[Statement]:
    """Bouncing balls, each integrated in another way, of which noisy sensors see two; and a push on one of them by the controller."""
    methods = {m: hz for m, hz in _METHODS.items() if m != "verlet"}
    values = {"gravity": 9.81, "restitution": 0.7, "rest_speed": 0.05, "height": 0.5}
    models = {name: libraries[name] for name in ("ball", "noisy_sensor")}
    return [
        *_begin(_SECONDS * 100, models, libraries[MACHINE]),
        *_groups(methods, 1),
        *(plan.statement("instance", m, "ball", i, 0, 0, 0) for i, m in enumerate(methods)),
        plan.statement("instance", "fast", "noisy_sensor", "-", "1000", "7", "3"),
        plan.statement("instance", "slow", "noisy_sensor", "-", "100", "1", "0"),
        *(plan.statement("call", m, "stage") for m in methods),
        plan.statement("call", "fast", "update"),
        plan.statement("call", "slow", "update"),
        *(plan.statement("set", m, f"parameters.{n}", 0, _bits(v)) for m in methods for n, v in values.items()),
        *(plan.statement("set", s, "parameters.sigma", 0, _bits(0.1)) for s in ("fast", "slow")),
        plan.statement("link", "rk45", "outputs.z", "fast", "inputs.truth"),
        plan.statement("link", "ab4", "outputs.v", "slow", "inputs.truth"),
        plan.statement("sensor", "fast", "outputs.value", "altitude"),
        plan.statement("sensor", "slow", "outputs.value", "velocity"),
        plan.statement("actuator", "throttle", "rk4", "inputs.push"),
        plan.statement("event", 1_234_567_891, "rk45", "inputs.push", 0, _bits(-1.5)),
    ]


@cache
def _of_file(name: str) -> list[Statement]:
    """What `fcsl-sim` flies, but for its views."""
    return [one for one in load(_FILES[name]).plan.statements if one.keyword != "views"]


def _file_plan(flight: str, libraries: dict[str, Path]) -> list[Statement]:
    """With the libraries of the target. A plant alone is flown beside the controller, which it does not meet."""
    found = []
    for one in _of_file(flight):
        if one.keyword == "machine":
            one = plan.library_statement("machine", MACHINE, library=libraries[MACHINE])
        elif one.keyword == "model":
            one = plan.library_statement("model", one.words[0], library=libraries[one.words[0]])
        found.append(one)
    return found


def plan_text(name: str, libraries: dict[str, Path]) -> str:
    """The plan of a flight, with these libraries."""
    if name in _FILES:
        return Plan(tuple(_file_plan(name, libraries))).text
    return Plan(tuple(_balls(libraries) if name == "balls" else _problem(name, libraries))).text

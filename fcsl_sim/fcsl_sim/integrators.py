# SPDX-License-Identifier: Apache-2.0
"""The `integrator` of a simulation, or of a group of its models."""

from __future__ import annotations

from dataclasses import dataclass

from fcsl_compiler.api.diagnostics import Span
from fcsl_compiler.api.json_files import ConfigReader, JsonNode

from . import plan
from .plan import Statement

#: Limits of the native simulator (src/plan/plan.h).
MAX_HZ = 1_000_000
#: Methods of fixed steps: Euler, midpoint, Runge-Kutta, Adams-Bashforth, velocity Verlet.
FIXED = ("euler", "rk2", "rk4", "ab4", "verlet")
#: Dormand-Prince 5(4).
ADAPTIVE = "rk45"
METHODS = (*FIXED, ADAPTIVE)
#: AB4 starts with three steps of RK4, after every jump of an input; with fewer steps in a tick it has no use.
AB4_STEPS_PER_TICK = 5

_LIMITS = {"rtol": (0.0, 1.0), "atol": (1e-300, 1e300), "min_step_s": (1e-9, 1e9), "max_step_s": (1e-9, 1e9)}
_DEFAULTS = {"rtol": 1e-6, "atol": 1e-9, "min_step_s": 1e-9, "max_step_s": 1e9}


@dataclass(frozen=True)
class Integrator:
    """`hz`: of fixed steps; 0 for rk45, which has tolerances and limits of its step instead."""

    method: str
    hz: int
    rtol: float
    atol: float
    min_step_s: float
    max_step_s: float
    span: Span

    def statement(self, tick_hz: int) -> Statement:
        """The plan's statement of a group with this integrator, before a controller of this rate."""
        method = "rk4" if self.method == "ab4" and self.hz < AB4_STEPS_PER_TICK * tick_hz else self.method
        values = (self.rtol, self.atol, self.min_step_s, self.max_step_s)
        return plan.statement("group", method, self.hz, *(plan.bits("f64", value) for value in values))

    def same(self, other: Integrator) -> bool:
        return self.statement(0) == other.statement(0)


def read_integrator(node: JsonNode | None, reader: ConfigReader, tick_hz: int | None) -> Integrator | None:
    """None: there is none, or an error was reported."""
    if node is None:
        return None
    keys = reader.object(node, "`integrator`", ("method",), ("hz", *_LIMITS))
    method = reader.choice(keys.get("method"), "`method`", METHODS) if keys else None
    if keys is None or method is None:
        return None
    adaptive = method == ADAPTIVE
    for key in _LIMITS if not adaptive else ("hz",):
        if key in keys:
            why = "its steps follow from the tolerances" if adaptive else "only rk45 chooses its steps"
            reader.sink.error("E804", f"`{key}` with `{method}`: {why}", keys[key].span, help="remove it")
            return None
    values = {}
    for key, (low, high) in _LIMITS.items():
        value = reader.number(keys.get(key), f"`{key}`", low, high)
        values[key] = _DEFAULTS[key] if value is None else value
    if values["min_step_s"] > values["max_step_s"]:
        message = f"`min_step_s` ({values['min_step_s']:g}) is above `max_step_s` ({values['max_step_s']:g})"
        at = keys.get("min_step_s") or keys["max_step_s"]
        reader.sink.error("E804", message, at.span, help="let the smallest step be at most the largest")
        return None
    hz = 0
    if not adaptive:
        if "hz" not in keys:
            reader.sink.error("E202", f"`hz` is missing: {method} makes steps of fixed size", node.span)
            return None
        given = reader.integer(keys["hz"], "`hz`", 1, MAX_HZ)
        if given is None:
            return None
        if tick_hz and given % tick_hz:
            message = f"the integrator's {given} Hz is not a multiple of tick_hz ({tick_hz})"
            reader.sink.error(
                "E805", message, keys["hz"].span, why="the controller ticks between two integration steps"
            )
            return None
        hz = given
    return Integrator(method, hz, **values, span=node.span)

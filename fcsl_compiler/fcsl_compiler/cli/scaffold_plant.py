# SPDX-License-Identifier: Apache-2.0
"""What `fcsl new plant NAME` writes: a plant model in C, a simulation with a machine, and a test of both."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path

from ..base.files import SourceError, read_regular
from ..base.json_file import json_value
from ..base.usage_error import UsageError
from ..driver.passes import compile_machine
from ..model.machine import Machine
from ..model.types import Scalar
from ..parse.machine_files import is_machine_name

_MACHINE_BYTES = 1 << 20
#: Steps per second at least; a multiple of the machine's rate.
_MIN_HZ = 1000
_BENCH = "_bench"

_PLANT = """/* A mass on a spring, pushed by a motor and by `push`, with a stop at position `travel`:
 *
 *   x' = v,    v' = (force + push - stiffness x - damping v) / mass
 *
 * At the stop it loses its speed, and stays there while it is pressed against it.
 */
#include <stdbool.h>

#include "fcsl/fcsl_model.h"

typedef struct {
    struct { double force; } inputs;
    struct { double mass, stiffness, damping, travel, push; } parameters;
    struct {
        double position, speed; /* integrated */
        bool at_stop;
    } state;
    struct { double position, speed; bool at_stop; } outputs;
} plant_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    const plant_t *p = self;
    (void)context;
    if (!(p->parameters.mass > 0.0)) {
        return "parameters.mass must be positive";
    }
    return p->parameters.travel > 0.0 ? NULL : "parameters.travel must be positive";
}

static double net_force(const plant_t *p, double position, double speed)
{
    return p->inputs.force + p->parameters.push - p->parameters.stiffness * position - p->parameters.damping * speed;
}

static void derivative(const void *self, double t, const double *x, double *dx)
{
    const plant_t *p = self;
    (void)t;
    dx[0] = p->state.at_stop ? 0.0 : x[1];
    dx[1] = p->state.at_stop ? 0.0 : net_force(p, x[0], x[1]) / p->parameters.mass;
}

static void output(void *self, double t, const double *x)
{
    plant_t *p = self;
    (void)t;
    p->outputs.position = x[0];
    p->outputs.speed = x[1];
    p->outputs.at_stop = p->state.at_stop;
}

/* Falls below zero when the mass reaches the stop, and when it is no longer pressed against it. */
static void event(const void *self, double t, const double *x, double *value)
{
    const plant_t *p = self;
    (void)t;
    value[0] = p->state.at_stop ? net_force(p, p->parameters.travel, 0.0) : p->parameters.travel - x[0];
}

static void reset(void *self, const fcsl_model_context_t *context, uint32_t number)
{
    plant_t *p = self;
    (void)context, (void)number;
    p->state.position = p->parameters.travel;
    p->state.speed = 0.0;
    p->state.at_stop = !p->state.at_stop && net_force(p, p->parameters.travel, 0.0) > 0.0;
}

#define FIELD(role, path, unit, doc) FCSL_MODEL_SCALAR(plant_t, FCSL_ROLE_##role, path, unit, doc)

static const fcsl_field_t fields[] = {
    FIELD(INPUT, inputs.force, "N", "of the motor"),
    FIELD(PARAMETER, parameters.mass, "kg", ""),
    FIELD(PARAMETER, parameters.stiffness, "N/m", "of the spring, which rests at position 0"),
    FIELD(PARAMETER, parameters.damping, "N*s/m", ""),
    FIELD(PARAMETER, parameters.travel, "m", "position of the stop"),
    FIELD(PARAMETER, parameters.push, "N", "a disturbance"),
    FIELD(STATE, state.position, "m", ""),
    FIELD(STATE, state.speed, "m/s", ""),
    FIELD(STATE, state.at_stop, "", "pressed against the stop"),
    FIELD(OUTPUT, outputs.position, "m", ""),
    FIELD(OUTPUT, outputs.speed, "m/s", ""),
    FIELD(OUTPUT, outputs.at_stop, "", "pressed against the stop"),
};

static const fcsl_model_event_t events[] = {{"stop", FCSL_FALLING, "it reaches the stop, or leaves it"}};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION, .name = "@NAME@", .doc = "a mass on a spring, with a stop",
    .fields = fields, .field_count = sizeof fields / sizeof *fields, .size = sizeof(plant_t), .align = _Alignof(plant_t),
    .continuous_offset = offsetof(plant_t, state), .continuous_count = 2, .sampled_offset = FCSL_NO_OFFSET,
    .events = events, .event_count = sizeof events / sizeof *events,
    .init = init, .derivative = derivative, .output = output, .event = event, .reset = reset,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
"""

_PARAMETERS = {"mass": 1.0, "stiffness": 1.0, "damping": 0.2, "travel": 2.0, "push": 0.0}

_SIMULATION = """{
  "controller": {"machine": @MACHINE@},
  "seed": 1,
  "duration": 20.0,
  "integrator": {"method": "rk4", "hz": @HZ@},
  "models": {"@NAME@": {"source": "@NAME@.c"}},
  "instances": {
    "plant": {
      "model": "@NAME@",
      "parameters": @PARAMETERS@
    }
  },
  "connections": [@CONNECTIONS@],
  "events": [
    {"at_s": 8.0, "set": "plant.parameters.push", "value": 100.0},
    {"at_s": 12.0, "set": "plant.parameters.push", "value": 0.0}
  ],
  "views": {
    "panels": [
      {"title": "position", "truth": ["plant.outputs.position"]},
      {"title": "speed", "truth": ["plant.outputs.speed"]}
    ]
  }
}
"""

_FLIGHT_TEST = '''"""The plant @NAME@, with its machine."""

import json
import subprocess
from pathlib import Path

SIM = Path(__file__).parents[1] / "@NAME@.sim.json"


def fly(*options):
    """The last outputs of the plant."""
    line = ["fcsl", "sim", str(SIM), "--json", *options]
    truth = json.loads(subprocess.run(line, check=True, capture_output=True, text=True).stdout)["truth"]
    return {path.removeprefix("plant.outputs."): value for path, value in truth.items()}


def test_the_stop_holds_it_while_it_is_pushed():
    assert fly("--duration", "11") == {"position": 2.0, "speed": 0.0, "at_stop": True}


def test_the_spring_pulls_it_off_the_stop():
    plant = fly()
    assert plant["position"] < 1.9 and not plant["at_stop"]
'''

_MODEL_TEST = '''"""The plant @NAME@."""

import json
import subprocess
from pathlib import Path

PLANT = Path(__file__).parents[1] / "@NAME@.c"


def test_it_is_a_model():
    line = ["fcsl", "describe", str(PLANT), "--json"]
    described = json.loads(subprocess.run(line, check=True, capture_output=True, text=True).stdout)
    assert [event["name"] for event in described["events"]] == ["stop"]
    assert set(described["skeleton"]["instances"]["@NAME@"]["parameters"]) == {@PARAMETERS@}
'''


@dataclass(frozen=True)
class NewPlant:
    """Texts by path. `remark`: what the simulation lacks, or why there is none; may be empty."""

    files: dict[Path, str]
    simulation: Path | None
    remark: str


def plant_files(name: str, machine: Path | None) -> NewPlant:
    """The files, for this folder. machine: of the simulation; by default the one in this folder, if it has exactly one.
    Raises UsageError if the name is invalid, and DiagnosticError if the machine is."""
    if not is_machine_name(name):
        raise UsageError(f"`{name}` is not a valid name: lower_snake_case, not a name of C")
    found = _machines() if machine is None else [machine]
    files = {Path(f"{name}.c"): _PLANT.replace("@NAME@", name)}
    test = Path("test") / f"test_{name}_plant.py"
    if len(found) != 1:
        names = f"one of {', '.join(str(path) for path in found)}" if found else "a machine"
        wanted = ", ".join(json.dumps(parameter) for parameter in _PARAMETERS)
        files[test] = _MODEL_TEST.replace("@NAME@", name).replace("@PARAMETERS@", wanted)
        return NewPlant(files, None, f"no simulation was written: name {names} with --machine")
    simulation = Path(f"{name}.sim.json")
    checked = compile_machine(found[0], "", until="schedule").checked
    connections, unconnected = _connect(checked)
    files[simulation] = _simulation(name, found[0], checked.tick_hz, connections)
    files[test] = _FLIGHT_TEST.replace("@NAME@", name)
    remark = f"not connected: {', '.join(unconnected)}" if unconnected else ""
    return NewPlant(files, simulation, remark)


def _machines() -> list[Path]:
    """The machines in this folder, without test benches of algorithms."""
    return [path for path in sorted(Path().glob("*.json")) if not path.stem.endswith(_BENCH) and _is_machine(path)]


def _is_machine(path: Path) -> bool:
    try:
        content = json_value(read_regular(path, _MACHINE_BYTES))
    except (OSError, SourceError, ValueError):
        return False
    return isinstance(content, dict) and {"tick_hz", "states"} <= content.keys()


def _simulation(name: str, machine: Path, tick_hz: int, connections: list[tuple[str, str]]) -> str:
    hz = tick_hz * max(1, -(-_MIN_HZ // tick_hz))
    lines = [f'\n    {{"from": {json.dumps(source)}, "to": {json.dumps(target)}}}' for source, target in connections]
    texts = {
        "@NAME@": name,
        "@MACHINE@": json.dumps(os.path.relpath(machine)),
        "@HZ@": str(hz),
        "@PARAMETERS@": json.dumps(_PARAMETERS),
        "@CONNECTIONS@": ",".join(lines) + ("\n  " if lines else ""),
    }
    text = _SIMULATION
    for place, value in texts.items():
        text = text.replace(place, value)
    return text


def _connect(machine: Machine) -> tuple[list[tuple[str, str]], list[str]]:
    """The plant's connections with the channels of a machine, and the names of channels without one: each port goes to
    the channel of its name, else of its unit, else to one without a unit."""
    free = {direction: _scalars(machine, direction) for direction in ("sensor", "actuator")}
    ports = (
        ("sensor", ("position", "pos"), "m", "plant.position"),
        ("sensor", ("speed", "velocity"), "m/s", "plant.speed"),
        ("actuator", ("force", "command"), "N", "plant.force"),
    )
    connections = []
    for direction, words, unit, port in ports:
        fits = {name: own for name, own in free[direction].items() if own in (unit, "")}
        ranked = sorted(fits, key=lambda name: (name not in words, fits[name] != unit))  # noqa: B023  used at once
        if ranked:
            del free[direction][ranked[0]]
            channel = f"controller.{ranked[0]}"
            connections.append((port, channel) if direction == "sensor" else (channel, port))
    joined = {end.removeprefix("controller.") for pair in connections for end in pair}
    return connections, [channel.name for channel in machine.channels if channel.name not in joined]


def _scalars(machine: Machine, direction: str) -> dict[str, str]:
    """Unit by name of the channels of one f64, in their order."""
    return {
        channel.name: channel.port.unit
        for channel in machine.channels
        if channel.direction == direction and isinstance(channel.port.type, Scalar) and channel.port.type.name == "f64"
    }

# SPDX-License-Identifier: Apache-2.0
"""The diagnostic codes that simulations add to the compiler's; `fcsl explain E804` prints a row.

The vocabulary of a `*.sim.json` is that of a machine JSON with models in place of algorithms, and most of its
diagnostics are the compiler's (E1xx, E2xx). The examples are members of the test simulation (test/conftest.py); the
tests run them.
"""

from __future__ import annotations

from fcsl_compiler.api.codes import Code, Kind

_CONNECTIONS = (
    '"connections": [\n'
    '  {"from": "ramp.x", "to": "altimeter.truth"},\n'
    '  {"from": "ramp.seen_rate", "to": "velocimeter.truth"},\n'
    '  {"from": "altimeter.value", "to": "controller.altitude"},\n'
    '  {"from": "velocimeter.value", "to": "controller.velocity"},\n'
    '  {"from": "controller.throttle", "to": "ramp.rate"}\n'
    "]"
)
_SENSOR = '{"model": "sensor", "parameters": {"bias": 0.0, "sigma": 0.0, "dropout": false}}'
_MODELS = (
    '"models": {\n'
    '  "ramp": {"source": "ramp.c"},\n'
    '  "sensor": {"source": "package://fcsl_sim/models/noisy_sensor.c"},\n'
    '  "pulse": {"source": "MODEL.c"}\n'
    "}"
)
_BIAS = '"events": [{"at_s": 0.5, "set": "altimeter.parameters.bias", "value": 1.0}]'

SIM_CODES: dict[str, Code] = {
    "E801": Code(
        "a model that cannot be used",
        "A model is a `source`, a file in C or C++ inside the simulation's folder or of an installed package, which is "
        "compiled on demand and has the name of its file; or a `library` that fcsl_add_model() of an installed package "
        "has built. It calls nothing whose results differ between machines or runs, such as sin or rand. The reason "
        "stands in the message, and what the compiler printed below it.",
        Kind.SIMULATION,
        '"models": {"ramp": {"source": "romp.c"}, "sensor": {"source": "package://fcsl_sim/models/noisy_sensor.c"}}',
        '"models": {"ramp": {"source": "ramp.c"}, "sensor": {"source": "package://fcsl_sim/models/noisy_sensor.c"}}',
    ),
    "E802": Code(
        "a controller that cannot be used",
        "The controller is a machine JSON beside the simulation or in an installed package; it is compiled as "
        "`fcsl build` would, and the same file flies on hardware.",
        Kind.SIMULATION,
        '"controller": {"machine": "no_such.json"}',
        '"controller": {"machine": "hopper.json"}',
    ),
    "E803": Code(
        "models that feed each other at one instant",
        "Around a circle of outputs that depend on inputs of the same instant each would have to be first: an algebraic "
        "loop. Updates count, too: they take what their sources make at the same instant. An output without direct "
        "feed-through opens the circle: one that is computed from states alone. So does the controller, whose "
        "actuators hold from one tick to the next.",
        Kind.SIMULATION,
        _CONNECTIONS.replace('"ramp.x"', '"velocimeter.value"').replace('"ramp.seen_rate"', '"altimeter.value"'),
        _CONNECTIONS,
    ),
    "E804": Code(
        "a rate that is missing or misplaced",
        "A model with an `update` function (a sensor) says in `rates` how often it is updated: in Hz, or with a phase as "
        '`{"hz": 5, "phase_s": 0.02}`. A model without one has no rate. An integrator of fixed steps has a rate, too, '
        "and `rk45` has tolerances instead.",
        Kind.SIMULATION,
        '"rates": {"altimeter": 100}',
        '"rates": {"altimeter": 100, "velocimeter": 100}',
    ),
    "E805": Code(
        "something that does not fit the grid of time",
        "Time is counted in ticks of the controller and steps of the integrator, both exact: the integrator's "
        "rate is a multiple of the tick rate, and a duration a whole number of ticks.",
        Kind.SIMULATION,
        '"duration": 0.015',
        '"duration": 0.02',
    ),
    "E806": Code(
        "a link of the controller that is none",
        "`link` names an instance of the model serial_link, which carries the messages between plant and controller "
        "and may lose and damage them. Its rate is that of the link ticks.",
        Kind.SIMULATION,
        '"controller": {"machine": "hopper.json", "link": "altimeter"}',
        '"controller": {"machine": "hopper.json"}',
    ),
    "E807": Code(
        "a base that cannot be extended",
        "`extends` names another simulation file, relative to the folder of the one that says it, or package://…: the "
        "members of the file are merged over those of its base. A base may extend another one, but none of those that "
        "extend it.",
        Kind.SIMULATION,
        '"extends": "ramp.sim.json"',
        '"description": "a simulation of its own"',
    ),
    "E808": Code(
        "an integrator that does not fit the models",
        "States of directly connected models integrate together, so such models have one integrator. `verlet` is for models "
        "that declare positions and their velocities, and whose forces depend on no velocity.",
        Kind.SIMULATION,
        '"integrator": {"method": "verlet", "hz": 1000}',
        '"integrator": {"method": "rk4", "hz": 1000}',
    ),
    "W801": Code(
        "a sensor channel that nothing feeds",
        "The controller never gets a sample of it; with an age limit its instance fails. That may be what is tested.",
        Kind.SIMULATION,
        _CONNECTIONS.replace('  {"from": "altimeter.value", "to": "controller.altitude"},\n', ""),
        _CONNECTIONS,
    ),
    "W802": Code(
        "a model input that nothing feeds",
        "No connection and no event sets it, so it stays zero. Usually a connection is missing.",
        Kind.SIMULATION,
        _CONNECTIONS.replace('  {"from": "ramp.x", "to": "altimeter.truth"},\n', ""),
        _CONNECTIONS,
    ),
    "W803": Code(
        "an event after the end",
        "The flight is over before this event, so it never happens; often the duration was shortened, or is in "
        "other units.",
        Kind.SIMULATION,
        _BIAS.replace("0.5", "60.0"),
        _BIAS,
    ),
    "W804": Code(
        "an event on a connected input",
        "A connection overwrites its input at every update, so the event has no effect on the model. Set a "
        "parameter of the source: sensors have a bias and a dropout for this.",
        Kind.SIMULATION,
        '"events": [{"at_s": 0.5, "set": "altimeter.inputs.truth", "value": 1.0}]',
        _BIAS,
    ),
    "W805": Code(
        "a model that compares its time",
        "A function of the model that compares its time `t` usually jumps there. A step of the integrator that reaches over "
        "a jump takes it for a smooth slope: a pulse shorter than a step counts twice, or not at all. The function `next_time` "
        "of a model announces such times, and steps end at them. Only the text of the file is looked at.",
        Kind.SIMULATION,
        _MODELS.replace("MODEL", "silent_pulse"),
        _MODELS.replace("MODEL", "pulse"),
    ),
}

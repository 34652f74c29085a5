# SPDX-License-Identifier: Apache-2.0
"""Diagnostic codes of files (E1xx) and of the machine JSON (E2xx, W2xx)."""

from __future__ import annotations

from .code import Code, Kind

_SMALLEST = """\
{
  "tick_hz": 100,
  "initial_state": "RUN",
  "algorithms": {"Nav": {"source": "nav.py"}},
  "instances": {"nav": {"algorithm": "Nav"}},
  "states": {"RUN": {"schedule": {"nav": 100}}}
}"""


MACHINE_CODES: dict[str, Code] = {
    "E100": Code(
        "a file that cannot be read",
        "Sources are regular UTF-8 text files of at most 1 MiB. A path in the machine JSON is relative to the "
        "folder of that JSON, not to the current folder of the compiler, so that a machine compiles from any "
        "folder.",
        Kind.JSON,
        '"algorithms": {"Nav": {"source": "navigation.py"}, "Control": {"source": "control.py"}}',
        '"algorithms": {"Nav": {"source": "nav.py"}, "Control": {"source": "control.py"}}',
    ),
    "E101": Code(
        "not JSON",
        "The file must conform to RFC 8259: double quotes, no comments, no comma before a closing bracket, no NaN "
        "or Infinity, numbers within f64. If tools accepted different extensions, they could read different "
        "machines from the same file.",
        Kind.TEXT,
        '{\n  "tick_hz": 100,\n}',
        _SMALLEST,
    ),
    "E102": Code(
        "a key given twice",
        "Most JSON readers silently keep the last of two equal keys. If a gain were set at the top of the file and"
        " again below, the vehicle could fly with a value other than the one reviewed.",
        Kind.TEXT,
        _SMALLEST.replace('"tick_hz": 100,', '"tick_hz": 100,\n  "tick_hz": 50,'),
        _SMALLEST,
    ),
    "E103": Code(
        "a source outside the machine's folder",
        "The files of a machine are copied, reviewed and hashed together. A source must therefore be inside the "
        "machine's folder, also after resolving symbolic links, or in an installed ROS package, named "
        "package://<package>/<path>.",
        Kind.JSON,
        '"algorithms": {"Nav": {"source": "../shared/nav.py"}, "Control": {"source": "control.py"}}',
        '"algorithms": {"Nav": {"source": "nav.py"}, "Control": {"source": "control.py"}}',
    ),
    "E104": Code(
        "a simulation where a machine is needed",
        "A `*.sim.json` describes a flight: models, their connections to a controller, a duration. The controller "
        "is a machine in a separate JSON file, which runs unchanged in the simulator and on hardware.",
        Kind.TEXT,
        "{\n"
        '  "controller": {"machine": "craft.json"},\n'
        '  "models": {},\n'
        '  "instances": {},\n'
        '  "connections": [],\n'
        '  "integrator": {"method": "rk4", "hz": 1000},\n'
        '  "seed": 1,\n'
        '  "duration": 10.0\n'
        "}",
        _SMALLEST,
    ),
    "E105": Code(
        "a board where a machine is needed",
        "A board says which devices are the sensors and actuators of a machine. The machine is a separate JSON file, "
        "which runs unchanged on any board. `fcsl board` checks a board together with its machine.",
        Kind.TEXT,
        "{\n"
        '  "machine": "craft.json",\n'
        '  "devices": {"mpu": {"driver": "iio", "device": "mpu6500", "rate_hz": 100}},\n'
        '  "sensors": {"imu": {"kind": "inertial", "channels": {"gyro": "imu.gyro"}, "backends": [{"device": "mpu"}]}}\n'
        "}",
        _SMALLEST,
    ),
    "E201": Code(
        "an unknown key",
        "If a misspelt optional key were ignored, the machine would not do what its file states: with `max_wcet` "
        "instead of `max_wcet_us`, execution time would not be monitored.",
        Kind.JSON,
        '"instances": {\n'
        '  "nav": {"algorithm": "Nav", "max_wcet": 200},\n'
        '  "control": {"algorithm": "Control", "parameters": {"gain": 2.0}}\n'
        "}",
        '"instances": {\n'
        '  "nav": {"algorithm": "Nav", "max_wcet_us": 200},\n'
        '  "control": {"algorithm": "Control", "parameters": {"gain": 2.0}}\n'
        "}",
    ),
    "E202": Code(
        "a missing key",
        "Required values have no defaults: a default rate or initial state could be wrong for this vehicle.",
        Kind.JSON,
        '"connections": [{"from": "nav.speed"}]',
        '"connections": [{"from": "nav.speed", "to": "control.speed"}]',
    ),
    "E203": Code(
        "not a valid name",
        "Names become C identifiers, paths of fields, ROS topics and file names. Letters, digits and single "
        "underscores are valid in all of them. The name of the machine is that of its file, in lower_snake_case. "
        "The name of a channel is lower case with dots.",
        Kind.JSON,
        '"states": {\n'
        '  "COAST": {"schedule": {"nav": 100, "control": 50}},\n'
        '  "SAFE": {"schedule": {"nav": 10}},\n'
        '  "IN FLIGHT": {"schedule": {}}\n'
        "},\n"
        '"transitions": [{"from": "*", "to": "SAFE", "health": {"instance": "nav", "in": ["failed"]}}]',
        '"states": {\n  "COAST": {"schedule": {"nav": 100, "control": 50}},\n  "SAFE": {"schedule": {"nav": 10}}\n}',
    ),
    "E204": Code(
        "a number out of its range",
        "Each number has a valid range: a phase is less than the period, the id of a channel fits 16 bits, a "
        "parameter is in the range that its algorithm declares. `command_timeout_s` is longer than a tick, because one "
        "command comes per tick, and at most 60 s.",
        Kind.JSON,
        '"states": {\n'
        '  "COAST": {"schedule": {"nav": 100, "control": {"hz": 50, "phase": 2}}},\n'
        '  "SAFE": {"schedule": {"nav": 10}}\n'
        "}",
        '"states": {\n'
        '  "COAST": {"schedule": {"nav": 100, "control": {"hz": 50, "phase": 1}}},\n'
        '  "SAFE": {"schedule": {"nav": 10}}\n'
        "}",
    ),
    "E205": Code(
        "not one of the choices",
        "Some keys accept only a few words, such as the direction of a channel or a health.",
        Kind.JSON,
        '"channels": [{"name": "pressure", "id": 1, "field": "nav.inputs.pressure", "direction": "input"}]',
        '"channels": [{"name": "pressure", "id": 1, "field": "nav.inputs.pressure", "direction": "sensor"}]',
    ),
    "E206": Code(
        "an unknown name",
        "The machine refers to an algorithm, instance, state or `machine` source that the file does not define. "
        "Often the name is misspelt or was changed elsewhere.",
        Kind.JSON,
        '"initial_state": "CRUISE"',
        '"initial_state": "COAST"',
    ),
    "E207": Code(
        "a value of a different type than its field",
        "Values are used as written, without conversion: a parameter of type f64 takes a finite number, an f64[3] "
        "a list of exactly three, a Health one of its names. A list of the wrong length often belongs to another "
        "vehicle.",
        Kind.JSON,
        '"instances": {\n'
        '  "nav": {"algorithm": "Nav"},\n'
        '  "control": {"algorithm": "Control", "parameters": {"gain": "2.0"}}\n'
        "}",
        '"instances": {\n'
        '  "nav": {"algorithm": "Nav"},\n'
        '  "control": {"algorithm": "Control", "parameters": {"gain": 2.0}}\n'
        "}",
    ),
    "E208": Code(
        "JSON of the wrong kind",
        "The machine requires a value of another JSON kind (object, list, string or number) at this place.",
        Kind.JSON,
        '"connections": {"from": "nav.speed", "to": "control.speed"}',
        '"connections": [{"from": "nav.speed", "to": "control.speed"}]',
    ),
    "E209": Code(
        "a reserved name",
        "`machine.dt`, `machine.tick` and the machine's own topics (state, health, channels, …) are reserved "
        "paths. An instance of the same name would hide them.",
        Kind.JSON,
        '"instances": {\n'
        '  "machine": {"algorithm": "Nav"},\n'
        '  "control": {"algorithm": "Control", "parameters": {"gain": 2.0}}\n'
        "},\n"
        '"connections": [],\n'
        '"states": {"COAST": {"schedule": {"machine": 100, "control": 50}}},\n'
        '"transitions": []',
        '"instances": {\n'
        '  "nav": {"algorithm": "Nav"},\n'
        '  "control": {"algorithm": "Control", "parameters": {"gain": 2.0}}\n'
        "},\n"
        '"connections": [],\n'
        '"states": {"COAST": {"schedule": {"nav": 100, "control": 50}}},\n'
        '"transitions": []',
    ),
    "E210": Code(
        "a parameter or input that the algorithm does not have",
        "The algorithm declares no such port, so the value would have no effect. The intended port would keep "
        "another value, or zero.",
        Kind.JSON,
        '"instances": {\n'
        '  "nav": {"algorithm": "Nav"},\n'
        '  "control": {"algorithm": "Control", "parameters": {"gain": 2.0, "gian": 3.0}}\n'
        "}",
        '"instances": {\n'
        '  "nav": {"algorithm": "Nav"},\n'
        '  "control": {"algorithm": "Control", "parameters": {"gain": 2.0}}\n'
        "}",
    ),
    "E211": Code(
        "a parameter without a value",
        "Parameters have no defaults, neither in the algorithm nor in the JSON. Every value must be given "
        "explicitly for this vehicle.",
        Kind.JSON,
        '"instances": {\n  "nav": {"algorithm": "Nav"},\n  "control": {"algorithm": "Control"}\n}',
        '"instances": {\n'
        '  "nav": {"algorithm": "Nav"},\n'
        '  "control": {"algorithm": "Control", "parameters": {"gain": 2.0}}\n'
        "}",
    ),
    "E212": Code(
        "an initial value for a connected input",
        "A connection overwrites its input before each run of the instance, so an initial value would have no "
        "effect. Only a `delayed` connection has a first value, its `initial`.",
        Kind.JSON,
        '"instances": {\n'
        '  "nav": {"algorithm": "Nav"},\n'
        '  "control": {"algorithm": "Control", "parameters": {"gain": 2.0}, "inputs": {"speed": 1.0}}\n'
        "}",
        '"instances": {\n'
        '  "nav": {"algorithm": "Nav"},\n'
        '  "control": {"algorithm": "Control", "parameters": {"gain": 2.0}, "inputs": {"mode": 1}}\n'
        "}",
    ),
    "E213": Code(
        "two sources for one input",
        "With two connections to one input, or a connection and a sensor channel, the later one would silently "
        "overwrite the other. Use an algorithm that selects between the two, and connect its output.",
        Kind.JSON,
        '"connections": [\n'
        '  {"from": "nav.speed", "to": "control.speed"},\n'
        '  {"from": "machine.dt", "to": "control.speed"}\n'
        "]",
        '"connections": [\n'
        '  {"from": "nav.speed", "to": "control.speed"},\n'
        '  {"from": "nav.rate", "to": "control.rate"}\n'
        "]",
    ),
    "E214": Code(
        "keys that do not go together",
        "A `delayed` connection carries the value of the previous tick. It needs an `initial` for the first tick; "
        "other connections have none. Likewise only a sensor channel has an age limit, and only an actuator a `safe` "
        "value. `arm` and `command_timeout_s` are for machines with actuators.",
        Kind.JSON,
        '"connections": [{"from": "nav.speed", "to": "control.speed", "delayed": true}]',
        '"connections": [{"from": "nav.speed", "to": "control.speed", "delayed": true, "initial": 0.0}]',
    ),
    "E215": Code(
        "a path to the wrong kind of port",
        "Data flows from outputs to inputs. If another instance needs a value, make it an output. The inputs and "
        "the state of an instance are private to it.",
        Kind.JSON,
        '"connections": [{"from": "nav.pressure", "to": "control.speed"}]',
        '"connections": [{"from": "nav.speed", "to": "control.speed"}]',
    ),
    "E216": Code(
        "a port that is not declared",
        "The algorithm of this instance has no output (`from`) or input (`to`) of that name.",
        Kind.JSON,
        '"connections": [{"from": "nav.velocity", "to": "control.speed"}]',
        '"connections": [{"from": "nav.speed", "to": "control.speed"}]',
    ),
    "E217": Code(
        "a connection between different types",
        "A connection copies values without conversion, so types and shapes of both ends must be equal. Write a "
        "conversion in an algorithm, where its loss of precision is visible. A channel carries numbers and bools, at most "
        "65535 bytes of them.",
        Kind.JSON,
        '"connections": [{"from": "nav.mode", "to": "control.speed"}]',
        '"connections": [{"from": "nav.mode", "to": "control.mode"}]',
    ),
    "E218": Code(
        "a connection between different units",
        "If both ports declare a unit, the units must be identical as text. Confusion of metres and feet has "
        "caused losses of vehicles. A port without a unit can be connected to any port.",
        Kind.JSON,
        '"connections": [{"from": "nav.altitude", "to": "control.speed"}]',
        '"connections": [{"from": "nav.speed", "to": "control.speed"}]',
    ),
    "E219": Code(
        "no state",
        "A machine is always in exactly one of its states. The state defines which instances run, and how often. A"
        " machine without mode changes has one state.",
        Kind.JSON,
        '"states": {},\n"transitions": []',
        '"states": {"COAST": {"schedule": {"nav": 100, "control": 50}}},\n"transitions": []',
    ),
    "E220": Code(
        "a rate that does not divide the tick rate",
        "An instance runs in every n-th tick, with an integer n, so that its period has no drift or jitter. Its "
        "rate is therefore the tick rate divided by an integer.",
        Kind.JSON,
        '"states": {\n  "COAST": {"schedule": {"nav": 100, "control": 30}},\n  "SAFE": {"schedule": {"nav": 10}}\n}',
        '"states": {\n  "COAST": {"schedule": {"nav": 100, "control": 25}},\n  "SAFE": {"schedule": {"nav": 10}}\n}',
    ),
    "E221": Code(
        "a transition that nothing can cause",
        "A transition is caused by a request of an instance, by its guard (a health, or a requirement that is violated), "
        "by the time in its state, or by a combination of these. Without any of them, or with a guard that lists no health, it would be "
        "taken immediately or never. State its cause.",
        Kind.JSON,
        '"transitions": [{"from": "COAST", "to": "SAFE"}]',
        '"transitions": [{"from": "COAST", "to": "SAFE", "health": {"instance": "nav", "in": ["failed"]}}]',
    ),
    "E222": Code(
        "a transition from a state to itself",
        "It would change nothing, not even the time in the state. Count or reset in the state of an algorithm instead.",
        Kind.JSON,
        '"transitions": [\n'
        '  {"from": "COAST", "to": "COAST", "health": {"instance": "nav", "in": ["degraded"]}, "priority": 1},\n'
        '  {"from": "COAST", "to": "SAFE", "health": {"instance": "nav", "in": ["failed"]}, "priority": 2}\n'
        "]",
        '"transitions": [\n'
        '  {"from": "COAST", "to": "SAFE", "health": {"instance": "nav", "in": ["degraded", "failed"]}}\n'
        "]",
    ),
    "E223": Code(
        "invalid source states of a transition",
        '`from` names a state, a list of different states, or "*" for every state except the target.',
        Kind.JSON,
        '"transitions": [{"from": ["COAST", "COAST"], "to": "SAFE", "health": {"instance": "nav", "in": ["failed"]}}]',
        '"transitions": [{"from": ["COAST"], "to": "SAFE", "health": {"instance": "nav", "in": ["failed"]}}]',
    ),
    "E224": Code(
        "transitions of equal or missing priority",
        "If the conditions of several transitions of the active state are true in the same tick, the one with the "
        "largest priority is taken. If a state has several transitions, each must have a different priority. Their"
        " order in the file has no effect.",
        Kind.JSON,
        '"states": {\n'
        '  "COAST": {"schedule": {"nav": 100, "control": 50}},\n'
        '  "SAFE": {"schedule": {"nav": 10}},\n'
        '  "HOVER": {"schedule": {"nav": 100, "control": 50}}\n'
        "},\n"
        '"transitions": [\n'
        '  {"from": "COAST", "to": "SAFE", "health": {"instance": "nav", "in": ["failed"]}, "priority": 1},\n'
        '  {"from": "COAST", "to": "HOVER", "health": {"instance": "control", "in": ["failed"]}, "priority": 1}\n'
        "]",
        '"states": {\n'
        '  "COAST": {"schedule": {"nav": 100, "control": 50}},\n'
        '  "SAFE": {"schedule": {"nav": 10}},\n'
        '  "HOVER": {"schedule": {"nav": 100, "control": 50}}\n'
        "},\n"
        '"transitions": [\n'
        '  {"from": "COAST", "to": "SAFE", "health": {"instance": "nav", "in": ["failed"]}, "priority": 2},\n'
        '  {"from": "COAST", "to": "HOVER", "health": {"instance": "control", "in": ["failed"]}, "priority": 1}\n'
        "]",
    ),
    "E225": Code(
        "a request that no transition uses",
        "A request without a transition never has an effect. If this is intended (an algorithm shared between "
        "vehicles), list the name in `requests`.",
        Kind.BODY,
        'if self.speed > 9.0:\n    self.transition_request = "ABROT"',
        'if self.speed > 9.0:\n    self.transition_request = "ABORT"',
    ),
    "E226": Code(
        "two channels that share a name, an id or a field",
        "Frames contain ids, not names, and all transports derive from this table. A second channel with the same "
        "id, name or field would make it ambiguous.",
        Kind.JSON,
        '"channels": [\n'
        '  {"name": "pressure", "id": 1, "field": "nav.inputs.pressure", "direction": "sensor"},\n'
        '  {"name": "force", "id": 1, "field": "control.outputs.force", "direction": "actuator"}\n'
        "]",
        '"channels": [\n'
        '  {"name": "pressure", "id": 1, "field": "nav.inputs.pressure", "direction": "sensor"},\n'
        '  {"name": "force", "id": 2, "field": "control.outputs.force", "direction": "actuator"}\n'
        "]",
    ),
    "E227": Code(
        "a sensor on an output that its algorithm assigns",
        "A sensor writes the output before the instance runs. An algorithm that assigns the same output would "
        "overwrite the measurement. A source block declares the output but does not assign it.",
        Kind.JSON,
        '"channels": [{"name": "altitude", "id": 1, "field": "nav.outputs.altitude", "direction": "sensor"}]',
        '"channels": [{"name": "pressure", "id": 1, "field": "nav.inputs.pressure", "direction": "sensor"}]',
    ),
    "E228": Code(
        "a cycle of connections",
        "In a tick every instance runs after those whose outputs it reads. In a cycle each instance would have to "
        "run before itself. Mark one connection as `delayed`: it carries the value of the previous tick. The delay"
        " is then explicit in the file, and the phase margin of the loop must account for it.",
        Kind.JSON,
        '"algorithms": {"Control": {"source": "control.py"}},\n'
        '"instances": {\n'
        '  "inner": {"algorithm": "Control", "parameters": {"gain": 2.0}},\n'
        '  "outer": {"algorithm": "Control", "parameters": {"gain": 1.0}}\n'
        "},\n"
        '"connections": [\n'
        '  {"from": "inner.steps", "to": "outer.mode"},\n'
        '  {"from": "outer.steps", "to": "inner.mode"}\n'
        "],\n"
        '"states": {"COAST": {"schedule": {"inner": 100, "outer": 100}}},\n'
        '"transitions": []',
        '"algorithms": {"Control": {"source": "control.py"}},\n'
        '"instances": {\n'
        '  "inner": {"algorithm": "Control", "parameters": {"gain": 2.0}},\n'
        '  "outer": {"algorithm": "Control", "parameters": {"gain": 1.0}}\n'
        "},\n"
        '"connections": [\n'
        '  {"from": "inner.steps", "to": "outer.mode"},\n'
        '  {"from": "outer.steps", "to": "inner.mode", "delayed": true, "initial": 0}\n'
        "],\n"
        '"states": {"COAST": {"schedule": {"inner": 100, "outer": 100}}},\n'
        '"transitions": []',
    ),
    "E229": Code(
        "two things with one generated name",
        "Different names in the source can give the same name in C or in a ROS message: instances `aft_rcs` and "
        "`aftRcs` would both have the message AftRcs.",
        Kind.JSON,
        '"algorithms": {"Nav": {"source": "nav.py"}},\n'
        '"instances": {"aft_rcs": {"algorithm": "Nav"}, "aftRcs": {"algorithm": "Nav"}},\n'
        '"connections": [],\n'
        '"states": {"COAST": {"schedule": {"aft_rcs": 100, "aftRcs": 100}}},\n'
        '"transitions": []',
        '"algorithms": {"Nav": {"source": "nav.py"}},\n'
        '"instances": {"aft_rcs": {"algorithm": "Nav"}, "fore_rcs": {"algorithm": "Nav"}},\n'
        '"connections": [],\n'
        '"states": {"COAST": {"schedule": {"aft_rcs": 100, "fore_rcs": 100}}},\n'
        '"transitions": []',
    ),
    "E230": Code(
        "two machines of one name in one library",
        "A library may contain several machines. Each is identified by the stem of its file, which must be unique."
        " Two machines must not define the same C function, as machine a_b with instance c and machine a with "
        "instance b_c would.",
        Kind.COMMAND,
        "fcsl build left/craft.json right/craft.json",
        "fcsl build left/craft.json right/tug.json",
    ),
    "E232": Code(
        "an invalid struct",
        "A struct is a plain value of fixed size, declared once for the whole machine. Its name is CamelCase. Its "
        "members become fields of a ROS message, in lower case, and are numbers, bools, arrays of them, or other structs "
        "without recursion. It becomes a C struct and a ROS message.",
        Kind.JSON,
        '"structs": {"Goal": {"position": "f64[3] m", "speed": "f64 m/s", "next": "Goal"}}',
        '"structs": {"Goal": {"position": "f64[3] m", "speed": "f64 m/s"}}',
    ),
    "E233": Code(
        "a target that cannot be linked",
        "A target lists the link inputs of the machine's externs on one kind of computer: C files, include folders"
        " and static libraries inside the machine's folder, and libraries by their linker names. The option "
        "--target (in CMake: TARGET) selects the target to build; the default is `simulation`. A machine with "
        "`targets` must define the selected one.",
        Kind.JSON,
        '"targets": {"simulation": {"libraries": ["-lgpiod"]}}',
        '"targets": {"simulation": {"libraries": ["gpiod"]}}',
    ),
    "E234": Code(
        "a frozen name that is not a parameter",
        "`frozen` names parameters of this instance (or is true, for all of them). The compiler folds their values"
        " into the code, and hosts can no longer set them.",
        Kind.JSON,
        '"instances": {\n'
        '  "nav": {"algorithm": "Nav"},\n'
        '  "control": {"algorithm": "Control", "parameters": {"gain": 2.0}, "frozen": ["gian"]}\n'
        "}",
        '"instances": {\n'
        '  "nav": {"algorithm": "Nav"},\n'
        '  "control": {"algorithm": "Control", "parameters": {"gain": 2.0}, "frozen": ["gain"]}\n'
        "}",
    ),
    "E235": Code(
        "an instance published twice",
        "`publish` lists the instances whose outputs become ROS 2 messages and topics, each once. Without "
        "`publish` all instances are published. Every instance is recorded in both cases.",
        Kind.JSON,
        '"publish": ["nav", "nav"]',
        '"publish": ["nav", "control"]',
    ),
    "E240": Code(
        "an input that nothing feeds",
        "An input without connection or channel is a host input. It stays zero until a test, an operator or a "
        "simulation writes it. With --strict each host input must be listed in the `inputs` of its instance with "
        "its initial value, so that a forgotten connection is detected. List the input, connect it, or bind a "
        "sensor channel to it.",
        Kind.STRICT,
        '"instances": {\n'
        '  "nav": {"algorithm": "Nav"},\n'
        '  "control": {"algorithm": "Control", "parameters": {"gain": 2.0},\n'
        '              "inputs": {"rate": [0.0, 0.0, 0.0], "mode": 0, "armed": false,\n'
        '                         "height": 0.0, "dt": 0.01}}\n'
        "}",
        '"instances": {\n'
        '  "nav": {"algorithm": "Nav", "inputs": {"pressure": 101325.0}},\n'
        '  "control": {"algorithm": "Control", "parameters": {"gain": 2.0},\n'
        '              "inputs": {"rate": [0.0, 0.0, 0.0], "mode": 0, "armed": false,\n'
        '                         "height": 0.0, "dt": 0.01}}\n'
        "}",
    ),
    "E242": Code(
        "an invalid selection of instances",
        "A subset machine (`fcsl build --instances`, `AlgTwin.from_instances`) has one or more instances of a "
        "machine, each named once. At least one state must schedule one of them; without a schedule there is no "
        "tick.",
        Kind.COMMAND,
        "fcsl build craft.json --instances nav,nav",
        "fcsl build craft.json --instances nav,control",
    ),
    "E243": Code(
        "an instance of `always` in the schedule of a state",
        "`always` lists instances that every state runs at one rate. A state must not list such an instance again."
        " An instance whose rate differs between states must be listed in each of them instead.",
        Kind.JSON,
        '"always": {"nav": 100},\n"states": {"COAST": {"schedule": {"nav": 100, "control": 50}}, "SAFE": {}}',
        '"always": {"nav": 100},\n"states": {"COAST": {"schedule": {"control": 50}}, "SAFE": {}}',
    ),
    "E244": Code(
        "a time that is not a whole number of ticks",
        "A machine makes decisions once per tick, so a state lasts a whole number of ticks. The time of `after_s` "
        "is taken exactly as written and never rounded.",
        Kind.JSON,
        '"transitions": [{"from": "COAST", "to": "SAFE", "after_s": 2.125}]',
        '"transitions": [{"from": "COAST", "to": "SAFE", "after_s": 2.12}]',
    ),
    "E245": Code(
        "a field that a view cannot show",
        "`views` draws numbers and bools. A struct is named by its member, an element of an array by a constant index. "
        "`angles` and `attitude` take quaternions, `position` an array of 3 or three scalars. States and healths are "
        "drawn without being named.",
        Kind.JSON,
        '"views": {"panels": [{"title": "goal", "command": ["control.state.goal"]}]}',
        '"views": {"panels": [{"title": "goal", "command": ["control.state.goal.position"]}]}',
    ),
    "E246": Code(
        "a panel that cannot be drawn",
        "A panel has a title and 1 to 8 curves, of which an array of n is n. More cannot be told apart. There are 1 to "
        "16 panels.",
        Kind.JSON,
        '"views": {"panels": [{"title": "altitude"}]}',
        '"views": {"panels": [{"title": "altitude", "estimate": ["nav.outputs.altitude"]}]}',
    ),
    "E247": Code(
        "two units on one axis",
        "The curves of a panel share its vertical axis, so all that declare a unit declare the same one. A position is "
        "in m, a thrust in N.",
        Kind.JSON,
        '"views": {"panels": [{"title": "altitude", "values": ["nav.outputs.altitude", "nav.outputs.speed"]}]}',
        '"views": {"panels": [{"title": "altitude", "values": ["nav.outputs.altitude"]},\n'
        '                     {"title": "speed", "values": ["nav.outputs.speed"]}]}',
    ),
    "E248": Code(
        "an output that cannot arm",
        "`arm` names the one bool output that says whether the actuators may act: true arms them, false holds them at "
        "their safe values. Let an algorithm make this decision, in one place.",
        Kind.JSON,
        '"arm": "control.steps",\n'
        '"channels": [{"name": "force", "id": 1, "field": "control.outputs.force", "direction": "actuator", "safe": 0.0}],\n'
        '"states": {"COAST": {"schedule": {"nav": 100, "control": 50}}, "SAFE": {"schedule": {"nav": 10, "control": 10}}}',
        '"arm": "control.ready",\n'
        '"channels": [{"name": "force", "id": 1, "field": "control.outputs.force", "direction": "actuator", "safe": 0.0}],\n'
        '"states": {"COAST": {"schedule": {"nav": 100, "control": 50}}, "SAFE": {"schedule": {"nav": 10, "control": 10}}}',
    ),
    "E249": Code(
        "an actuator without a safe value",
        "While a machine with `arm` is disarmed, and after `command_timeout_s` without a command, every actuator gets "
        "its `safe` value. No value is safe for all of them: 0 closes one valve and opens another. So each channel says "
        "its own, of the type and shape of its field.",
        Kind.JSON,
        '"command_timeout_s": 0.1,\n'
        '"channels": [{"name": "force", "id": 1, "field": "control.outputs.force", "direction": "actuator"}]',
        '"command_timeout_s": 0.1,\n'
        '"channels": [{"name": "force", "id": 1, "field": "control.outputs.force", "direction": "actuator", "safe": 0.0}]',
    ),
    "E250": Code(
        "a field that is not what its channel says",
        "`as` says what a field is for the other end of a wire. A quaternion is an f64[4] or f32[4], its scalar part "
        "first. A blob is a u32[1 + N] for up to N bytes: element 0 is their number, and each of them has an element "
        "behind it. So is its `safe` value. A blob has no ROS message.",
        Kind.JSON,
        '"channels": [{"name": "force", "id": 1, "field": "control.outputs.force", "direction": "actuator",\n'
        '              "as": "quaternion"}]',
        '"channels": [{"name": "force", "id": 1, "field": "control.outputs.force", "direction": "actuator"}]',
    ),
    "E251": Code(
        "frames that are no tree",
        "Each of `views.frames` has one parent, and none is its own ancestor. A position is three numbers in m. A rotation "
        "is a unit quaternion w, x, y, z, or `rpy`: roll, pitch and yaw in rad.",
        Kind.JSON,
        '"views": {"panels": [{"title": "altitude", "estimate": ["nav.outputs.altitude"]}],\n'
        '          "frames": [{"frame": "imu_link", "parent": "base_link", "rotation": [0.0, 0.0, 0.0, 0.0]}]}',
        '"views": {"panels": [{"title": "altitude", "estimate": ["nav.outputs.altitude"]}],\n'
        '          "frames": [{"frame": "imu_link", "parent": "base_link", "rotation": [1.0, 0.0, 0.0, 0.0]}]}',
    ),
    "E252": Code(
        "an expression of constants that has no value",
        "`constants` names numbers with a unit, in this file or in one that simulations name, too. Where a number is "
        "written, a string may be an expression of them: `2 * base`. Each constant is made of those before it. A unit that "
        "follows is that which the constant declares, and that of the field that it becomes, if both have one. Literals as "
        "factors convert no unit; a constant without a unit may.",
        Kind.JSON,
        '"constants": {"base": {"value": 4.0, "unit": "N*s/m"}},\n'
        '"instances": {"nav": {"algorithm": "Nav"}, "control": {"algorithm": "Control", "parameters": {"gain": "bass / 2"}}}',
        '"constants": {"base": {"value": 4.0, "unit": "N*s/m"}},\n'
        '"instances": {"nav": {"algorithm": "Nav"}, "control": {"algorithm": "Control", "parameters": {"gain": "base / 2"}}}',
    ),
    "E253": Code(
        "a column that cannot be read",
        "In the place of a list of numbers, the column of a CSV file may stand: its first line has the names of the columns, "
        "every other line one number for each. The file lies in the folder of the file that names it or below, or in a "
        "package (package://…).",
        Kind.JSON,
        '"instances": {"nav": {"algorithm": "Nav"}, "control": {"algorithm": "Control", "parameters": {"gain": 2.0},\n'
        '              "inputs": {"rate": {"csv": "no_such.csv", "column": "rate"}}}}',
        '"instances": {"nav": {"algorithm": "Nav"}, "control": {"algorithm": "Control", "parameters": {"gain": 2.0},\n'
        '              "inputs": {"rate": [0.0, 0.0, 1.0]}}}',
    ),
    "E254": Code(
        "a machine that cannot be a part as it stands",
        "A machine among the instances is a part: it has one state, no channels and no transitions, and rates in Hz. It is "
        "scheduled as a whole, by `true`: each of its instances runs at its own rate, which divides the tick_hz of the "
        "machine. A phase is converted to ticks of the machine. Only what its `ports` list can be named from outside.",
        Kind.JSON,
        '"instances": {"nav": {"algorithm": "Nav"}, "control": {"algorithm": "Control", "parameters": {"gain": 2.0}},\n'
        '              "lights": {"machine": "part.json", "requests": {"DONE": "ABORT"}}},\n'
        '"states": {"COAST": {"schedule": {"nav": 100, "control": 50, "lights": 50}}, "SAFE": {"schedule": {"nav": 10}}}',
        '"instances": {"nav": {"algorithm": "Nav"}, "control": {"algorithm": "Control", "parameters": {"gain": 2.0}},\n'
        '              "lights": {"machine": "part.json", "requests": {"DONE": "ABORT"}}},\n'
        '"states": {"COAST": {"schedule": {"nav": 100, "control": 50, "lights": true}}, "SAFE": {"schedule": {"nav": 10}}}',
    ),
    "E255": Code(
        "two structs of one name",
        "The structs of a machine and of its parts have one table: a value may go from one to the other. Two of the same "
        "name have the same members, types and units.",
        Kind.JSON,
        '"structs": {"Goal": {"position": "f64[3] m", "speed": "f64 m/s"}, "Order": {"number": "i32"}},\n'
        '"instances": {"nav": {"algorithm": "Nav"}, "control": {"algorithm": "Control", "parameters": {"gain": 2.0}},\n'
        '              "lights": {"machine": "part.json", "requests": {"DONE": "ABORT"}}},\n'
        '"always": {"lights": true}',
        '"structs": {"Goal": {"position": "f64[3] m", "speed": "f64 m/s"}, "Order": {"word": "TransitionRequest"}},\n'
        '"instances": {"nav": {"algorithm": "Nav"}, "control": {"algorithm": "Control", "parameters": {"gain": 2.0}},\n'
        '              "lights": {"machine": "part.json", "requests": {"DONE": "ABORT"}}},\n'
        '"always": {"lights": true}',
    ),
    "E256": Code(
        "a request of a part without a name",
        "A part lists in `requests` all that its algorithms may request. The machine that it is in says what each is called "
        "there, each by another name. The code of a helper cannot name one, because other algorithms call it, too.",
        Kind.JSON,
        '"instances": {"nav": {"algorithm": "Nav"}, "control": {"algorithm": "Control", "parameters": {"gain": 2.0}},\n'
        '              "lights": {"machine": "part.json"}},\n'
        '"always": {"lights": true}',
        '"instances": {"nav": {"algorithm": "Nav"}, "control": {"algorithm": "Control", "parameters": {"gain": 2.0}},\n'
        '              "lights": {"machine": "part.json", "requests": {"DONE": "ABORT"}}},\n'
        '"always": {"lights": true}',
    ),
    "E257": Code(
        "a requirement that cannot be evaluated",
        "A requirement has an id, a text, and one condition: `then`, `never` or `at_end`; with `when`, only where that holds. "
        "A condition is an expression over fields of the machine, with the functions of the ticks so far (`held`, `since`, "
        "`within` …). Units and kinds must fit, times are whole numbers of ticks, and it must read a field. One that acts, by an `effect` "
        "or as the guard of a transition, is judged in each tick, and does not read what it changes.",
        Kind.JSON,
        '"requirements": [{"id": "NAV-1", "text": "It climbs slower than 50 m/s.", "then": "nav.outputs.speed < 50.0",\n'
        '                  "never": "nav.outputs.speed > 50.0"}]',
        '"requirements": [{"id": "NAV-1", "text": "It climbs slower than 50 m/s.", "then": "nav.outputs.speed < 50.0"}]',
    ),
    "W201": Code(
        "an algorithm without an instance",
        "The algorithm is checked, but is not part of the machine. Usually its instance was removed or never added.",
        Kind.JSON,
        '"algorithms": {"Nav": {"source": "nav.py"}, "Control": {"source": "control.py"},\n'
        '               "Spare": {"source": "nav.py", "class": "Nav"}}',
        '"algorithms": {"Nav": {"source": "nav.py"}, "Control": {"source": "control.py"}}',
    ),
    "W202": Code(
        "a transition that no algorithm requests",
        "No instance makes this request, so only a host (an operator, a test) can cause the transition. This may "
        "be intended; otherwise the request in the algorithm has another name.",
        Kind.JSON,
        '"transitions": [{"from": "COAST", "to": "SAFE", "request": "LAND"}]',
        '"transitions": [{"from": "COAST", "to": "SAFE", "health": {"instance": "nav", "in": ["failed"]}}]',
    ),
    "W203": Code(
        "a state that no transition reaches",
        "No sequence of transitions leads from the initial state to this state; only a host can set it. A safe "
        "state that cannot be reached gives no protection.",
        Kind.JSON,
        '"transitions": []',
        '"transitions": [{"from": "COAST", "to": "SAFE", "health": {"instance": "nav", "in": ["failed"]}}]',
    ),
    "W204": Code(
        "an instance that never runs",
        "No state schedules the instance. Its outputs stay zero and its health stays stale. If one of its outputs is "
        "`arm`, the actuators are never armed.",
        Kind.JSON,
        '"states": {"COAST": {"schedule": {"nav": 100}}, "SAFE": {"schedule": {"nav": 10}}}',
        '"states": {"COAST": {"schedule": {"nav": 100, "control": 50}}, "SAFE": {"schedule": {"nav": 10}}}',
    ),
    "W205": Code(
        'a "*" without any state',
        '"*" means every state except the target. If the target is the only state of the machine, the transition '
        "is never taken.",
        Kind.JSON,
        '"states": {"COAST": {"schedule": {"nav": 100, "control": 50}}},\n'
        '"transitions": [{"from": "*", "to": "COAST", "health": {"instance": "nav", "in": ["failed"]}}]',
        '"states": {"COAST": {"schedule": {"nav": 100, "control": 50}}, "SAFE": {"schedule": {"nav": 10}}},\n'
        '"transitions": [{"from": "*", "to": "SAFE", "health": {"instance": "nav", "in": ["failed"]}}]',
    ),
    "W206": Code(
        "a value from another state",
        "An instance that a state does not schedule keeps its outputs. A reader that runs in that state gets these"
        " old values and cannot detect this, unless it also reads the health of the source, which is stale until "
        "the source runs in this state.",
        Kind.JSON,
        '"states": {"COAST": {"schedule": {"nav": 100, "control": 50}}, "SAFE": {"schedule": {"control": 50}}},\n'
        '"connections": [{"from": "nav.altitude", "to": "control.height"}]',
        '"states": {"COAST": {"schedule": {"nav": 100, "control": 50}}, "SAFE": {"schedule": {"nav": 100, "control": 50}}},\n'
        '"connections": [{"from": "nav.altitude", "to": "control.height"}]',
    ),
    "W207": Code(
        "machine.dt in an instance that is slower than the tick",
        "`machine.dt` is 1 / tick_hz for every instance. An integrator or filter that runs in every fourth tick "
        "and uses it as its period is four times too slow. Connect `machine.period`, the time between two runs.",
        Kind.JSON,
        '"connections": [{"from": "machine.dt", "to": "control.dt"}]',
        '"connections": [{"from": "machine.period", "to": "control.dt"}]',
    ),
    "W208": Code(
        "requests that are not listed",
        "A machine without `transitions` and without `requests`, such as the fixture of a unit test, accepts every"
        " request that its algorithms name. A misspelt request would not be detected. List the names to have them "
        "checked.",
        Kind.JSON,
        '"algorithms": {"Pilot": {"source": "pilot.py"}},\n'
        '"instances": {"pilot": {"algorithm": "Pilot", "parameters": {"on_done": "ABORT"}}},\n'
        '"connections": [],\n'
        '"states": {"COAST": {"schedule": {"pilot": 100}}},\n'
        '"transitions": [],\n'
        '"requests": []',
        '"algorithms": {"Pilot": {"source": "pilot.py"}},\n'
        '"instances": {"pilot": {"algorithm": "Pilot", "parameters": {"on_done": "ABORT"}}},\n'
        '"connections": [],\n'
        '"states": {"COAST": {"schedule": {"pilot": 100}}},\n'
        '"transitions": [],\n'
        '"requests": ["ABORT"]',
    ),
    "W209": Code(
        "a guard on an instance that is always stale",
        "None of the states that this transition leaves schedules the instance, so the instance is stale there. A "
        "guard with `stale` is then true in every tick, a guard without it in none. A requirement that reads the "
        'instance is not evaluated there, unless it says `"stale": "hold"`.',
        Kind.JSON,
        '"transitions": [\n'
        '  {"from": "COAST", "to": "SAFE", "health": {"instance": "nav", "in": ["failed"]}},\n'
        '  {"from": "SAFE", "to": "COAST", "health": {"instance": "control", "in": ["nominal"]}}\n'
        "]",
        '"transitions": [\n'
        '  {"from": "COAST", "to": "SAFE", "health": {"instance": "nav", "in": ["failed"]}},\n'
        '  {"from": "SAFE", "to": "COAST", "health": {"instance": "nav", "in": ["nominal"]}}\n'
        "]",
    ),
    "W210": Code(
        "a request that no running instance makes",
        "Only running instances can make requests. None of the states that this transition leaves schedules an "
        "instance that makes this request. Only a host can cause the transition.",
        Kind.JSON,
        '"algorithms": {"Nav": {"source": "nav.py"}, "Pilot": {"source": "pilot.py"}},\n'
        '"instances": {"nav": {"algorithm": "Nav"}, "pilot": {"algorithm": "Pilot", "parameters": {"on_done": "ABORT"}}},\n'
        '"connections": [],\n'
        '"states": {"COAST": {"schedule": {"nav": 100}}, "SAFE": {"schedule": {"nav": 10, "pilot": 10}}},\n'
        '"transitions": [{"from": "COAST", "to": "SAFE", "request": "ABORT"}]',
        '"algorithms": {"Nav": {"source": "nav.py"}, "Pilot": {"source": "pilot.py"}},\n'
        '"instances": {"nav": {"algorithm": "Nav"}, "pilot": {"algorithm": "Pilot", "parameters": {"on_done": "ABORT"}}},\n'
        '"connections": [],\n'
        '"states": {"COAST": {"schedule": {"nav": 100, "pilot": 10}}, "SAFE": {"schedule": {"nav": 10}}},\n'
        '"transitions": [{"from": "COAST", "to": "SAFE", "request": "ABORT"}]',
    ),
    "W211": Code(
        "a transition that is never taken",
        "A timed transition without request and guard always ends its state. A transition with a longer time, or "
        "with an equal time and a smaller priority, is therefore never taken.",
        Kind.JSON,
        '"transitions": [\n'
        '  {"from": "COAST", "to": "SAFE", "after_s": 5.0, "priority": 1},\n'
        '  {"from": "COAST", "to": "SAFE", "after_s": 8.0, "priority": 2, "health": {"instance": "nav", "in": ["failed"]}}\n'
        "]",
        '"transitions": [\n'
        '  {"from": "COAST", "to": "SAFE", "after_s": 8.0, "priority": 1},\n'
        '  {"from": "COAST", "to": "SAFE", "after_s": 5.0, "priority": 2, "health": {"instance": "nav", "in": ["failed"]}}\n'
        "]",
    ),
    "W212": Code(
        "an output that arms and does not run in every state",
        "An instance that a state does not schedule keeps its outputs. If one of them is `arm`, the actuators stay armed "
        "or disarmed in that state as another state left them, whatever happens. Schedule the instance in every state, "
        "or let an instance arm that runs in all.",
        Kind.JSON,
        '"arm": "control.ready",\n'
        '"channels": [{"name": "force", "id": 1, "field": "control.outputs.force", "direction": "actuator", "safe": 0.0}],\n'
        '"states": {"COAST": {"schedule": {"nav": 100, "control": 50}}, "SAFE": {"schedule": {"nav": 10}}}',
        '"arm": "control.ready",\n'
        '"channels": [{"name": "force", "id": 1, "field": "control.outputs.force", "direction": "actuator", "safe": 0.0}],\n'
        '"states": {"COAST": {"schedule": {"nav": 100, "control": 50}}, "SAFE": {"schedule": {"nav": 10, "control": 10}}}',
    ),
    "W213": Code(
        "a guard that may be true because a state has just been entered",
        "An instance that a state starts is stale until it first runs there. If it is slower than the tick, this takes "
        "between zero ticks and its period, depending on the tick in which the state is entered. A guard with `stale` "
        "then leaves the state at once, or not at all. With an `after_s` of at least one period, the instance has run "
        "before the guard counts.",
        Kind.JSON,
        '"states": {"COAST": {"schedule": {"control": 50}}, "SAFE": {"schedule": {"nav": 10}}},\n'
        '"connections": [],\n'
        '"transitions": [\n'
        '  {"from": "COAST", "to": "SAFE", "health": {"instance": "control", "in": ["failed"]}},\n'
        '  {"from": "SAFE", "to": "COAST", "health": {"instance": "nav", "in": ["failed", "stale"]}}\n'
        "]",
        '"states": {"COAST": {"schedule": {"control": 50}}, "SAFE": {"schedule": {"nav": 10}}},\n'
        '"connections": [],\n'
        '"transitions": [\n'
        '  {"from": "COAST", "to": "SAFE", "health": {"instance": "control", "in": ["failed"]}},\n'
        '  {"from": "SAFE", "to": "COAST", "after_s": 0.1, "health": {"instance": "nav", "in": ["failed", "stale"]}}\n'
        "]",
    ),
    "W214": Code(
        "a request that leads round a circle of states",
        "With --strict. The same request has transitions from one state to another and back, the instance that makes it "
        "runs in both, and makes it by the level of its inputs: it keeps nothing from one run to the next. As long as an "
        "input such as a switch lasts, the state then changes in each run of the instance. Make the request in one run "
        "only, when the input changes, with its last value in `state`. Or use one request for each direction. There is "
        "no warning if each of the transitions has an `after_s`.",
        Kind.STRICT,
        '"algorithms": {"Pilot": {"source": "pilot.py"}},\n'
        '"instances": {"pilot": {"algorithm": "Pilot", "parameters": {"on_done": "ABORT"}}},\n'
        '"connections": [],\n'
        '"states": {"COAST": {"schedule": {"pilot": 100}}, "SAFE": {"schedule": {"pilot": 10}}},\n'
        '"transitions": [\n'
        '  {"from": "COAST", "to": "SAFE", "request": "ABORT"},\n'
        '  {"from": "SAFE", "to": "COAST", "request": "ABORT"}\n'
        "]",
        '"algorithms": {"Pilot": {"source": "pilot.py"}},\n'
        '"instances": {"pilot": {"algorithm": "Pilot", "parameters": {"on_done": "ABORT"}}},\n'
        '"connections": [],\n'
        '"states": {"COAST": {"schedule": {"pilot": 100}}, "SAFE": {"schedule": {"pilot": 10}}},\n'
        '"transitions": [{"from": "COAST", "to": "SAFE", "request": "ABORT"}]',
    ),
}

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
        "folder of that JSON, not to the folder in which the compiler was started, so that a machine compiles "
        "from anywhere.",
        Kind.JSON,
        '"algorithms": {"Nav": {"source": "navigation.py"}, "Control": {"source": "control.py"}}',
        '"algorithms": {"Nav": {"source": "nav.py"}, "Control": {"source": "control.py"}}',
    ),
    "E101": Code(
        "not JSON",
        "The file is read as RFC 8259 says: double quotes, no comments, no comma before a closing bracket, no "
        "NaN or Infinity, numbers that fit f64. Extensions that one tool reads and another does not would let "
        "two tools see two machines.",
        Kind.TEXT,
        '{\n  "tick_hz": 100,\n}',
        _SMALLEST,
    ),
    "E102": Code(
        "a key given twice",
        "Most JSON readers silently keep the last of two equal keys. A gain that is set at the top of the file "
        "and again below it would fly with the value that the reviewer did not look at.",
        Kind.TEXT,
        _SMALLEST.replace('"tick_hz": 100,', '"tick_hz": 100,\n  "tick_hz": 50,'),
        _SMALLEST,
    ),
    "E103": Code(
        "a source outside the machine's folder",
        "A machine is its folder: what is copied, reviewed and hashed together. A source therefore lies inside "
        "it, also after symbolic links, or comes from an installed ROS package, named package://<package>/<path>.",
        Kind.JSON,
        '"algorithms": {"Nav": {"source": "../shared/nav.py"}, "Control": {"source": "control.py"}}',
        '"algorithms": {"Nav": {"source": "nav.py"}, "Control": {"source": "control.py"}}',
    ),
    "E104": Code(
        "a simulation where a machine is needed",
        "A `*.sim.json` describes a flight: models, their connections to a controller, a duration. The "
        "controller is a machine in a JSON file of its own, which flies unchanged in the simulator and on "
        "hardware.",
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
    "E201": Code(
        "an unknown key",
        "A misspelt optional key that is ignored means that the machine does not do what its file says: a "
        "`max_wcet_us` written `max_wcet` would watch nothing.",
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
        "What the machine cannot run without has no default: a rate or a first state that somebody else chose is "
        "a surprise in flight.",
        Kind.JSON,
        '"connections": [{"from": "nav.speed"}]',
        '"connections": [{"from": "nav.speed", "to": "control.speed"}]',
    ),
    "E203": Code(
        "not a name",
        "Names become C identifiers, paths of fields, ROS topics and file names. Letters, digits and single "
        "underscores survive all of them. The machine's own name is its file's, in lower_snake_case; a channel's "
        "name is lower case with dots.",
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
        "Each number of the machine has a range in which it means something: a phase lies before the next period "
        "begins, a channel's id fits the wire's 16 bits, a parameter lies in the range that its algorithm declares.",
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
        "Some keys take one of a few words, such as the direction of a channel or a health.",
        Kind.JSON,
        '"channels": [{"name": "pressure", "id": 1, "field": "nav.inputs.pressure", "direction": "input"}]',
        '"channels": [{"name": "pressure", "id": 1, "field": "nav.inputs.pressure", "direction": "sensor"}]',
    ),
    "E206": Code(
        "a name that nothing has",
        "The machine refers to an algorithm, instance, state or `machine` source that is not in the file. Often "
        "a slip of the pen, or a leftover of a renaming.",
        Kind.JSON,
        '"initial_state": "CRUISE"',
        '"initial_state": "COAST"',
    ),
    "E207": Code(
        "a value of another type than its field",
        "Values are bound as they are written, without conversion: a parameter of type f64 takes a finite number, an "
        "f64[3] a list of exactly three, a Health one of its words. A list of the wrong length usually belongs to "
        "another vehicle.",
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
        "An object, list, string or number stands where the machine needs another of them.",
        Kind.JSON,
        '"connections": {"from": "nav.speed", "to": "control.speed"}',
        '"connections": [{"from": "nav.speed", "to": "control.speed"}]',
    ),
    "E209": Code(
        "a reserved name",
        "`machine.dt`, `machine.tick` and the machine's own topics (state, health, channels, …) are paths "
        "already; an instance of the same name would hide them.",
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
        "A value for a port that is not declared would go nowhere: the algorithm would run with another one, or "
        "with zero.",
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
        "Parameters have no defaults, neither in the algorithm nor here: every gain that flies is written down "
        "for this vehicle.",
        Kind.JSON,
        '"instances": {\n  "nav": {"algorithm": "Nav"},\n  "control": {"algorithm": "Control"}\n}',
        '"instances": {\n'
        '  "nav": {"algorithm": "Nav"},\n'
        '  "control": {"algorithm": "Control", "parameters": {"gain": 2.0}}\n'
        "}",
    ),
    "E212": Code(
        "an initial value for a connected input",
        "A connection overwrites its input before each run of the instance, so an initial value would never be "
        "seen. Only a `delayed` connection has a first value, its own `initial`.",
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
        "Of two connections to one input, or a connection and a sensor channel, the later would silently win. "
        "Let an algorithm choose between the two, and connect what it chose.",
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
        "A `delayed` connection carries the value of the tick before, so it needs an `initial` for the first "
        "tick, and only it has one. Likewise an age limit belongs to what arrives, a sensor, and not to what is "
        "sent.",
        Kind.JSON,
        '"connections": [{"from": "nav.speed", "to": "control.speed", "delayed": true}]',
        '"connections": [{"from": "nav.speed", "to": "control.speed", "delayed": true, "initial": 0.0}]',
    ),
    "E215": Code(
        "a path to the wrong kind of port",
        "Data flows from outputs to inputs. What another instance needs to know is an output of the one that "
        "knows it; its inputs and its state are its own business.",
        Kind.JSON,
        '"connections": [{"from": "nav.pressure", "to": "control.speed"}]',
        '"connections": [{"from": "nav.speed", "to": "control.speed"}]',
    ),
    "E216": Code(
        "a port that is not declared",
        "The algorithm of this instance has no output (on the left) or input (on the right) of that name.",
        Kind.JSON,
        '"connections": [{"from": "nav.velocity", "to": "control.speed"}]',
        '"connections": [{"from": "nav.speed", "to": "control.speed"}]',
    ),
    "E217": Code(
        "a connection between different types",
        "A connection copies; it converts nothing. Types and shapes of both ends are therefore the same, and a "
        "conversion, with what it loses, stands in an algorithm where it can be read. A channel carries numbers "
        "and bools.",
        Kind.JSON,
        '"connections": [{"from": "nav.mode", "to": "control.speed"}]',
        '"connections": [{"from": "nav.mode", "to": "control.mode"}]',
    ),
    "E218": Code(
        "a connection between different units",
        "Two ports that both declare a unit declare the same one, letter by letter. Metres into feet has cost "
        "vehicles. A port without a unit connects to anything.",
        Kind.JSON,
        '"connections": [{"from": "nav.altitude", "to": "control.speed"}]',
        '"connections": [{"from": "nav.speed", "to": "control.speed"}]',
    ),
    "E219": Code(
        "no state",
        "A machine is always in exactly one of its states; the state says what runs, and how often. A machine "
        "that only runs has one state.",
        Kind.JSON,
        '"states": {},\n"transitions": []',
        '"states": {"COAST": {"schedule": {"nav": 100, "control": 50}}},\n"transitions": []',
    ),
    "E220": Code(
        "a rate that does not divide the tick rate",
        "An instance runs every n-th tick, n whole, so that its period never drifts or jitters. Its rate is "
        "therefore the tick rate divided by an integer.",
        Kind.JSON,
        '"states": {\n  "COAST": {"schedule": {"nav": 100, "control": 30}},\n  "SAFE": {"schedule": {"nav": 10}}\n}',
        '"states": {\n  "COAST": {"schedule": {"nav": 100, "control": 25}},\n  "SAFE": {"schedule": {"nav": 10}}\n}',
    ),
    "E221": Code(
        "a transition that nothing can cause",
        "A transition is taken because an instance requests it, because a health is as its guard says, because its "
        "state has lasted long enough, or for several of these together. One with none of them, or with a guard that "
        "lists no health, would be taken at once or never; say which event it answers.",
        Kind.JSON,
        '"transitions": [{"from": "COAST", "to": "SAFE"}]',
        '"transitions": [{"from": "COAST", "to": "SAFE", "health": {"instance": "nav", "in": ["failed"]}}]',
    ),
    "E222": Code(
        "a transition from a state to itself",
        "It would change nothing: the state and all its instances go on. Count or reset in the algorithm's own state "
        "instead.",
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
        "source states of a transition that are none, or double",
        '`from` names a state, a list of different states, or "*" for every state but the target.',
        Kind.JSON,
        '"transitions": [{"from": ["COAST", "COAST"], "to": "SAFE", "health": {"instance": "nav", "in": ["failed"]}}]',
        '"transitions": [{"from": ["COAST"], "to": "SAFE", "health": {"instance": "nav", "in": ["failed"]}}]',
    ),
    "E224": Code(
        "transitions of equal or missing priority",
        "When two transitions of the active state hold in the same tick, exactly one is taken: the one with the "
        "larger priority. Where a state has several, each therefore has a priority of its own; the order in the "
        "file decides nothing.",
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
        "a request that no transition knows",
        "A request literal that no transition of the machine answers would never do anything. If this machine "
        "deliberately does not answer it (an algorithm shared between vehicles), list the name under `requests`.",
        Kind.BODY,
        'if self.speed > 9.0:\n    self.transition_request = "ABROT"',
        'if self.speed > 9.0:\n    self.transition_request = "ABORT"',
    ),
    "E226": Code(
        "two channels that share a name, an id or a field",
        "Names never travel on the wire, ids do, and every transport derives from this one table. A second "
        "channel of the same id, name or field would make it say two things about one value.",
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
        "A sensor writes before the instance runs; an algorithm that assigns the same output would overwrite the "
        "measurement. A source block declares the output and leaves it alone.",
        Kind.JSON,
        '"channels": [{"name": "altitude", "id": 1, "field": "nav.outputs.altitude", "direction": "sensor"}]',
        '"channels": [{"name": "pressure", "id": 1, "field": "nav.inputs.pressure", "direction": "sensor"}]',
    ),
    "E228": Code(
        "a cycle of connections",
        "Within a tick every instance runs after those whose outputs it reads. Around a cycle each would have to "
        "run before itself. Mark one connection `delayed`: it carries the value of the tick before, and its "
        "delay is then visible in the file and in the loop's phase margin.",
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
        "Names that differ in the source can be one name in C or in a ROS message: instances `aft_rcs` and "
        "`aftRcs` would both be message AftRcs.",
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
        "A library may hold several machines; each is found by the stem of its file, which therefore occurs once. "
        "Two machines must not produce the same C function name. Example: machine a_b with instance c, and machine a "
        "with instance b_c.",
        Kind.COMMAND,
        "fcslc build left/craft.json right/craft.json",
        "fcslc build left/craft.json right/tug.json",
    ),
    "E232": Code(
        "a struct that cannot be",
        "A struct is a plain value of fixed size, declared once for the whole machine: CamelCase, with members "
        "in lower_snake_case that are numbers, bools, arrays of them, or structs that do not contain it again. "
        "It becomes a C struct and a ROS message.",
        Kind.JSON,
        '"structs": {"Goal": {"position": "f64[3] m", "speed": "f64 m/s", "next": "Goal"}}',
        '"structs": {"Goal": {"position": "f64[3] m", "speed": "f64 m/s"}}',
    ),
    "E233": Code(
        "a target that cannot be linked",
        "A target lists what the machine's externs are linked from on one kind of computer: C files, include "
        "folders and static libraries inside the machine's folder, and libraries by the name the linker knows. "
        "What is built is the target that --target (in CMake: TARGET) names, else `simulation`; a machine with "
        "`targets` has it.",
        Kind.JSON,
        '"targets": {"simulation": {"libraries": ["-lgpiod"]}}',
        '"targets": {"simulation": {"libraries": ["gpiod"]}}',
    ),
    "E234": Code(
        "something frozen that is no parameter",
        "`frozen` names parameters of this instance (or is true, for all of them): the compiler folds their "
        "values into the code, and no host can set them any more.",
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
        "`publish` lists the instances whose outputs become ROS 2 messages and topics, each once. Without it all do; "
        "every instance is recorded either way.",
        Kind.JSON,
        '"publish": ["nav", "nav"]',
        '"publish": ["nav", "control"]',
    ),
    "E240": Code(
        "an input that nothing feeds",
        "An input without connection or channel is a host input: it stays zero until a test, an operator or a "
        "simulation writes it. With --strict each of them stands in the `inputs` of its instance, with its "
        "initial value, so that a forgotten connection does not pass for one. List the input, connect it, or "
        "bind a sensor channel to it.",
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
        "instances that are no machine of their own",
        "A subset machine (`fcslc build --instances`, `AlgTwin.from_instances`) has one or more instances of a machine, each "
        "named once, and at least one of them runs in some state: what nothing schedules has no tick.",
        Kind.COMMAND,
        "fcslc build craft.json --instances nav,nav",
        "fcslc build craft.json --instances nav,control",
    ),
    "E243": Code(
        "an instance of `always` in the schedule of a state",
        "`always` lists what every state runs, at one rate. A state that lists such an instance again could only say "
        "the same or contradict it. An instance whose rate differs between states is listed in each of them.",
        Kind.JSON,
        '"always": {"nav": 100},\n"states": {"COAST": {"schedule": {"nav": 100, "control": 50}}, "SAFE": {}}',
        '"always": {"nav": 100},\n"states": {"COAST": {"schedule": {"control": 50}}, "SAFE": {}}',
    ),
    "E244": Code(
        "a time that is no whole number of ticks",
        "A machine decides once in a tick, so a state lasts a whole number of ticks. `after_s` is not rounded: it "
        "must be a whole number of ticks as its decimals are written.",
        Kind.JSON,
        '"transitions": [{"from": "COAST", "to": "SAFE", "after_s": 2.125}]',
        '"transitions": [{"from": "COAST", "to": "SAFE", "after_s": 2.12}]',
    ),
    "W201": Code(
        "an algorithm without an instance",
        "It is checked and then not part of the machine. Usually its instance was removed, or was never added.",
        Kind.JSON,
        '"algorithms": {"Nav": {"source": "nav.py"}, "Control": {"source": "control.py"},\n'
        '               "Spare": {"source": "nav.py", "class": "Nav"}}',
        '"algorithms": {"Nav": {"source": "nav.py"}, "Control": {"source": "control.py"}}',
    ),
    "W202": Code(
        "a transition that no algorithm requests",
        "No instance ever makes this request, so only a host (an operator, a test) can cause the transition. "
        "That may be meant; otherwise the request in the algorithm has another name.",
        Kind.JSON,
        '"transitions": [{"from": "COAST", "to": "SAFE", "request": "LAND"}]',
        '"transitions": [{"from": "COAST", "to": "SAFE", "health": {"instance": "nav", "in": ["failed"]}}]',
    ),
    "W203": Code(
        "a state that no transition reaches",
        "From the initial state no sequence of transitions leads here; only a host can set it. A safe state that "
        "cannot be reached protects nothing.",
        Kind.JSON,
        '"transitions": []',
        '"transitions": [{"from": "COAST", "to": "SAFE", "health": {"instance": "nav", "in": ["failed"]}}]',
    ),
    "W204": Code(
        "an instance that never runs",
        "No state schedules it, so its outputs stay zero and its health stale for ever.",
        Kind.JSON,
        '"states": {"COAST": {"schedule": {"nav": 100}}, "SAFE": {"schedule": {"nav": 10}}}',
        '"states": {"COAST": {"schedule": {"nav": 100, "control": 50}}, "SAFE": {"schedule": {"nav": 10}}}',
    ),
    "W205": Code(
        'a "*" that stands for no state',
        '"*" means every state but the target. In a machine whose only state is the target it means none, and '
        "the transition is never taken.",
        Kind.JSON,
        '"states": {"COAST": {"schedule": {"nav": 100, "control": 50}}},\n'
        '"transitions": [{"from": "*", "to": "COAST", "health": {"instance": "nav", "in": ["failed"]}}]',
        '"states": {"COAST": {"schedule": {"nav": 100, "control": 50}}, "SAFE": {"schedule": {"nav": 10}}},\n'
        '"transitions": [{"from": "*", "to": "SAFE", "health": {"instance": "nav", "in": ["failed"]}}]',
    ),
    "W206": Code(
        "a value that another state left",
        "What a state does not schedule keeps its outputs. A reader that runs in that state sees them and cannot "
        "tell that they are old, unless it also reads the writer's health, which is stale until the writer runs "
        "again.",
        Kind.JSON,
        '"states": {"COAST": {"schedule": {"nav": 100, "control": 50}}, "SAFE": {"schedule": {"control": 50}}},\n'
        '"connections": [{"from": "nav.altitude", "to": "control.height"}]',
        '"states": {"COAST": {"schedule": {"nav": 100, "control": 50}}, "SAFE": {"schedule": {"nav": 100, "control": 50}}},\n'
        '"connections": [{"from": "nav.altitude", "to": "control.height"}]',
    ),
    "W207": Code(
        "machine.dt in an instance that is slower than the tick",
        "`machine.dt` is 1 / tick_hz for everybody. An integral or a filter that runs in every fourth tick and "
        "uses it as its own period is four times too slow.",
        Kind.JSON,
        '"connections": [{"from": "machine.dt", "to": "control.dt"}]',
        '"connections": [{"from": "machine.dt", "to": "control.dt"}],\n'
        '"states": {"COAST": {"schedule": {"nav": 100, "control": 100}}, "SAFE": {"schedule": {"nav": 10}}}',
    ),
    "W208": Code(
        "requests that nothing lists",
        "A machine without `transitions` and without `requests`, such as the fixture of a unit test, takes every "
        "request that its algorithms name. List the names; then a misspelt request is an error.",
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
        "a guard over an instance that is always stale there",
        "None of the states that this transition leaves schedules the instance, and what a state does not schedule is stale: "
        "a guard with `stale` holds there in every tick, one without it in none.",
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
        "a request that nobody makes where it is awaited",
        "Only instances that run can request, and none of the states that this transition leaves schedules one that makes this "
        "request. So a host alone can cause it.",
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
        "a transition that comes too late",
        "A timed transition without request and guard always ends its state. A transition with a longer time, or the "
        "same time and a smaller priority, is never taken.",
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
}

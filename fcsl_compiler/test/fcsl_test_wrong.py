# SPDX-License-Identifier: Apache-2.0
"""Small wrong programs and machines, at least one for every diagnostic, and the good ones that they are made from."""

import copy
import json
from collections.abc import Callable, Mapping
from typing import Any

PORTS = """class Inputs:
    x: "f64 m"
    n: "i32"
    v: "f64[3]"
    b: bool
    h: "Health"
class Parameters:
    k: f64
class Outputs:
    y: "f64 s"
    i: "i32"
    v: "f64[3]"
    b: bool
class State:
    s: f64
    g: "Goal"
"""
HEAD = "def execute(u: Inputs, p: Parameters, y: Outputs, x: State) -> None:\n"
GOOD = PORTS + HEAD + "    y.y = u.x * p.k\n"
CONFIG: dict[str, Any] = {
    "tick_hz": 100,
    "initial_state": "A",
    "structs": {"Goal": {"place": "f64[3] m", "speed": "f64 m/s"}},
    "algorithms": {"alg": {"source": "alg.py"}},
    "instances": {
        "one": {"algorithm": "alg", "parameters": {"k": 1.5}},
        "two": {"algorithm": "alg", "parameters": {"k": 2}},
    },
    "connections": [],
    "states": {"A": {"schedule": {"one": 100, "two": 50}}, "B": {"schedule": {}}},
    "transitions": [{"from": "A", "to": "B", "health": {"instance": "one", "in": ["failed"]}}],
    "channels": [],
}


def parameter(text: str) -> str:
    """The algorithm with a parameter of this type."""
    return GOOD.replace("    k: f64\n", f'    k: "{text}"\n')


# Statements of execute.
BODIES: dict[str, str] = {
    "E401 an integer out of range": "y.i = 3000000000",
    "E401 a float where an integer is needed": "y.i = 2.5",
    "E401 two integers divided": "y.y = 1 / 2",
    "E401 a constant division by zero": "y.y = 1.0 / 0.0",
    "E401 not exact": "y.y = 9007199254740993",
    "E402 an i32 where an f64 is needed": "y.y = u.n",
    "E402 a number as condition": "if u.n:\n    y.i = 1",
    "E402 a bool where a number is needed": "y.y = u.b",
    "E402 shapes": "y.v = [1.0, 2.0]",
    "E402 branches of two types": "y.y = u.x if u.b else u.n",
    "E402 elements of two types": "y.v = [u.x, u.n, u.x]",
    "E402 a local of two types": "t = u.n\nt = u.x",
    "E402 a local of a bare literal": "t = 1\nt = u.x\ny.y = t",
    "E415 a sum that began as an integer": "t = 0\nt += u.x\ny.y = t * 2.0",
    "E410 what while assigns": "while u.b:\n    t = 1.0\ny.y = t",
    "E403 assigned on one path": "if u.b:\n    t = 1.0\ny.y = t",
    "E403 a loop that may be left": "for i in range(3):\n    if u.b:\n        break\n    t = 1.0\ny.y = t",
    "E404 a record as value": "y.y = u",
    "E404 a function as value": "y.y = sin",
    "E404 execute called": "y.y = execute(u)",
    "E405 after the loop": "for i in range(3):\n    y.i = i\ny.i = i",
    "E406 a name": "y.y = u.x + foo",
    "E406 a record": "y.y = in_.x",
    "E406 a function": "y.y = len(u.v)",
    "E407 a health": "y.health = Health.fine",
    "E407 stale": "y.health = Health.stale",
    "E408 a field": "y.y = u.xx",
    "E410 while": "while u.b:\n    y.i = 1",
    "E410 a comprehension": "y.v = [i for i in range(3)]",
    "E410 a tuple": "y.v = (1.0, 2.0, 3.0)",
    "E410 a string": 'y.y = "x"',
    "E410 matrix product": "y.v = u.v @ u.v",
    "E410 in": "y.b = u.n in u.v",
    "E410 keyword arguments": "y.y = clamp(u.x, low=0.0, high=1.0)",
    "E410 chained assignment": "y.y = x.s = 1.0",
    "E410 break": "break",
    "E410 continue": "if u.b:\n    continue",
    "E410 try": "try:\n    y.i = 1\nexcept ValueError:\n    y.i = 2",
    "E406 print": "print(u.x)",
    "E406 a function of a module": "y.y = math.sin(u.x) + np.linalg.norm(u.v)",
    "E406 a constant of a module": "y.y = math.pi",
    "E408 the transpose": "y.y = u.v.T",
    "E410 a method": "u.v.append(1.0)",
    "E411 index of a scalar": "y.y = u.x[0]",
    "E411 a float as index": "y.y = u.v[u.x]",
    "E412 constant index": "y.y = u.v[3]",
    "E412 loop index": "for i in range(3, 5):\n    y.y = u.v[i]",
    "E413 product of arrays": "y.v = u.v * u.v",
    "E413 arrays compared": "y.b = u.v == u.v",
    "E413 a builtin on an array": "y.v = sin(u.v)",
    "E414 division by zero": "y.i = u.n // 0",
    "E415 types mixed": "y.y = u.x + u.n",
    "E415 division of integers": "y.y = u.n / u.n",
    "E415 arithmetic on bool": "y.i = u.b + 1",
    "E416 arguments of a builtin": "y.y = clamp(u.x, 1.0)",
    "E416 arguments of a library function": "y.y = dot(u.v)",
    "E417 a size that varies": "t = zeros(u.n)",
    "E418 sizes that do not fit": "y.y = dot(u.v, [1.0, 2.0])",
    "E420 never reached": "return\ny.y = 1.0",
    "E421 unused value": "sin(u.x)",
    "E422 an input": "u.x = 1.0",
    "E422 a loop variable": "for i in range(3):\n    i = 4",
    "E422 a builtin": "sqrt = 2.0",
    "E422 an argument": "u = 1",
    "E423 declared twice": "t: f64 = 1.0\nt: f64 = 2.0",
    "E424 not a range": "for e in u.v:\n    y.y = e",
    "E424 a bound that varies": "for i in range(u.n):\n    y.i = i",
    "E424 too many": "for i in range(20000000):\n    y.i = i32(i)",
    "E425 a result": "return u.x",
    "E434 in an expression": "y.b = u.b and hw_read_gpio(4)",
    "E436 a member that is not there": "x.g = Goal(u.v, sped=1.0)",
    "E436 a member is missing": "x.g = Goal(u.v)",
    "E436 a member twice": "x.g = Goal(u.v, place=u.v)",
    "E437 names and rows": "a, b = u.v",
    "E437 names and values": "a, b = 1, 2, 3",
    "E437 a scalar": "a, b = u.x",
    "E438 beyond the end": "y.v = u.v[1:4]",
    "E438 a step": "y.v[0:2] = u.v[0:3:2]",
    "E438 an end that varies": "y.v[0:2] = u.v[0:u.n]",
    "E439 a shift": "y.i = u.n >> 32",
    "E408 a member": "y.y = x.g.sped",
    "E402 a slice of another shape": "y.v = u.v[0:2]",
    "E415 a signed shift": "y.i = u.n << 1",
    "W302 a fault after a write": "hw_write_gpio(4, u.b)\ny.i = u.n + 1",
}

# Whole files.
ALGORITHMS: dict[str, str] = {
    "E110 syntax": "def execute(:\n    pass\n",
    "E110 nested without end": GOOD + "K = " + "-" * 50000 + "1\n",
    "E110 nested": "class Outputs:\n    y: f64\ndef execute(y: Outputs) -> None:\n    y.y = " + "-" * 120 + "1.0\n",
    "E111 a Greek letter": "class Outputs:\n    y: f64\ndef execute(y: Outputs) -> None:\n    θ = 1.0\n    y.y = θ\n",
    "E301 not a type": "class Outputs:\n    y: float\ndef execute(y: Outputs) -> None:\n    y.y = 1.0\n",
    "E301 a size": 'class Outputs:\n    y: "f64[n]"\ndef execute(y: Outputs) -> None:\n    y.y[0] = 1.0\n',
    "E301 a request": "class Inputs:\n    r: TransitionRequest\ndef execute(u: Inputs) -> None:\n    pass\n",
    "E302 a port twice": PORTS + "    s: f64\n" + HEAD + "    pass\n",
    "E302 a class twice": "class State:\n    s: f64\n" + GOOD,
    "E302 a function and a constant": GOOD + "def f() -> f64:\n    return 1.0\nf = 2.0\n",
    "E302 a builtin redefined": GOOD + "sin = 2.0\n",
    "E303 a statement": GOOD + "if True:\n    pass\n",
    "E304 math": "import math\n" + GOOD,
    "E304 NumPy": "import numpy as np\n" + GOOD,
    "E304 the language's own": "import fcsl_builtins\n" + GOOD,
    "E304 names of math": "from math import sin, degrees, sqrt\n" + GOOD,
    "E304 a name of NumPy": "from numpy import arctan2\n" + GOOD,
    "E304 the future": "from __future__ import division\n" + GOOD,
    "E304 the future, late": GOOD + "from __future__ import annotations\n",
    "E302 an argument twice": GOOD + "def f(a: f64, a: f64) -> f64:\n    return a\n",
    "E304 another module": "from .other import law\n" + GOOD,
    "E304 another name": "from fcsl_builtins import sin as sine\n" + GOOD,
    "E305 a class": GOOD.replace("class State", "class States").replace("p.k", "p.k * x.s"),
    "E305 another class": GOOD.replace("State", "Filter").replace("p.k", "p.k * x.s"),
    "E305 bases": GOOD.replace("class State:", "class State(object):"),
    "E306 a method": PORTS + "    def f(self): pass\n" + HEAD + "    pass\n",
    "E306 a default": PORTS + "    t: f64 = 1.0\n" + HEAD + "    x.t = 2.0\n",
    "E307 a message's own": GOOD.replace("    b: bool\nclass State", "    health: f64\nclass State"),
    "E307 capitals": GOOD.replace("    b: bool\nclass State", "    bIsOn: bool\nclass State"),
    "E307 a word of C": GOOD.replace("    b: bool\nclass State", "    float: bool\nclass State"),
    "E307 an underscore": GOOD.replace("    s: f64", "    _s: f64"),
    "E308 not constant": "K = sin(1.0)\n" + GOOD,
    "E301 a range without in": parameter("f64 0..10"),
    "E312 empty": parameter("f64 N/rad in 10..0"),
    "E312 NaN": parameter("f64 in nan..1"),
    "E312 an infinity": parameter("f64[2] in -inf..1"),
    "E312 no bounds": parameter("f64 in .."),
    "E312 a single number": parameter("f64 in 5"),
    "E312 three points": parameter("f64 in 0...5"),
    "E312 a fraction": parameter("i32 in 0.5..2"),
    "E312 beyond the type": parameter("u32 in -1..10"),
    "E312 beyond f32": parameter("f32 in 0..1e39"),
    "E312 beyond f64": parameter("f64 in 0..1e400"),
    "E312 too many digits": parameter("i64 in 0..9007199254740993"),
    "E312 of a bool": parameter("bool in 0..1"),
    "E312 of a struct": parameter("Goal in 0..1"),
    "E312 on an input": GOOD.replace('x: "f64 m"', 'x: "f64 m in 0..1"'),
    "E309 no execute": PORTS,
    "E309 a misspelt execute": GOOD.replace("execute", "excute"),
    "E431 a misspelt start": GOOD + "def strat(x: State) -> None:\n    x.s = 1.0\n",
    "E431 a record": GOOD + "def f(u: Inputs) -> f64:\n    return u.x\n",
    "E408 no class": GOOD.replace(PORTS, PORTS[PORTS.index("class Parameters") :]),
    "E310 not a record": PORTS + "def execute(u: f64) -> None:\n    pass\n",
    "E310 inputs of start": GOOD + "def start(u: Inputs) -> None:\n    pass\n",
    "E310 a record twice": PORTS + "def execute(y: Outputs, z: Outputs) -> None:\n    pass\n",
    "E311 a name that is not there": "from fcsl_builtins import clmap, sin\n" + GOOD,
    "E425 execute with a result": PORTS + HEAD.replace("None", "f64") + "    pass\n",
    "E402 argument": PORTS + "def f(a: f64) -> f64:\n    return a\n" + HEAD + "    y.y = f(u.n)\n",
    "E416 arguments of a helper": PORTS + "def f(a: f64) -> f64:\n    return a\n" + HEAD + "    y.y = f(u.x, u.x)\n",
    "E422 an argument is written": PORTS
    + "def f(a: f64) -> f64:\n    a = 1.0\n    return a\n"
    + HEAD
    + "    y.y = f(u.x)\n",
    "E422 an argument named as a builtin": PORTS
    + "def f(range: f64) -> f64:\n    return 1.0\n"
    + HEAD
    + "    y.y = f(u.x)\n",
    "E430 recursion": PORTS
    + "def f(a: f64) -> f64:\n    return g(a)\ndef g(a: f64) -> f64:\n    return f(a)\n"
    + HEAD
    + "    y.y = f(u.x)\n",
    "E431 no type": PORTS + "def f(a) -> f64:\n    return 1.0\n" + HEAD + "    y.y = f(u.x)\n",
    "E431 a default": PORTS + "def f(a: f64 = 1.0) -> f64:\n    return a\n" + HEAD + "    y.y = f(u.x)\n",
    "E431 no result": PORTS + "def f(a: f64):\n    return a\n" + HEAD + "    y.y = f(u.x)\n",
    "E432 an end without result": PORTS
    + "def f(a: f64) -> f64:\n    if a > 0.0:\n        return a\n"
    + HEAD
    + "    y.y = f(u.x)\n",
    "E433 a request of a helper": PORTS
    + "def f(a: f64) -> bool:\n    return TransitionRequest.GO == TransitionRequest.none\n"
    + HEAD
    + "    y.b = f(u.x)\n",
    "E433 health in start": GOOD + "def start(y: Outputs) -> None:\n    y.health = Health.degraded\n",
    "E225 an unknown request": PORTS + HEAD + "    y.transition_request = TransitionRequest.GO\n",
    "E403 in a helper nobody calls": GOOD + "def f(a: f64) -> f64:\n    if a > 0.0:\n        b = a\n    return b\n",
    "E435 a body": GOOD + '@extern(header="a.h")\ndef f(a: f64) -> f64:\n    return a\n',
    "E435 no header": GOOD + "@extern\ndef f(a: f64) -> f64: ...\n",
    "E435 another language": GOOD + '@extern(header="a.h", lang="c++")\ndef f(a: f64) -> f64: ...\n',
    "W301 unused": GOOD + "def f(a: f64) -> f64:\n    return a\n",
}


def patch(change: Callable[[dict[str, Any]], Any]) -> str:
    config = copy.deepcopy(CONFIG)
    change(config)
    return json.dumps(config, indent=1)


def put(*path: str | int, value: Any) -> str:
    """CONFIG with one value replaced or added."""

    def change(config: Any) -> None:
        for key in path[:-1]:
            config = config[key]
        config[path[-1]] = value

    return patch(change)


def connect(*connections: Mapping[str, Any]) -> str:
    return put("connections", value=list(connections))


def channel(*channels: Mapping[str, Any]) -> str:
    base = {"name": "a", "id": 1, "field": "one.inputs.x", "direction": "sensor"}
    return put("channels", value=[{**base, **c} for c in channels])


def mapped(*ros: Mapping[str, Any], **keys: Any) -> str:
    """Sensors v.a, v.b of three numbers, mapped onto the rates of an Imu but for what is said here."""
    rates = {"type": "sensor_msgs/Imu", "field": "angular_velocity"}
    pairs = zip("ab", ("one.inputs.v", "two.inputs.v"), ros, strict=False)
    return channel(
        *({"name": f"v.{n}", "id": ord(n), "field": field, "ros": {**rates, **r}, **keys} for n, field, r in pairs)
    )


def edge(**keys: Any) -> str:
    return put("transitions", value=[{"from": "A", "to": "B", **keys}])


GUARD = {"instance": "one", "in": ["failed"]}
CONFIGS: dict[str, str] = {
    "E100 a source that is not there": put("algorithms", "alg", "source", value="nothing.py"),
    "E101 a comma": '{"tick_hz": 100,}',
    "E101 a single quote": "{'tick_hz': 100}",
    "E101 the end": '{"tick_hz": [1, 2',
    "E101 a comment": '{\n// rate\n"tick_hz": 1}',
    "E101 NaN": put("instances", "one", "parameters", "k", value=float("nan")),
    "E101 too deep": "[" * 100,
    "E102 a key twice": json.dumps(CONFIG).replace('"tick_hz": 100', '"tick_hz": 100, "tick_hz": 100'),
    "E103 outside the folder": put("algorithms", "alg", "source", value="../alg.py"),
    "E103 a package": put("algorithms", "alg", "source", value="package://nowhere/alg.py"),
    "E104 a simulation": json.dumps({"controller": {"machine": "lander.json"}, "models": {}}),
    "E201 a key": put("tick_hertz", value=1),
    "E201 a misspelt request": edge(reqest="GO"),
    "E202 a missing key": patch(lambda c: c.pop("states")),
    "E203 a name": put("instances", "a b", value={"algorithm": "alg", "parameters": {"k": 1}}),
    "E203 a request": edge(request="GO HOME"),
    "E203 a channel": channel({"name": "Imu"}),
    "E203 a ROS type": channel({"ros": {"type": "sensor_msgs/msg/Imu", "field": "angular_velocity"}}),
    "E203 a ROS field": channel({"ros": {"type": "sensor_msgs/Imu", "field": "angularVelocity.x"}}),
    "E203 a frame": channel({"ros": {"type": "sensor_msgs/Imu", "field": "x", "frame": ""}}),
    "E204 out of range": put("tick_hz", value=0),
    "E204 a phase": put("states", "A", "schedule", "two", value={"hz": 50, "phase": 2}),
    "E203 a topic": channel({"ros": {"type": "sensor_msgs/Imu", "field": "angular_velocity", "topic": "imu data"}}),
    "E205 axes": mapped({"axes": "fdr"}),
    "E206 publish": put("publish", value=["one", "tow"]),
    "E208 publish": put("publish", value="one"),
    "E235 publish": put("publish", value=["one", "two", "one"]),
    "E205 a choice": channel({"direction": "input"}),
    "E206 an algorithm": put("instances", "one", "algorithm", value="algo"),
    "E206 an instance": put("states", "A", "schedule", "three", value=1),
    "E206 a state": put("initial_state", value="C"),
    "E206 a machine source": connect({"from": "machine.rate", "to": "one.inputs.x"}),
    "E207 the wrong kind": put("instances", "one", "parameters", "k", value=True),
    "E207 not finite": put("instances", "one", "inputs", value={"v": [1, 2]}),
    "E208 not an object": put("instances", "one", value=3),
    "E207 a list": put("instances", "one", "inputs", value={"n": [1]}),
    "E207 null": put("instances", "one", "inputs", value={"v": None}),
    "E208 not a string": connect({"from": 1, "to": "one.inputs.x"}),
    "E209 reserved": put("instances", "machine", value={"algorithm": "alg"}),
    "E210 a parameter": put("instances", "one", "parameters", "kk", value=1),
    "E210 an input": put("instances", "one", "inputs", value={"xx": 1}),
    "E211 no value": put("instances", "one", "parameters", value={}),
    "E212 connected": patch(
        lambda c: (
            c.update(connections=[{"from": "two.outputs.v", "to": "one.inputs.v"}]),
            c["instances"]["one"].update(inputs={"v": [1, 2, 3]}),
        )
    ),
    "E213 two sources": connect(*[{"from": "two.outputs.v", "to": "one.inputs.v"}] * 2),
    "E213 a channel on a connected input": patch(
        lambda c: c.update(
            connections=[{"from": "two.outputs.v", "to": "one.inputs.v"}],
            channels=[{"name": "a", "id": 1, "field": "one.inputs.v", "direction": "sensor"}],
        )
    ),
    "E214 delayed without initial": connect({"from": "two.outputs.v", "to": "one.inputs.v", "delayed": True}),
    "E214 initial without delayed": connect({"from": "two.outputs.v", "to": "one.inputs.v", "initial": [0, 0, 0]}),
    "E214 an actuator's age": channel({"field": "one.outputs.y", "direction": "actuator", "max_age_ticks": 1}),
    "E215 from an input": connect({"from": "two.inputs.x", "to": "one.inputs.x"}),
    "E215 the wrong way round": connect({"from": "one.inputs.v", "to": "two.outputs.v"}),
    "E215 without the record": connect({"from": "two.v", "to": "one.inputs.v"}),
    "E208 delayed as a text": connect(
        {"from": "two.outputs.v", "to": "one.inputs.v", "delayed": "yes", "initial": [0, 0, 0]}
    ),
    "E208 parameters as a list": put("instances", "one", "parameters", value=[1.5]),
    "E216 a port": connect({"from": "two.outputs.vv", "to": "one.inputs.v"}),
    "E217 types": connect({"from": "two.outputs.i", "to": "one.inputs.v"}),
    "E217 a health on a channel": channel({"field": "one.inputs.h"}),
    "E218 units": connect({"from": "two.outputs.y", "to": "one.inputs.x"}),
    "E219 no state": put("states", value={}),
    "E220 a rate": put("states", "A", "schedule", "one", value=30),
    "E221 neither request nor guard": edge(),
    "E221 a guard that never holds": edge(health={"instance": "one", "in": []}),
    "E222 to itself": edge(to="A", health=GUARD),
    "E223 a state twice": edge(**{"from": ["A", "A"]}, health=GUARD),
    "E223 no state": edge(**{"from": []}, health=GUARD),
    "E224 no priority": put("transitions", value=[{"from": "A", "to": "B", "health": GUARD}] * 2),
    "E224 equal priorities": put("transitions", value=[{"from": "A", "to": "B", "health": GUARD, "priority": 3}] * 2),
    "E236 a misspelt message": mapped({"type": "sensor_msgs/IMU"}),
    "E236 a message that no channel can be": mapped({"type": "sensor_msgs/Image"}),
    "E236 a package of somebody's": mapped({"type": "acme_msgs/Thing"}),
    "E237 a misspelt field": mapped({"field": "angular_velocty"}),
    "E237 no such field": mapped({"field": "gyro"}),
    "E237 below a number": mapped({"field": "angular_velocity.x.y"}),
    "E237 the header": mapped({"field": "header.stamp.sec"}),
    "E237 text": mapped({"type": "nav_msgs/Odometry", "field": "child_frame_id"}),
    "E237 an element of no list": mapped({"field": "angular_velocity[0]"}),
    "E237 an element beyond the end": mapped({"field": "orientation_covariance[9]"}),
    "E237 a quaternion among others": mapped({"type": "geometry_msgs/PoseStamped", "field": "pose"}),
    "E237 a joint by number": mapped({"type": "sensor_msgs/JointState", "field": "position[0]"}, field="one.inputs.x"),
    "E238 a quaternion into three": mapped({"field": "orientation"}),
    "E238 one into three": mapped({"field": "angular_velocity.x"}),
    "E238 a list into one": mapped({"type": "sensor_msgs/Joy", "field": "axes"}, field="one.inputs.x"),
    "E238 a float into an integer": mapped({"field": "angular_velocity.x"}, field="one.inputs.n"),
    "E238 a bool into a float": mapped({"type": "std_msgs/Bool", "field": "data"}, field="one.inputs.x"),
    "E238 a float into a bool": mapped(
        {"type": "std_msgs/Bool", "field": "data"}, field="one.outputs.y", direction="actuator"
    ),
    "E218 units of a message": mapped({"type": "sensor_msgs/Imu", "field": "angular_velocity.x"}, field="one.inputs.x"),
    "E239 axes of a number": mapped(
        {"type": "geometry_msgs/Vector3", "field": "x", "axes": "frd"}, field="one.inputs.x"
    ),
    "E239 axes of an orientation": mapped({"axes": "ned/frd"}),
    "E239 a frame without header": mapped({"type": "geometry_msgs/Twist", "field": "linear", "frame": "base"}),
    "E239 a child frame": mapped({"child_frame": "base"}),
    "E241 two types": mapped({}, {"type": "sensor_msgs/MagneticField", "field": "magnetic_field"}),
    "E241 two frames": mapped({"frame": "imu"}, {}),
    "E241 a field twice": mapped({}, {}),
    "E241 taken and made": channel(
        {"name": "v.a", "field": "one.inputs.v", "ros": {"type": "geometry_msgs/Twist", "field": "linear"}},
        {
            "name": "v.b",
            "id": 2,
            "field": "two.outputs.v",
            "direction": "actuator",
            "ros": {"type": "geometry_msgs/Twist", "field": "angular"},
        },
    ),
    "E226 two names": channel({}, {"id": 2, "field": "two.inputs.x"}),
    "E226 two ids": channel({}, {"name": "b", "field": "two.inputs.x"}),
    "E226 two fields": channel({}, {"name": "b", "id": 2}),
    "E227 assigned by its algorithm": channel({"field": "one.outputs.y"}),
    "E228 a cycle": connect(
        {"from": "one.outputs.v", "to": "two.inputs.v"}, {"from": "two.outputs.v", "to": "one.inputs.v"}
    ),
    "E228 itself": connect({"from": "one.outputs.i", "to": "one.inputs.n"}),
    "E229 one name in C": patch(
        lambda c: c["instances"].update(
            a_b={"algorithm": "alg", "parameters": {"k": 1}}, aB={"algorithm": "alg", "parameters": {"k": 1}}
        )
    ),
    "E232 a struct in itself": put("structs", "Goal", "next", value="Goal"),
    "E232 a member": put("structs", "Goal", "isSet", value="bool"),
    "E232 a type": put("structs", "Goal", "rate", value="float"),
    "E233 a library": put("targets", value={"simulation": {"libraries": ["-lgpiod"]}}),
    "E233 outside the folder": put("targets", value={"simulation": {"sources": ["../a.c"]}}),
    "E233 a source that is not there": put("targets", value={"simulation": {"sources": ["a.c"]}}),
    "E234 no parameter": put("instances", "one", "frozen", value=["kk"]),
    "W201 unused": patch(lambda c: c["algorithms"].update(other={"source": "alg.py"})),
    "W202 nobody asks": edge(request="GO"),
    "W203 unreachable": put("transitions", value=[]),
    "W204 in no schedule": put("states", "A", "schedule", value={"one": 100}),
    "W205 from no other state": patch(
        lambda c: (c["states"].pop("B"), c["transitions"][0].update({"from": "*", "to": "A"}))
    ),
}


def all_cases() -> dict[str, tuple[str, str]]:
    good = json.dumps(CONFIG, indent=1)
    cases = {n: (good, PORTS + HEAD + "".join(f"    {s}\n" for s in body.split("\n"))) for n, body in BODIES.items()}
    # The algorithm alone in its machine, without parameters where it has none.
    for name, text in ALGORITHMS.items():
        parameters = {"k": 1.5} if "class Parameters" in text else {}
        instance = {"algorithm": "alg", "parameters": parameters}
        guard = {"from": "A", "to": "B", "health": GUARD}
        cases[name] = (
            patch(lambda c, i=instance, g=guard: c.update(instances={"one": i, "two": i}, transitions=[g])),
            text,
        )
    cases.update({name: (config, GOOD) for name, config in CONFIGS.items()})
    kept = patch(
        lambda c: (
            c.update(connections=[{"from": "one.outputs.v", "to": "two.inputs.v"}]),
            c["states"]["B"].update(schedule={"two": 50}),
        )
    )
    cases["W206 what another state left"] = (kept, PORTS + HEAD + "    y.v = u.v\n")
    slow = connect({"from": "machine.dt", "to": "two.inputs.x"})
    cases["W207 a period of its own"] = (slow, GOOD.replace('"f64 m"', '"f64 s"'))
    outside = put("instances", "one", "parameters", "k", value=-0.5)
    bounds = parameter("f64 N/rad in 0..10")
    cases["E204 outside the range"] = (outside, bounds)
    frozen = patch(lambda c: c["instances"]["two"].update(parameters={"k": 10.5}, frozen=True))
    cases["E204 frozen outside the range"] = (frozen, bounds)
    elements = patch(
        lambda c: [
            i.update(parameters={"k": [0, k, 2]}) for i, k in zip(c["instances"].values(), (-3, -2), strict=True)
        ]
    )
    cases["E204 elements outside the range"] = (elements, parameter("i32[3] in -2..").replace("p.k", "f64(p.k[0])"))
    return cases

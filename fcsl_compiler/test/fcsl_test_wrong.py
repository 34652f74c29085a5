# SPDX-License-Identifier: Apache-2.0
"""Small wrong programs and machines, at least one for every diagnostic, and the correct ones they derive from."""

import copy
import json
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

PORTS = """class Alg:
    inputs = {"x": "f64 m", "n": "i32", "w": "f64[3]", "on": "bool", "h": "Health", "r": "TransitionRequest"}
    parameters = {"k": "f64"}
    outputs = {
        "y": "f64 s",
        "i": "i32",
        "v": "f64[3]",
        "b": "bool",
        "transition_request": "TransitionRequest",
    }
    state = {"s": "f64", "g": "Goal"}
"""
HEAD = "\n    def execute(self):\n"


def execute(body: str, ports: str = PORTS) -> str:
    """The algorithm with these statements."""
    return ports + HEAD + "".join(f"        {line}\n" for line in body.split("\n"))


GOOD = execute("self.y = self.x * self.k")
#: The same without unused ports, which would cause warnings.
LEAN = execute(
    "self.y = self.x * self.k",
    'class Alg:\n    inputs = {"x": "f64 m"}\n    parameters = {"k": "f64"}\n    outputs = {"y": "f64 s"}\n',
)
CONFIG: dict[str, Any] = {
    "tick_hz": 100,
    "initial_state": "A",
    "structs": {"Goal": {"place": "f64[3] m", "speed": "f64 m/s"}},
    "algorithms": {"Alg": {"source": "alg.py"}},
    "instances": {
        "one": {"algorithm": "Alg", "parameters": {"k": 1.5}},
        "two": {"algorithm": "Alg", "parameters": {"k": 2}},
    },
    "connections": [],
    "states": {"A": {"schedule": {"one": 100, "two": 50}}, "B": {"schedule": {}}},
    "transitions": [{"from": "A", "to": "B", "health": {"instance": "one", "in": ["failed"]}}],
    "channels": [],
}


def parameter(text: str) -> str:
    """The algorithm with a parameter of this type."""
    return GOOD.replace('{"k": "f64"}', f'{{"k": "{text}"}}')


def state(entries: str) -> str:
    """The algorithm with these entries in its state."""
    return GOOD.replace('"s": "f64"', entries)


def start(body: str) -> str:
    """The algorithm with a `start`."""
    return GOOD + f"\n    def start(self):\n        {body}\n"


def helper(signature: str, *body: str, call: str) -> str:
    """An algorithm whose execute assigns the result of this helper to an output."""
    return execute(f"self.{call}") + "".join(["\n\n", f"def {signature}:\n", *(f"    {line}\n" for line in body)])


# Statements of execute.
BODIES: dict[str, str] = {
    "E401 an integer out of range": "self.i = 3000000000",
    "E401 a float where an integer is needed": "self.i = 2.5",
    "E401 two integers divided": "self.i = 1 / 2",
    "E401 two integers divided in a local": "t = 1 / 2\nself.i = i32(t)",
    "E401 a float among integers, far away": "t = 0.5\nif self.on:\n    t = self.n\nself.i = t",
    "E401 a constant division by zero": "self.y = 1.0 / 0.0",
    "E401 not exact": "self.y = 9007199254740993",
    "E402 an i32 where an f64 is needed": "self.y = self.n",
    "E402 a number as condition": "if self.n:\n    self.i = 1",
    "E402 a bool where a number is needed": "self.y = self.on",
    "E402 shapes": "self.v = [1.0, 2.0]",
    "E402 branches of two types": "self.y = self.x if self.on else self.n",
    "E402 elements of two types": "self.v = [self.x, self.n, self.x]",
    "E402 a local of two types": "t = self.n\nt = self.x",
    "E413 len of a number": "self.y = len(self.x)",
    "E413 len of what is computed": "self.y = len(self.w * 2.0)",
    "E416 len of two": "self.y = len(self.w, self.w)",
    "E402 a local of two types, far apart": "t = 1\nt = self.x\nself.i = t",
    "E415 a sum of two types": "t = 0\nt += self.x\nt += self.n\nself.y = t * 2.0",
    "E411 a local that is a float elsewhere": "t = 0\nself.y = self.x * t\nself.v[t] = 1.0",
    "E410 what while assigns": "while self.on:\n    t = 1.0\nself.y = t",
    "E403 assigned on one path": "if self.on:\n    t = 1.0\nself.y = t",
    "E403 a loop that may be left": "for i in range(3):\n    if self.on:\n        break\n    t = 1.0\nself.y = t",
    "E404 a function as value": "self.y = sin",
    "E405 after the loop": "for i in range(3):\n    self.i = i\nself.i = i",
    "E406 a name": "self.y = self.x + foo",
    "E406 a function": "self.y = reversed(self.w)",
    "E408 a field": "self.y = self.xx",
    "E410 while": "while self.on:\n    self.i = 1",
    "E410 a comprehension": "self.v = [i for i in range(3)]",
    "E410 a tuple": "self.v = (1.0, 2.0, 3.0)",
    "E410 matrix product": "self.v = self.w @ self.w",
    "E410 in": "self.b = self.n in self.w",
    "E410 keyword arguments": "self.y = clamp(self.x, low=0.0, high=1.0)",
    "E410 chained assignment": "self.y = self.s = 1.0",
    "E410 break": "break",
    "E410 continue": "if self.on:\n    continue",
    "E410 try": "try:\n    self.i = 1\nexcept ValueError:\n    self.i = 2",
    "E406 print": "print(self.x)",
    "E406 a function of a module": "self.y = math.sin(self.x) + np.linalg.norm(self.w)",
    "E406 a constant of a module": "self.y = math.pi",
    "E408 the transpose": "self.y = self.w.T",
    "E410 a method": "self.w.append(1.0)",
    "E411 index of a scalar": "self.y = self.x[0]",
    "E411 a float as index": "self.y = self.w[self.x]",
    "E412 constant index": "self.y = self.w[3]",
    "E412 loop index": "for i in range(3, 5):\n    self.y = self.w[i]",
    "E413 product of matrices": "self.v = (outer(self.w, self.w) * outer(self.w, self.w))[0]",
    "E413 a chain of comparisons on arrays": "self.b = 0.0 < self.w < 1.0",
    "E402 arrays compared": "self.b = self.w == self.w",
    "E402 and of arrays": "self.b = any(self.w > 0.0 and self.w < 1.0)",
    "E402 not of an array": "self.b = any(not self.w > 0.0)",
    "E413 arrays of bools joined": "self.b = any((self.w > 0.0) | (self.w < 1.0))",
    "E415 an array of bools inverted": "self.b = any(~(self.w > 0.0))",
    "E415 an array of bools as numbers": "self.y = sum(f64(self.w > 0.0))",
    "E418 how many are true": "self.y = sum(self.w > 0.0)",
    "E418 any of a matrix": "self.b = any(zeros(2, 2) > 0.0)",
    "E416 interp of two axes": "self.y = interp(self.x, self.x, self.w, self.w, [self.w, self.w, self.w])",
    "E413 arrays of two shapes": "self.v = min(self.w, [1.0, 2.0])",
    "E418 elements of another type": "self.y = norm([self.n, self.n])",
    "E414 division by zero": "self.i = self.n // 0",
    "E415 types mixed": "self.y = self.x + self.n",
    "E415 division of integers": "self.y = self.n / self.n",
    "E415 arithmetic on bool": "self.i = self.on + 1",
    "E415 a bool as a number": "self.y = f64(self.on)",
    "E415 a bool as an integer": "self.i = i32(self.on)",
    "E416 arguments of a builtin": "self.y = clamp(self.x, 1.0)",
    "E416 arguments of a library function": "self.y = dot(self.w)",
    "E417 a size that varies": "t = zeros(self.n)",
    "E418 sizes that do not fit": "self.y = dot(self.w, [1.0, 2.0])",
    "E420 never reached": "return\nself.y = 1.0",
    "E421 unused value": "sin(self.x)",
    "E422 an input": "self.x = 1.0",
    "E422 a loop variable": "for i in range(3):\n    i = 4",
    "E422 a builtin": "range = 2.0",
    "E423 declared twice": "t: f64 = 1.0\nt: f64 = 2.0",
    "E424 not a range": "for e in self.w:\n    self.y = e",
    "E424 a bound that varies": "for i in range(self.n):\n    self.i = i",
    "E424 too many": "for i in range(20000000):\n    self.i = i32(i)",
    "E425 a result": "return self.x",
    "E436 a member that is not there": "self.g = Goal(self.w, sped=1.0)",
    "E436 a member is missing": "self.g = Goal(self.w)",
    "E436 a member twice": "self.g = Goal(self.w, place=self.w)",
    "E437 names and rows": "a, b = self.w",
    "E437 names and values": "a, b = 1, 2, 3",
    "E437 a scalar": "a, b = self.x",
    "E438 beyond the end": "self.v = self.w[1:4]",
    "E438 a step": "self.v[0:2] = self.w[0:3:2]",
    "E438 an end that varies": "self.v[0:2] = self.w[0:self.n]",
    "E439 a shift": "self.i = self.n >> 32",
    "E408 a member": "self.y = self.g.sped",
    "E402 a slice of another shape": "self.v = self.w[0:2]",
    "E415 a signed shift": "self.i = self.n << 1",
    "W303 a local": "low = self.x\nself.y = self.x",
    "W303 an output without self": "y = self.x",
    "W303 only added to": "total = 0.0\nfor i in range(3):\n    total += self.w[i]",
    "W303 only filled": "v = [0.0, 0.0]\nv[0] = self.x",
    "W303 a result": "level = hw_read_gpio(3)",
    "W303 of several": "first, _, last = self.w\nself.y = first",
    "W306 equal": "self.b = self.x == nan",
    "W306 unequal, on the left": "self.b = nan != self.x + 1.0",
    "W306 less": "self.b = 0.0 < self.x < inf - inf",
    "W302 a fault after a write": "hw_write_gpio(4, self.on)\nself.i = self.n + 1",
    "E404 self as value": "self.y = self",
    "E404 a helper as value": "self.y = abs",
    "E404 a type as value": "self.y = f64",
    "E404 a member of a type": "self.health = Health.failed",
    "E404 a request as a member": "self.transition_request = TransitionRequest.GO",
    "E404 a health as a member": "self.b = self.h == Health.fine",
    "E406 a port without self": "self.y = x",
    "E406 an output without self": "self.i = i",
    "E406 execute called": "execute()",
    "E406 a record": "self.y = inputs.x",
    "E407 a health": 'self.health = "fine"',
    "E407 nothing": 'self.health = ""',
    "E407 another case": 'self.health = "Failed"',
    "E407 stale": 'self.health = "stale"',
    "E407 stale in a branch": 'self.health = "stale" if self.on else "nominal"',
    "E407 compared": 'self.b = self.h == "broken"',
    "E407 compared the other way round": 'self.b = "broken" != self.h',
    "E407 in a branch": 'self.health = "degraded" if self.on else "borken"',
    "E407 a request beside a health": 'self.health = "GO" if self.on else self.h',
    "E408 the name of a dictionary": "self.y = self.inputs.x",
    "E408 a field that begins in execute": "self.filtered = self.x",
    "E408 a method": "self.y = self.execute",
    "E410 a method called": "self.execute()",
    "E410 a method that is none": "self.y = self.limited(self.x)",
    "E410 super": "super().execute()",
    "E410 a deleted field": "del self.s",
    "E410 a function inside": "def f() -> f64:\n    return 1.0\nself.y = 1.0",
    "E410 a declared field": "self.y: f64 = 1.0",
    "E410 a field as loop variable": "for self.i in range(3):\n    pass",
    "E410 an f-string": 'self.transition_request = f"GO{1}"',
    "E410 a plain f-string": 'self.health = f"failed"',
    "E410 bytes": 'self.health = b"failed"',
    "E410 a string that is searched": 'self.b = self.h in "failed"',
    "E410 healths listed": 'self.b = self.h in ["failed", "stale"]',
    "E410 healths that are the same": 'self.b = self.h is "failed"',
    "E411 a part of a string": 'self.b = "failed"[0] == "f"',
    "E415 a health and a request": "self.b = self.h == self.r",
    "E415 the order of healths": "self.b = self.h < self.health",
    "E415 the order of a health and a word": 'self.b = self.h >= "degraded"',
    "E415 a health that is added": "self.b = self.h + self.h == self.h",
    "E415 a health negated": "self.b = -self.h == self.h",
    "E402 not a health": "self.b = not self.h",
    "E402 a health as condition": "if self.h:\n    pass",
    "E402 a request from a health": "self.transition_request = self.health",
    "E402 a number in a health": "self.health = 2",
    "E402 a health in a number": "self.i = self.h",
    "E402 a word and a number": 'self.transition_request = "GO" if self.on else 0',
    "E402 a number and a word": 'self.y = 1.0 if self.on else "GO"',
    "E402 a word and a field": 'self.health = "failed" if self.on else self.r',
    "E410 None for no request": "self.transition_request = None",
    "E440 a local": 'word = "GO"',
    "E440 a local of a choice": 'word = "GO" if self.on else ""',
    "E440 a number's place": 'self.y = "x"',
    "E440 a number's place, chosen": 'self.y = "x" if self.on else "y"',
    "E440 compared with a number": 'self.b = self.x == "failed"',
    "E440 compared with another": 'self.b = "failed" == "failed"',
    "E440 compared in a chain": 'self.b = "failed" == "failed" == self.h',
    "E440 added": 'self.transition_request = "GO" + "HOME"',
    "E440 added to a number": 'self.y = self.x + "1"',
    "E440 multiplied": 'self.transition_request = "GO" * 2',
    "E440 in a percent": 'self.transition_request = "GO %d" % self.n',
    "E440 negated": 'self.y = -"1"',
    "E440 raised": 'self.y = "2" ** 2',
    "E440 added up": 'self.y += "1"',
    "E440 a condition": 'if "failed":\n    pass',
    "E440 in and": 'self.b = self.on and "failed"',
    "E440 not": 'self.b = not "failed"',
    "E440 an index": 'self.y = self.w["x"]',
    "E440 an element": 'self.v = ["a", 1.0, 2.0]',
    "E440 elements": 'words = ["failed", "nominal"]',
    "E440 a member": 'self.g = Goal(self.w, speed="fast")',
    "E440 an argument": 'self.y = sin("1")',
    "E440 arguments": 'self.y = max("a", "b")',
    "E418 a string for a library function": 'self.y = norm("abc")',
    "E440 a conversion": 'self.y = f64("1.5")',
    "E440 a conversion to an integer": 'self.i = i32("1")',
    "E440 unpacked": 'a, b = "GO", ""',
    "E440 a string unpacked": 'a, b = "GO"',
    "E417 a size": 't = zeros("3")',
    "E440 a bound": 'for i in range("3"):\n    pass',
    "E438 an end of a slice": 'self.v[0:2] = self.w[0:"2"]',
    "E440 written outside": 'hw_write_u32(1, "on")',
    "E421 a comment as a string": 'self.y = 1.0\n"the end"',
    "E421 a number alone": "self.y = 1.0\n0.5",
    "E410 a matrix product assigned": "self.v @= self.w",
    "E411 a flag as index": "self.y = self.w[self.on]",
    "E424 a bound that is a float": "for i in range(2.0):\n    pass",
    "E424 bounds far out": "for i in range(2147483645, 2147483650):\n    pass",
    "E437 a star": "a, *b = self.w",
    "E425 a request returned": 'return "GO"',
    "E422 self": "self = 1",
    "E422 self in a loop": "for self in range(3):\n    pass",
    "E422 self unpacked": "self, t = 1.0, 2.0",
    "E422 self declared": "self: f64 = 1.0",
    "E422 a parameter": "self.k = 1.0",
    "E422 a parameter added to": "self.k += 1.0",
    "E422 an element of an input": "self.w[0] = 1.0",
    "E422 a slice of an input": "self.w[0:2] = [1.0, 2.0]",
    "E422 an input unpacked to": "self.x, self.y = 1.0, 2.0",
    "E422 an input of a request": 'self.r = "GO"',
    "E412 a nested index": "m = [[1.0, 2.0], [3.0, 4.0]]\nself.y = m[0][2]",
    "E411 three indices for two": "m = [[1.0, 2.0], [3.0, 4.0]]\nself.y = m[0][1][0]",
    "E301 a local with a comma": 'm: "f64[2, 2]" = [[1.0, 2.0], [3.0, 4.0]]\nself.y = m[0, 0]',
    "E434 behind and": "self.b = self.on and hw_read_gpio(4)",
    "E434 behind or": "self.b = self.on or self.b or hw_read_gpio(4)",
    "E434 in a branch": "self.i = i32(hw_read_adc(0)) if self.on else 0",
    "E434 in the other branch": "self.i = 0 if self.on else i32(hw_read_adc(0))",
    "E434 behind the first comparison": "self.b = 0 < self.n < i32(hw_read_adc(0))",
    "E434 in an argument behind and": "self.b = self.on and max(hw_read_adc(0), 3) > 5",
    "E434 in a condition behind and": "if self.on and hw_read_gpio(4):\n    pass",
    "E434 in a condition of a branch": "self.y = 1.0 if self.on else 2.0 if hw_read_gpio(4) else 3.0",
    "E434 in a subscript behind or": "self.b = self.on or self.w[i32(hw_read_adc(0))] > 0.0",
    "E434 added behind and": "self.b = self.on\nself.i += 1 if self.on and hw_read_gpio(4) else 0",
    "E434 in a subscript of a target": "self.v[i32(hw_read_adc(0)) if self.on else 0] = 1.0",
    "E421 a reading that is dropped": "hw_read_adc(0)",
    "E421 a value where there is none": "self.b = hw_write_gpio(4, True)",
    "E421 an argument that is none": "hw_write_gpio(4, hw_write_gpio(5, True))",
    "E402 a pin that is an i32": "hw_write_gpio(self.n, True)",
    "E402 a level that is a number": "hw_write_gpio(4, 1)",
    "E401 a pin below 0": "self.b = hw_read_gpio(-1)",
    "E416 a level that is missing": "hw_write_gpio(4)",
    "E416 a pin by name": "self.b = hw_read_gpio(pin=4)",
    "E404 hardware as value": "self.y = hw_read_adc",
    "E424 a bound that is read": "for i in range(hw_read_adc(0)):\n    pass",
    "E417 a size that is read": "t = zeros(hw_read_adc(0))",
    "E438 an end that is read": "self.v[0:2] = self.w[0:hw_read_adc(0)]",
    "E406 a builtin of another board": "self.i = hw_read_pulses(0)",
    "E401 a reading and a float": "self.y = hw_read_adc(0) / 4095.0",
}

# Whole files.
ALGORITHMS: dict[str, str] = {
    "E110 syntax": "def execute(:\n    pass\n",
    "E110 nested without end": GOOD + "K = " + "-" * 50000 + "1\n",
    "E110 nested": execute("self.y = " + "-" * 120 + "1.0"),
    "E110 no body": GOOD + "\n    def start(self):\n",
    "E111 a Greek letter": execute("θ = 1.0\nself.y = θ"),
    "E111 a Greek field": execute("self.θ = 1.0"),
    "E111 a Greek class": GOOD + "\n\nclass Größe:\n    def execute(self):\n        pass\n",
    # Types.
    "E301 not a type": state('"s": "float"'),
    "E301 a size": state('"s": "f64[n]"'),
    "E301 one bracket for two sizes": state('"s": "f64[2, 3]"'),
    "E301 one bracket for two of three sizes": state('"s": "Goal[2][3, 4]"'),
    "E301 one bracket for named sizes": "N = 2\n\n\n" + state('"s": "f64[N, N] m"'),
    "E301 an open bracket": state('"s": "f64[3"'),
    "E301 an open bracket and a unit": state('"s": "f64[3 rad/s"'),
    "E301 a second bracket that is open": state('"s": "f64[2][3"'),
    "E301 no size": state('"s": "f64[]"'),
    "E301 a size of 0": state('"s": "f64[2][0]"'),
    "E301 a size below 0": state('"s": "f64[-1]"'),
    "E301 a size that is computed": state('"s": "f64[2 * 3]"'),
    "E301 a size that is a float": "N = 2.0\n\n\n" + state('"s": "f64[N]"'),
    "E301 a type in capitals": state('"s": "F64"'),
    "E100 a null": GOOD + "# \x00\n",
    "E100 another order of reading": GOOD + "# \u202eno\u202c\n",
    "E111 a letter that looks like two": execute("ﬁ = 1.0\nself.y = ﬁ"),
    "E301 too many elements": state('"s": "f64[300][300]"'),
    "E301 a tuple": state('"s": "tuple[f64, f64]"'),
    "E301 an algorithm": state('"s": "Alg"'),
    "E301 a unit of a struct": state('"s": "Goal m"'),
    "E301 nothing": state('"s": ""'),
    "E301 only a unit": state('"s": "rad/s"'),
    "E301 lower case": state('"s": "health"'),
    "E301 a comma in a helper": helper(
        'f(a: "f64[2, 2]") -> f64', "return a[0, 0]", call="y = f([[1.0, 2.0], [3.0, 4.0]])"
    ),
    "E301 a comma in a result": helper('f(a: f64) -> "f64[1, 2]"', "return [[a, a]]", call="y = f(self.x)[0, 0]"),
    "E301 a comma without quotes": helper(
        "f(a: f64[2, 2]) -> f64", "return a[0, 0]", call="y = f([[1.0, 2.0], [3.0, 4.0]])"
    ),
    "E301 a comma in a constant": 'M: "f64[2, 2]" = [[1.0, 2.0], [3.0, 4.0]]\n\n\n' + execute("self.y = M[0, 0]"),
    "E301 a comma in an extern": GOOD + '\n\n@extern(header="a.h")\ndef f(m: "f64[2, 2]") -> f64: ...\n',
    "E301 a unit in a helper": helper('f(a: "f64 m") -> f64', "return a", call="y = f(self.x)"),
    "E301 a range without in": parameter("f64 0..10"),
    "E410 an assertion with a text that is made": execute('assert self.x > 0.0, f"x is {self.x}"'),
    "E410 an assertion with an empty text": execute('assert self.x > 0.0, ""'),
    "E410 an assertion with a long text": execute(f'assert self.x > 0.0, "{"x" * 81}"'),
    "E410 an assertion with a text that is not ASCII": execute('assert self.x > 0.0, "Ärger"'),
    "E410 an assertion with a number": execute("assert self.x > 0.0, 3"),
    "E402 an assertion of a number": execute("assert self.x"),
    "E410 an event with a text that is made": execute('event(f"x is {self.x}")'),
    "E410 an event without a text": execute("event(self.x)"),
    "E410 an event of nothing": execute("event()"),
    "E410 an event with a long text": execute(f'event("{"x" * 81}")'),
    "E410 an unknown severity": execute('event("late", severity="warn")'),
    "E410 a severity that is computed": execute('event("late", severity=self.x)'),
    "E416 five values of an event": execute('event("late", 1, 2, 3, 4, 5)'),
    "E416 an argument of an event": execute('event("late", level="info")'),
    "E402 an array in an event": execute('event("late", self.v)'),
    "E402 a request in an event": execute('event("late", self.transition_request)'),
    "E440 a string in an event": execute('event("late", "failed")'),
    "E434 an event in a helper": helper("f(a: f64) -> f64", 'event("late", a)\n    return a', call="y = f(self.x)"),
    "E434 an event in start": GOOD + '\n    def start(self):\n        event("begun")\n',
    "E421 the value of an event": execute('self.y = event("late")'),
    "E302 a helper named event": GOOD + "def event(a: f64) -> f64:\n    return a\n",
    "E404 event as a value": execute("self.y = event"),
    "E313 an output": GOOD.replace('"i": "i32"', '"i": "i32 = 1"'),
    "E313 no value": parameter("f64 N = two"),
    "E313 outside": parameter("f64 in 0..10 = 11"),
    "E313 nothing": parameter("f64 N ="),
    "E207 a default of another type": GOOD.replace('{"k": "f64"}', '{"k": "f64", "m": "i32 = 2.5"}'),
    "E207 a default of another length": GOOD.replace('{"k": "f64"}', '{"k": "f64", "m": "f64[3] = [1, 2]"}'),
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
    "E312 an unknown constant": parameter("f64 in 0..MOST"),
    "E312 a constant that comes later": parameter("f64 in 0..MOST") + "\n\nMOST = 5.0\n",
    "E312 a constant array": "MOST = [1.0, 2.0]\n\n\n" + parameter("f64 in 0..MOST"),
    "E312 a constant bool": "MOST = True\n\n\n" + parameter("f64 in 0..MOST"),
    "E312 a constant of another type": "MOST = 2.5\n\n\n" + parameter("i32 in 0..MOST"),
    "E312 an expression": "MOST = 2.5\n\n\n" + parameter("f64 in 0..2*MOST"),
    "E312 of a bool": parameter("bool in 0..1"),
    "E312 of a struct": parameter("Goal in 0..1"),
    "E312 of a health": parameter("Health in 0..1"),
    "E312 of a request": parameter("TransitionRequest in 0..1"),
    "E312 on an input": GOOD.replace('"x": "f64 m"', '"x": "f64 m in 0..1"'),
    "E312 in the state": state('"s": "f64 in 0..1"'),
    # Duplicate and reserved names.
    "E302 a port twice": state('"s": "f64", "s": "f64"'),
    "E302 an input and an output": GOOD.replace('"v": "f64[3]"', '"w": "f64[3]"'),
    "E302 a parameter and a state": state('"s": "f64", "k": "f64"'),
    "E302 an input and a parameter": GOOD.replace('{"k": "f64"}', '{"k": "f64", "x": "f64 m"}'),
    "E302 a dictionary twice": GOOD.replace("    parameters", '    state = {"t": "f64"}\n    parameters'),
    "E302 a method twice": GOOD + HEAD + "        self.y = 2.0\n",
    "E302 a class twice": GOOD + "\n\n" + GOOD,
    "E302 a class and a helper": GOOD + "\n\ndef Alg() -> f64:\n    return 1.0\n",
    "E302 a class and a constant": "Alg = 1.0\n\n\n" + GOOD,
    "E302 a class named as a struct": GOOD + "\n\nclass Goal:\n    def execute(self):\n        pass\n",
    "E302 a class named as a type": GOOD + "\n\nclass Health:\n    def execute(self):\n        pass\n",
    "E302 a function and a constant": GOOD + "def f() -> f64:\n    return 1.0\nf = 2.0\n",
    "E302 a builtin redefined": GOOD + "f64 = 2.0\n",
    "E302 a constant named self": "self = 2.0\n\n\n" + GOOD,
    "E302 a helper named as the cell of a class": GOOD + "def __class__() -> f64:\n    return 1.0\n",
    "E302 a name that a class changes": "__k = 2.0\n\n\n" + GOOD,
    "E302 a helper named as hardware": GOOD + "def hw_read_adc(c: u32) -> u32:\n    return c\n",
    "E302 an argument twice": GOOD + "def f(a: f64, a: f64) -> f64:\n    return a\n",
    "E307 a message's own": GOOD.replace('"b": "bool"', '"tick": "bool"'),
    "E307 a message's header": GOOD.replace('"b": "bool"', '"header": "bool"'),
    "E424 in the library": LEAN.replace(
        "    def execute", '    state = {"a": "f64[256][256]"}\n\n    def execute'
    ).replace("self.y =", "self.a = matmul(self.a, self.a)\n        self.y ="),
    "W307 a ring": LEAN.replace(
        "    def execute", '    state = {"ring": "f64[9][100]", "at": "i32"}\n\n    def execute'
    ).replace(
        "self.y =",
        "for k in range(2):\n            self.ring[self.at, k] = self.x\n        self.at = 7\n        self.y =",
    ),
    "E307 one field of a message": GOOD.replace('"b": "bool"', '"isOn": "bool", "ison": "bool"'),
    "E307 a word of C": GOOD.replace('"b": "bool"', '"float": "bool"'),
    "E307 two underscores": GOOD.replace('"b": "bool"', '"is__on": "bool"'),
    "E307 a word of Python": state('"lambda": "f64"'),
    "E307 an underscore": state('"_s": "f64"'),
    "E307 too long": state(f'"{"s" * 101}": "f64"'),
    "E307 a blank": state('"a b": "f64"'),
    "E307 a digit": state('"1s": "f64"'),
    "E307 nothing": state('"": "f64"'),
    "E307 a dot": state('"g.speed": "f64"'),
    "E307 a Greek letter": state('"θ": "f64"'),
    "E307 health": GOOD.replace('"b": "bool"', '"health": "Health"'),
    "E307 health as an input": GOOD.replace('"h": "Health"', '"health": "Health"'),
    "E307 the name of a dictionary": state('"inputs": "f64"'),
    "E307 the name of its own dictionary": state('"state": "f64"'),
    "E307 start": state('"start": "f64"'),
    "E307 execute": GOOD.replace('"on": "bool"', '"execute": "bool"'),
    "E307 a request of another type": GOOD.replace('"TransitionRequest",\n', '"i32",\n'),
    "E307 a request as an input": GOOD.replace('"r": "Tr', '"transition_request": "Tr').replace(
        '        "transition_request": "TransitionRequest",\n', ""
    ),
    "E307 a list of requests": GOOD.replace('"TransitionRequest",\n', '"TransitionRequest[2]",\n'),
    # Invalid dictionaries of ports.
    "E306 a call": GOOD.replace('{"k": "f64"}', 'dict(k="f64")'),
    "E306 a name": "PORTS = 1\n\n\n" + GOOD.replace('{"k": "f64"}', "PORTS"),
    "E306 a set": GOOD.replace('{"k": "f64"}', '{"k"}'),
    "E306 a comprehension": GOOD.replace('{"k": "f64"}', '{n: "f64" for n in "k"}'),
    "E306 a union": GOOD.replace('{"k": "f64"}', '{} | {"k": "f64"}'),
    "E306 no value": GOOD.replace(' = {"k": "f64"}', ": dict[str, str]"),
    "E306 two stars": state('"s": "f64", **{"t": "f64"}'),
    "E306 a key that is a name": state('s: "f64"'),
    "E306 a key that is a number": state('1: "f64"'),
    "E306 a key that is an f-string": state('f"s": "f64"'),
    "E306 a key that is computed": state('"s" + "1": "f64"'),
    "E306 a key that is bytes": state('b"s": "f64"'),
    "E306 a type without quotes": state('"s": f64'),
    "E306 a type that is an array": state('"s": f64[3]'),
    "E306 a type that is a number": state('"s": 1.0'),
    "E306 a type that is an f-string": state('"s": f"f64"'),
    "E306 a type that is computed": state('"s": "f64" + "[3]"'),
    "E306 a type that is a tuple": state('"s": ("f64", "rad")'),
    "E306 an annotation of numbers": GOOD.replace("parameters =", "parameters: dict[str, float] ="),
    "E306 an annotation of a list": GOOD.replace("parameters =", "parameters: list[str] ="),
    "E306 a constant annotation": GOOD.replace("parameters =", "parameters: Final[dict[str, str]] ="),
    # Invalid parts of a class.
    "E305 bases": GOOD.replace("class Alg:", "class Alg(object):"),
    "E305 a metaclass": GOOD.replace("class Alg:", "class Alg(metaclass=type):"),
    "E305 a decorator": "@dataclass\n" + GOOD,
    "E305 another dictionary": state('"s": "f64"').replace("    state", '    locals = {"t": "f64"}\n    state'),
    "E305 a misspelt dictionary": GOOD.replace("    parameters", "    paramters"),
    "E305 a dictionary in the singular": GOOD.replace("    inputs", "    input"),
    "E305 a constant": GOOD.replace("    parameters", "    LIMIT = 2.0\n    parameters"),
    "E305 a constant that is used": execute("self.y = self.LIMIT", PORTS + "    LIMIT = 2.0\n"),
    "E305 a typed constant": GOOD.replace("    parameters", "    limit: float = 2.0\n    parameters"),
    "E305 a port that is annotated": execute("self.y = self.rate", PORTS + "    rate: f64\n"),
    "E305 two dictionaries at once": GOOD + '    inputs_, outputs_ = {"a": "f64"}, {"c": "f64"}\n',
    "E305 a chain of dictionaries": GOOD + "    more = others = {}\n",
    "E305 slots": GOOD.replace("    parameters", '    __slots__ = ("t",)\n    parameters'),
    "E305 added to a dictionary": GOOD.replace("\n    def", '    state |= {"t": "f64"}\n\n    def'),
    "E305 a nested class": GOOD + "\n    class Inner:\n        pass\n",
    "E305 a statement": GOOD + "\n    if True:\n        LIMIT = 2.0\n",
    "E305 an import": GOOD.replace("    parameters", "    from math import sin\n    parameters"),
    "E305 a method": GOOD + "\n    def limited(self, a: f64) -> f64:\n        return min(a, 1.0)\n",
    "E305 a method that is called": execute("self.y = 1.0") + "\n    def reset(self):\n        self.s = 0.0\n",
    "E305 a constructor": GOOD + "\n    def __init__(self):\n        self.s = 0.0\n",
    "E305 a property": GOOD + "\n    @property\n    def double(self):\n        return 2.0 * self.x\n",
    "E305 a static method": GOOD + "\n    @staticmethod\n    def half(a: f64) -> f64:\n        return 0.5 * a\n",
    "E305 a misspelt start": GOOD + "\n    def strat(self):\n        self.s = 1.0\n",
    "E305 a misspelt execute": GOOD.replace("execute", "excute"),
    "E305 an async execute": GOOD.replace("    def", "    async def"),
    "E305 a lambda": PORTS + "    execute = lambda self: None\n",
    # Methods.
    "E309 no execute": PORTS,
    "E309 nothing": "class Alg:\n    pass\n",
    "E309 only a start": PORTS + "\n    def start(self):\n        self.s = 1.0\n",
    "E303 execute outside": GOOD + "\n\ndef execute(self):\n    self.y = 1.0\n",
    "E303 start outside": GOOD + "\n\ndef start(self):\n    self.s = 1.0\n",
    "E310 an argument": GOOD.replace("(self)", "(self, dt)"),
    "E310 records as arguments": GOOD.replace("(self)", "(self, inputs, outputs)"),
    "E310 no self": GOOD.replace("(self)", "()"),
    "E310 another name of self": GOOD.replace("(self)", "(this)"),
    "E310 a default": GOOD.replace("(self)", "(self, dt=0.01)"),
    "E310 more arguments": GOOD.replace("(self)", "(self, *args)"),
    "E310 self by position only": GOOD.replace("(self)", "(self, /)"),
    "E310 self with a type": GOOD.replace("(self)", "(self: Alg)"),
    "E310 a decorator": GOOD.replace("    def", "    @override\n    def"),
    "E310 a class method": GOOD.replace("    def execute(self)", "    @classmethod\n    def execute(self)"),
    "E310 start with an argument": GOOD + "\n    def start(self, parameters):\n        self.s = 1.0\n",
    "E425 execute with a result": GOOD.replace("(self):", "(self) -> f64:"),
    "E425 start with a result": GOOD + "\n    def start(self) -> bool:\n        self.s = 1.0\n",
    "E409 an input in start": start("self.s = self.x"),
    "E409 an input written in start": start("self.x = 1.0"),
    "E409 a health of another in start": start('self.s = 1.0 if self.h == "failed" else 0.0'),
    "E433 health in start": start('self.health = "degraded"'),
    "E433 health read in start": start('self.b = self.health == "nominal"'),
    "E433 a request in start": start('self.transition_request = "GO"'),
    "E434 hardware in start": start("self.b = hw_read_gpio(4)"),
    "E434 a written pin in start": start("hw_write_gpio(4, True)"),
    "E422 a parameter in start": start("self.k = 1.0"),
    "E408 a request that is not declared": execute(
        'self.transition_request = ""', PORTS.replace('        "transition_request": "TransitionRequest",\n', "")
    ),
    "E408 a request that is not declared, read": execute(
        'self.b = self.transition_request == ""',
        PORTS.replace('        "transition_request": "TransitionRequest",\n', ""),
    ),
    "E408 no dictionary": GOOD.replace('    parameters = {"k": "f64"}\n', ""),
    # The module level.
    "E303 a statement": GOOD + "if True:\n    pass\n",
    "E303 a call": GOOD + 'print("hello")\n',
    "E303 a string in the middle": GOOD + '"The end."\n',
    "E303 dictionaries beside the class": 'inputs = {"z": "f64"}\n\n\n' + GOOD,
    "E303 another dictionary": 'TABLE = {"a": 1.0}\n\n\n' + GOOD,
    "E303 an execute that is async": GOOD + "async def f() -> f64:\n    return 1.0\n",
    "E303 two constants at once": "A = B = 1.0\n\n\n" + GOOD,
    "E303 a declared constant": "A: f64\n\n\n" + GOOD,
    "E308 not constant": "K = sin(1.0)\n" + GOOD,
    "E440 a constant of strings": 'WORDS = ["GO", ""]\n\n\n' + GOOD,
    "E407 a constant health": 'WORST: Health = "dead"\n\n\n' + GOOD,
    "E402 a health of another constant": 'GO: TransitionRequest = "GO"\nLEVEL: Health = GO\n\n\n' + GOOD,
    "E404 a constant that is a member": "WORST: Health = Health.failed\n\n\n" + GOOD,
    "E434 a constant that is read": "LEVEL = hw_read_adc(0)\n\n\n" + GOOD,
    # Imports.
    "E304 math": "import math\n" + GOOD,
    "E304 NumPy": "import numpy as np\n" + GOOD,
    "E304 the language's own": "import fcsl_builtins\n" + GOOD,
    "E304 names of math": "from math import sin, degrees, sqrt\n" + GOOD,
    "E304 a name of NumPy": "from numpy import arctan2\n" + GOOD,
    "E304 a package": "from os.path import join\n" + GOOD,
    "E304 dataclasses": "from dataclasses import dataclass\n" + GOOD,
    "E304 typing": "from typing import Final\n" + GOOD,
    "E304 the future": "from __future__ import division\n" + GOOD,
    "E304 the future, late": GOOD + "from __future__ import annotations\n",
    "E304 another name": "from fcsl_builtins import sin as sine\n" + GOOD,
    "E304 a file that is not there": "from frames import wrap\n\n\n" + execute("self.y = wrap(self.x)"),
    "E304 a file of another folder": "from control.frames import wrap\n\n\n" + execute("self.y = wrap(self.x)"),
    "E304 the machine": "from case import one\n" + GOOD,
    "E311 a name that is not there": "from fcsl_builtins import clmap, sin\n" + GOOD,
    "E311 a struct": "from fcsl_builtins import Goal, sin\n" + GOOD,
    "E311 another builtin of the board": "from fcsl_builtins import hw_write_duty\n" + GOOD,
    # Helpers.
    "E402 argument": helper("f(a: f64) -> f64", "return a", call="y = f(self.n)"),
    "E402 a health for a request": helper("f(a: TransitionRequest) -> f64", "return 1.0", call="y = f(self.h)"),
    "E402 a health returned for a request": helper(
        "f(a: Health) -> TransitionRequest", "return a", call="transition_request = f(self.h)"
    ),
    "E437 two results for one name": helper(
        "f(a: f64) -> tuple[f64, f64]", "return a, a", call="y = self.x\nz = f(self.x)"
    ),
    "E437 two results for three names": helper(
        "f(a: f64) -> tuple[f64, f64]", "return a, a", call="y, z, w = f(self.x)"
    ),
    "E402 two results in an output": helper("f(a: f64) -> tuple[f64, f64]", "return a, a", call="y = f(self.x)"),
    "E402 a result of another type": helper("f(a: f64) -> tuple[f64, bool]", "return a, a", call="y, z = f(self.x)"),
    "E425 three results of two": helper("f(a: f64) -> tuple[f64, f64]", "return a, a, a", call="y, z = f(self.x)"),
    "E402 one result of two": helper("f(a: f64) -> tuple[f64, f64]", "return a", call="y, z = f(self.x)"),
    "E425 two results of one": helper("f(a: f64) -> f64", "return a, a", call="y = f(self.x)"),
    "E301 a tuple of one": helper("f(a: f64) -> tuple[f64]", "return a", call="y = f(self.x)"),
    "E301 a tuple of no type": helper("f(a: f64) -> tuple[f64, double]", "return a, a", call="y, z = f(self.x)"),
    "E301 a tuple as argument": helper("f(a: tuple[f64, f64]) -> f64", "return 1.0", call="y = f(self.x)"),
    "E440 an argument of a helper": helper("f(a: f64) -> f64", "return a", call='y = f("GO")'),
    "E440 a result of a helper": helper("f(a: f64) -> f64", 'return "GO"', call="y = f(self.x)"),
    "E440 a local of a helper": helper("f(a: f64) -> f64", 'word = "GO"', "return a", call="y = f(self.x)"),
    "E407 an argument of a helper": helper("f(a: Health) -> f64", "return 1.0", call='y = f("fine")'),
    "E407 a result of a helper": helper("f(a: f64) -> Health", 'return "fine"', call="health = f(self.x)"),
    "E416 arguments of a helper": helper("f(a: f64) -> f64", "return a", call="y = f(self.x, self.x)"),
    "E422 an argument is written": helper("f(a: f64) -> f64", "a = 1.0", "return a", call="y = f(self.x)"),
    "E422 a size of a helper": helper('f(a: "f64[n]") -> f64', "n = 2", "return a[0]", call="y = f(self.w)"),
    "E422 an argument named as a builtin": helper("f(range: f64) -> f64", "return 1.0", call="y = f(self.x)"),
    "E430 recursion": helper(
        "f(a: f64) -> f64", "return g(a)\n\n\ndef g(a: f64) -> f64:\n    return f(a)", call="y = f(self.x)"
    ),
    "E431 no type": helper("f(a) -> f64", "return 1.0", call="y = f(self.x)"),
    "E431 a default of several values": helper('f(a: "f64[2]" = [1.0, 2.0]) -> f64', "return a[0]", call="y = f()"),
    "E431 a default of every element": helper('f(a: "f64[n]" = 0.0) -> f64', "return a[0]", call="y = f()"),
    "E431 a default that is a constant": 'Z: "f64[2]" = [1.0, 2.0]\n\n\n'
    + helper('f(a: "f64[2]" = Z) -> f64', "return a[0]", call="y = f()"),
    "E431 a default of a struct": helper("f(a: Goal = 0.0) -> f64", "return 1.0", call="y = f()"),
    "E402 a default of another type": helper("f(a: f64 = True) -> f64", "return a", call="y = f()"),
    "E416 an unknown argument": helper("f(a: f64 = 1.0) -> f64", "return a", call="y = f(b=self.x)"),
    "E416 arguments in another order": helper("f(a: f64, b: f64) -> f64", "return a", call="y = f(b=1.0, a=2.0)"),
    "E418 sizes that a helper does not take": helper(
        'f(a: "f64[n]", b: "f64[n]") -> f64', "return a[0]", call="y = f(self.w, [1.0, 2.0])"
    ),
    "E301 a size in capitals": helper('f(a: "f64[N]") -> f64', "return a[0]", call="y = f(self.w)"),
    "E431 no result": helper("f(a: f64)", "return a", call="y = f(self.x)"),
    "E431 nothing as result": helper("f(a: f64) -> None", "pass", call="y = f(self.x)"),
    "E431 self": helper("f(self) -> f64", "return self.x", call="y = f(self)"),
    "E406 self that is not passed": helper("f(a: f64) -> f64", "return a * self.k", call="y = f(self.x)"),
    "E406 a port of the class": helper("f(a: f64) -> f64", "return a * k", call="y = f(self.x)"),
    "E432 an end without result": helper("f(a: f64) -> f64", "if a > 0.0:", "    return a", call="y = f(self.x)"),
    "E432 dots": helper("f(a: f64) -> f64", "...", call="y = f(self.x)"),
    "E434 a helper": helper("f(a: f64) -> f64", "return a * f64(hw_read_adc(0))", call="y = f(self.x)"),
    "E434 an extern in a helper": helper("f(a: f64) -> f64", "return g(a)", call="y = f(self.x)")
    + '\n\n@extern(header="a.h")\ndef g(a: f64) -> f64: ...\n',
    "E434 an extern behind and": execute("self.b = self.on and g(self.x)")
    + '\n\n@extern(header="a.h")\ndef g(a: f64) -> bool: ...\n',
    "E434 an extern in start": start("self.b = g(1.0)") + '\n\n@extern(header="a.h")\ndef g(a: f64) -> bool: ...\n',
    "E225 an unknown request": execute('self.transition_request = "GO"'),
    "E225 an unknown request that is chosen": execute('self.transition_request = "GO" if self.on else ""'),
    "E225 an unknown request that is compared": execute('self.b = self.r == "GO"'),
    "E225 an unknown request in a list": execute(
        'wishes: "TransitionRequest[2]" = ["GO", ""]\nself.transition_request = wishes[0]'
    ),
    "E225 an unknown request of a helper": helper(
        "f(on: bool) -> TransitionRequest", 'return "GO" if on else ""', call="transition_request = f(self.on)"
    ),
    "E225 an unknown request for a helper": helper(
        "f(r: TransitionRequest) -> TransitionRequest", "return r", call='transition_request = f("GO")'
    ),
    "E225 an unknown request of a constant": 'WISH: TransitionRequest = "GO"\n\n\n'
    + execute("self.transition_request = WISH"),
    "E225 an unknown request of a list": 'WISHES: "TransitionRequest[2]" = ["", "GO"]\n\n\n'
    + execute("self.transition_request = WISHES[self.n]"),
    "E403 in a helper nobody calls": GOOD + "def f(a: f64) -> f64:\n    if a > 0.0:\n        b = a\n    return b\n",
    "E435 a body": GOOD + '@extern(header="a.h")\ndef f(a: f64) -> f64:\n    return a\n',
    "E435 no header": GOOD + "@extern\ndef f(a: f64) -> f64: ...\n",
    "E435 another language": GOOD + '@extern(header="a.h", lang="c++")\ndef f(a: f64) -> f64: ...\n',
    "E435 a health": GOOD + '@extern(header="a.h")\ndef f(a: Health) -> f64: ...\n',
    "E435 a request": GOOD + '@extern(header="a.h")\ndef f(a: f64) -> TransitionRequest: ...\n',
    "E435 a list of healths": GOOD + '@extern(header="a.h")\ndef f(a: "Health[2]") -> f64: ...\n',
    **{
        f"E435 {what}": GOOD + f'@extern(header="a.h")\ndef f({arguments}) -> f64: ...\n'
        for what, arguments in (
            ("a default", "a: f64 = 1.0"),
            ("a keyword", "*, a: f64"),
            ("arguments by place", "a: f64, /"),
            ("any number of arguments", "*a: f64"),
            ("any keywords", "**a: f64"),
        )
    },
    "W303 in a helper": "def f(a: f64) -> f64:\n    b = a\n    return a\n\n\n" + execute("self.y = f(self.x)"),
    "W304 outputs": 'class Alg:\n    outputs = {"y": "f64", "z": "f64[2]"}\n' + HEAD + "        self.y = 1.0\n",
    "W304 a request": 'class Alg:\n    outputs = {"transition_request": "TransitionRequest"}\n    state = {"n": "u32"}\n'
    + HEAD
    + "        self.n += 1\n",
    "W305 an input": 'class Alg:\n    inputs = {"x": "f64", "n": "i32"}\n    outputs = {"y": "f64"}\n'
    + HEAD
    + "        self.y = self.x\n",
    "W305 a parameter": 'class Alg:\n    parameters = {"k": "f64"}\n    outputs = {"y": "f64"}\n'
    + HEAD
    + "        self.y = 1.0\n",
    "W305 state": 'class Alg:\n    outputs = {"y": "f64"}\n    state = {"last": "f64", "unused": "f64"}\n'
    + HEAD
    + "        self.y = 1.0\n        self.last = self.y\n",
    "W301 unused": GOOD + "def f(a: f64) -> f64:\n    return a\n",
}

#: Additional files in the folder of the algorithm.
FRAMES = """\
from fcsl_builtins import extern, f64, pi

TURN = 2.0 * pi


def wrap(angle: f64) -> f64:
    return angle % TURN


@extern(header="a.h")
def measured(n: f64) -> f64: ...


class Frame:
    def execute(self):
        pass
"""


def importing(names: str, *, module: str = "frames", body: str = "self.y = wrap(self.x)") -> str:
    return f"from {module} import {names}\n\n\n" + execute(body)


MODULES: dict[str, dict[str, str]] = {
    "E311 a helper that is not there": {"alg.py": importing("warp", body="self.y = warp(self.x)"), "frames.py": FRAMES},
    "E311 an algorithm": {"alg.py": importing("Frame, wrap"), "frames.py": FRAMES},
    "E311 an extern": {"alg.py": importing("measured, wrap"), "frames.py": FRAMES},
    "E311 a builtin": {"alg.py": importing("pi, wrap"), "frames.py": FRAMES},
    "E311 everything": {"alg.py": importing("*"), "frames.py": FRAMES},
    "E311 of a file that imports it itself": {
        "alg.py": importing("wrap", module="angles"),
        "angles.py": "from frames import wrap\n",
        "frames.py": FRAMES,
    },
    "E311 of a file without names": {"alg.py": importing("wrap"), "frames.py": '"""Nothing yet."""\n'},
    "E304 the whole file": {
        "alg.py": "import frames\n\n\n" + execute("self.y = frames.wrap(self.x)"),
        "frames.py": FRAMES,
    },
    "E304 under another name": {
        "alg.py": importing("wrap as turned", body="self.y = turned(self.x)"),
        "frames.py": FRAMES,
    },
    "E304 with a dot": {"alg.py": importing("wrap", module=".frames"), "frames.py": FRAMES},
    "E304 with two dots": {"alg.py": importing("wrap", module="..frames"), "frames.py": FRAMES},
    "E304 a dot alone": {
        "alg.py": importing("frames", module=".", body="self.y = frames.wrap(self.x)"),
        "frames.py": FRAMES,
    },
    "E304 itself": {"alg.py": importing("wrap", module="alg") + "\n\ndef wrap(a: f64) -> f64:\n    return a\n"},
    "E304 one another": {
        "alg.py": importing("wrap"),
        "frames.py": "from angles import TURN\n\n\ndef wrap(angle: f64) -> f64:\n    return angle % TURN\n",
        "angles.py": "from frames import wrap\n\nTURN = 6.5\n",
    },
    "E304 a long chain": {
        "alg.py": importing("wrap", module="f0"),
        **{
            f"f{n}.py": f"from f{n + 1} import wrap\n\n\ndef f(x: f64) -> f64:\n    return wrap(x)\n" for n in range(40)
        },
        "f40.py": FRAMES,
    },
    "E304 a misspelt file": {"alg.py": importing("wrap", module="frame"), "frames.py": FRAMES},
    "E304 of a folder": {
        "alg.py": importing("frames", module="control", body="self.y = 1.0"),
        "control/frames.py": FRAMES,
    },
    "E304 a file that imports math": {"alg.py": importing("wrap"), "frames.py": "import math\n" + FRAMES},
    "E302 an imported helper that is defined": {
        "alg.py": importing("wrap") + "\n\ndef wrap(a: f64) -> f64:\n    return a\n",
        "frames.py": FRAMES,
    },
    "E302 an imported constant that is defined": {
        "alg.py": importing("TURN, wrap").replace("\n\n\n", "\n\nTURN = 6.5\n\n\n"),
        "frames.py": FRAMES,
    },
    "E302 imported twice": {"alg.py": "from frames import wrap\n" + importing("wrap"), "frames.py": FRAMES},
    "E302 imported from two files": {
        "alg.py": "from angles import wrap\n" + importing("wrap"),
        "frames.py": FRAMES,
        "angles.py": FRAMES,
    },
    "E302 an imported helper named as a struct": {
        "alg.py": importing("Goal", body="self.y = Goal(self.x)"),
        "frames.py": "def Goal(a: f64) -> f64:\n    return a\n",
    },
    "E422 an imported helper assigned": {
        "alg.py": importing("wrap", body="wrap = 1.0\nself.y = wrap"),
        "frames.py": FRAMES,
    },
    "E422 an imported constant assigned": {
        "alg.py": importing("TURN", body="TURN = 1.0\nself.y = TURN"),
        "frames.py": FRAMES,
    },
    "E404 an imported helper as value": {"alg.py": importing("wrap", body="self.y = wrap"), "frames.py": FRAMES},
    "E402 an argument of an imported helper": {
        "alg.py": importing("wrap", body="self.y = wrap(self.n)"),
        "frames.py": FRAMES,
    },
    "E416 arguments of an imported helper": {"alg.py": importing("wrap", body="self.y = wrap()"), "frames.py": FRAMES},
    "E301 a size that is an imported float": {
        "alg.py": "from frames import TURN\n\n\n" + state('"s": "f64[TURN]"'),
        "frames.py": FRAMES,
    },
    "E406 what is not imported": {
        "alg.py": importing("wrap", body="self.y = wrap(self.x) / TURN"),
        "frames.py": FRAMES,
    },
    "E402 inside a file beside": {
        "alg.py": importing("wrap"),
        "frames.py": FRAMES.replace("return angle % TURN", "return angle > TURN"),
    },
    "E430 recursion in a file beside": {
        "alg.py": importing("wrap"),
        "frames.py": FRAMES.replace("return angle % TURN", "return wrap(angle)"),
    },
    "E308 no constant in a file beside": {
        "alg.py": importing("TURN", body="self.y = TURN"),
        "frames.py": FRAMES.replace("2.0 * pi", "sin(2.0)"),
    },
    "E110 no Python beside": {"alg.py": importing("wrap"), "frames.py": "def wrap(angle: f64 -> f64:\n"},
    "E305 an algorithm beside": {
        "alg.py": importing("wrap"),
        "frames.py": FRAMES.replace("class Frame:", "class Frame(object):"),
    },
    "E225 an unknown request of a file beside": {
        "alg.py": importing("wish", body="self.transition_request = wish(self.on)"),
        "frames.py": 'def wish(on: bool) -> TransitionRequest:\n    return "GO" if on else ""\n',
    },
    "E225 an unknown request of a constant beside": {
        "alg.py": importing("WISH", body="self.transition_request = WISH"),
        "frames.py": 'WISH: TransitionRequest = "GO"\n',
    },
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


def required(condition: str, **keys: Any) -> str:
    return put("requirements", value=[{"id": "R-1", "text": "It works.", "then": condition, **keys}])


def guarded_by(condition: dict[str, str], id_: str = "R-1", source: str = "A", target: str = "B") -> str:
    """A transition for a requirement."""
    edge = {"from": source, "to": target, "requirement": id_, "priority": 2}
    return patch(
        lambda c: (
            c.update(requirements=[{"id": "R-1", "text": "It works.", **condition}]),
            c["transitions"][0].update(priority=1),
            c["transitions"].append(edge),
        )
    )


def connect(*connections: Mapping[str, Any]) -> str:
    return put("connections", value=list(connections))


def channel(*channels: Mapping[str, Any]) -> str:
    base = {"name": "a", "id": 1, "field": "one.inputs.x", "direction": "sensor"}
    return put("channels", value=[{**base, **c} for c in channels])


def service(*keys: Mapping[str, Any], field: str = "two.inputs.on", **channel_keys: Any) -> str:
    """Channels of services of these keys: one that is fine where they say nothing."""
    base = {"type": "std_srvs/Trigger", "service": "go", "accepted": "machine.state == 'B'"}
    fields = (field, "one.inputs.on")
    return channel(
        *(
            {"name": f"go{i}", "id": i + 1, "field": fields[i], "ros": {**base, **k}, **channel_keys}
            for i, k in enumerate(keys)
        )
    )


def panel(*paths: str, **keys: Any) -> str:
    """One panel with these curves."""
    return put("views", value={"panels": [{"title": "t", "values": list(paths), **keys}]})


def body(**keys: Any) -> str:
    """A panel and a body."""
    panels = [{"title": "t", "values": ["one.outputs.y"]}]
    return put("views", value={"panels": panels, "body": {"shape": "rover", **keys}})


def frames(*placed: dict[str, Any]) -> str:
    """A panel and frames."""
    panels = [{"title": "t", "values": ["one.outputs.y"]}]
    return put("views", value={"panels": panels, "frames": list(placed)})


def frame(name: str = "imu", parent: str = "base", **keys: Any) -> dict[str, Any]:
    return {"frame": name, "parent": parent, **keys}


def heard(source: str, direction: str = "sensor", **keys: Any) -> str:
    """Sensor v.a and actuator force, and a connection from a value of their channels to a bool."""
    channels = [
        {"name": "v.a", "id": 1, "field": "one.inputs.x", "direction": direction},
        {"name": "force", "id": 2, "field": "two.outputs.y", "direction": "actuator"},
    ]
    return patch(lambda c: c.update(channels=channels, connections=[{"from": source, "to": "one.on", **keys}]))


def mapped(*ros: Mapping[str, Any], **keys: Any) -> str:
    """Sensors v.a, v.b of three numbers, mapped to the rates of an Imu, with the given changes."""
    rates = {"type": "sensor_msgs/Imu", "field": "angular_velocity"}
    pairs = zip("ab", ("one.inputs.w", "two.inputs.w"), ros, strict=False)
    return channel(
        *({"name": f"v.{n}", "id": ord(n), "field": field, "ros": {**rates, **r}, **keys} for n, field, r in pairs)
    )


ACTUATOR = {"name": "force", "id": 1, "field": "two.outputs.y", "direction": "actuator"}


def armed(arm: Any, *actuators: Mapping[str, Any]) -> str:
    """`arm`, and these actuators; without any, one that has its safe value."""
    channels = [{**ACTUATOR, **a} for a in actuators or ({"safe": 0.0},)]
    return patch(lambda c: c.update(arm=arm, channels=channels))


def safe(field: str, value: Any, message: str) -> str:
    """An actuator with a safe value, mapped to the `data` of a message of std_msgs."""
    ros = {"type": f"std_msgs/{message}", "field": "data"}
    return put("channels", value=[{**ACTUATOR, "field": field, "safe": value, "ros": ros}])


def timeout(seconds: Any) -> str:
    return patch(lambda c: c.update(command_timeout_s=seconds, channels=[{**ACTUATOR, "safe": 0.0}]))


def edge(**keys: Any) -> str:
    return put("transitions", value=[{"from": "A", "to": "B", **keys}])


GUARD = {"instance": "one", "in": ["failed"]}


def guarded_in_b(healths: list[str]) -> str:
    """A transition back from a state that schedules nothing."""
    back = {"from": "B", "to": "A", "health": {"instance": "one", "in": healths}}
    return patch(lambda c: c["transitions"].append(back))


CONFIGS: dict[str, str] = {
    "E100 a source that is not there": put("algorithms", "Alg", "source", value="nothing.py"),
    "E101 a comma": '{"tick_hz": 100,}',
    "E101 a single quote": "{'tick_hz': 100}",
    "E101 the end": '{"tick_hz": [1, 2',
    "E101 a comment": '{\n// rate\n"tick_hz": 1}',
    "E101 NaN": put("instances", "one", "parameters", "k", value=float("nan")),
    "E101 too deep": "[" * 100,
    "E102 a key twice": json.dumps(CONFIG).replace('"tick_hz": 100', '"tick_hz": 100, "tick_hz": 100'),
    "E103 outside the folder": put("algorithms", "Alg", "source", value="../alg.py"),
    "E103 a package": put("algorithms", "Alg", "source", value="package://nowhere/alg.py"),
    "E104 a simulation": json.dumps({"controller": {"machine": "lander.json"}, "models": {}}),
    "E105 a board": json.dumps({"machine": "lander.json", "devices": {}, "sensors": {}}),
    "E201 a key": put("tick_hertz", value=1),
    "E201 a misspelt request": edge(reqest="GO"),
    "E202 a missing key": patch(lambda c: c.pop("states")),
    "E203 a name": put("instances", "a b", value={"algorithm": "Alg", "parameters": {"k": 1}}),
    "E203 a request": edge(request="GO HOME"),
    "E203 a request none": edge(request="none"),
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
    "E206 a class": patch(lambda c: c.update(algorithms={"Alg": {"source": "alg.py", "class": "Algo"}})),
    "E206 a class that is named otherwise": patch(
        lambda c: (
            c["algorithms"].update(damper={"source": "alg.py"}),
            c["instances"]["two"].update(algorithm="damper"),
        )
    ),
    "E206 another class of its file": patch(
        lambda c: (
            c["algorithms"].update(damper={"source": "alg.py", "class": "Damper"}),
            c["instances"]["two"].update(algorithm="damper"),
        )
    ),
    "E206 an algorithm by its file": put("instances", "one", "algorithm", value="alg"),
    "E208 a class that is none": put("algorithms", "Alg", "class", value=["Alg"]),
    "E208 a source alone": put("algorithms", "Alg", value="alg.py"),
    "E208 algorithms in a list": put("algorithms", value=["alg.py"]),
    "E201 a key of an algorithm": put("algorithms", "Alg", value={"source": "alg.py", "clas": "Alg"}),
    "E202 no source": put("algorithms", "Alg", value={"class": "Alg"}),
    "E203 the name of an algorithm": patch(
        lambda c: c["algorithms"].update({"Alg 2": {"source": "alg.py", "class": "Alg"}})
    ),
    "E206 an algorithm": put("instances", "one", "algorithm", value="Algo"),
    "E206 an instance": put("states", "A", "schedule", "three", value=1),
    "E206 a state": put("initial_state", value="C"),
    "E206 a machine source": connect({"from": "machine.rate", "to": "one.x"}),
    "E207 the wrong kind": put("instances", "one", "parameters", "k", value=True),
    "E207 not finite": put("instances", "one", "inputs", value={"w": [1, 2]}),
    "E208 not an object": put("instances", "one", value=3),
    "E207 a list": put("instances", "one", "inputs", value={"n": [1]}),
    "E207 a list of lists": put("instances", "one", "inputs", value={"w": [[1], [2], [3]]}),
    "E207 a point": put("instances", "one", "inputs", value={"n": 5.0}),
    "E207 null": put("instances", "one", "inputs", value={"w": None}),
    "E208 not a string": connect({"from": 1, "to": "one.x"}),
    "E209 reserved": put("instances", "machine", value={"algorithm": "Alg"}),
    "E209 a name of channels": put("instances", "channels", value={"algorithm": "Alg"}),
    "E210 a parameter": put("instances", "one", "parameters", "kk", value=1),
    "E210 an input": put("instances", "one", "inputs", value={"xx": 1}),
    "E211 no value": put("instances", "one", "parameters", value={}),
    "E212 connected": patch(
        lambda c: (
            c.update(connections=[{"from": "two.v", "to": "one.w"}]),
            c["instances"]["one"].update(inputs={"w": [1, 2, 3]}),
        )
    ),
    "E213 two sources": connect(*[{"from": "two.v", "to": "one.w"}] * 2),
    "E213 a channel on a connected input": patch(
        lambda c: c.update(
            connections=[{"from": "two.v", "to": "one.w"}],
            channels=[{"name": "a", "id": 1, "field": "one.inputs.w", "direction": "sensor"}],
        )
    ),
    "E214 delayed without initial": connect({"from": "two.v", "to": "one.w", "delayed": True}),
    "E214 initial without delayed": connect({"from": "two.v", "to": "one.w", "initial": [0, 0, 0]}),
    "E214 an actuator's age": channel({"field": "one.outputs.y", "direction": "actuator", "max_age_ticks": 1}),
    "E215 from an input": connect({"from": "two.x", "to": "one.x"}),
    "E215 from a parameter": connect({"from": "two.k", "to": "one.x"}),
    "E215 from the state": connect({"from": "two.s", "to": "one.x"}),
    "E215 to an output": connect({"from": "two.v", "to": "one.v"}),
    "E215 to a parameter": connect({"from": "two.y", "to": "one.k"}),
    "E215 to the state": connect({"from": "two.y", "to": "one.s"}),
    "E215 to a health": connect({"from": "two.health", "to": "one.health"}),
    "E215 the wrong way round": connect({"from": "one.w", "to": "two.v"}),
    "E215 the role of a source": connect({"from": "two.outputs.v", "to": "one.w"}),
    "E215 the role of a target": connect({"from": "two.v", "to": "one.inputs.w"}),
    "E215 the roles of an input": connect({"from": "two.inputs.w", "to": "one.w"}),
    "E215 a role alone": connect({"from": "two.outputs", "to": "one.w"}),
    "E215 an instance alone": connect({"from": "two", "to": "one.w"}),
    "E215 a target that is an instance": connect({"from": "two.v", "to": "one"}),
    "E215 a member of an input": patch(
        lambda c: c.update(connections=[{"from": "two.v", "to": "one.w.x"}]),
    ),
    "E216 a source that is not there": connect({"from": "two.vv", "to": "one.w"}),
    "E216 a target that is not there": connect({"from": "two.v", "to": "one.ww"}),
    "E216 a member of a source": connect({"from": "two.v.x", "to": "one.x"}),
    "E216 an element of a source": connect({"from": "two.v[0]", "to": "one.x"}),
    "E216 a request that is not declared": patch(
        lambda c: c.update(connections=[{"from": "two.transition_requests", "to": "one.r"}]),
    ),
    "E206 a source of the machine": connect({"from": "machine.elapsd", "to": "one.x"}),
    "E206 a source of a channel": heard("channels.v.a.frsh"),
    "E206 a channel alone": heard("channels.v.a"),
    "E206 no channel": heard("channels.v.b.fresh"),
    "E206 channels alone": heard("channels"),
    "E215 of an actuator": heard("channels.force.valid"),
    "E215 of a report": patch(
        lambda c: c.update(
            channels=[{"name": "y", "id": 1, "field": "two.outputs.y", "direction": "report"}],
            connections=[{"from": "channels.y.valid", "to": "one.on"}],
        )
    ),
    "E214 of a channel and delayed": heard("channels.v.a.fresh", delayed=True, initial=False),
    "E217 an age is u32": heard("channels.v.a.age_ticks"),
    "E205 a direction, and nothing of its sources": heard("channels.v.a.fresh", direction="sensr"),
    "E217 a health to a request": connect({"from": "two.health", "to": "one.r"}),
    "E206 an instance of a connection": connect({"from": "tow.v", "to": "one.w"}),
    "E215 a channel without the record": channel({"field": "one.x"}),
    "E208 delayed as a text": connect({"from": "two.v", "to": "one.w", "delayed": "yes", "initial": [0, 0, 0]}),
    "E208 parameters as a list": put("instances", "one", "parameters", value=[1.5]),
    "E217 types": connect({"from": "two.i", "to": "one.w"}),
    "E250 a quaternion of three": channel({"field": "one.inputs.w", "as": "quaternion"}),
    "E250 a blob of floats": channel({"field": "one.inputs.w", "as": "blob"}),
    "E205 what a field is not": channel({"as": "euler"}),
    "E217 a health on a channel": channel({"field": "one.inputs.h"}),
    "E218 units": connect({"from": "two.y", "to": "one.x"}),
    "E219 no state": put("states", value={}),
    "E220 a rate": put("states", "A", "schedule", "one", value=30),
    "E221 neither request nor guard": edge(),
    "E221 a guard that is never true": edge(health={"instance": "one", "in": []}),
    "E244 between two ticks": edge(after_s=0.125),
    "E244 less than a tick": edge(after_s=0.001),
    "E244 no decimals below": patch(
        lambda c: (
            c.update(tick_hz=3, transitions=[{"from": "A", "to": "B", "after_s": 2.5}]),
            [s["schedule"].update({n: {"every": 1} for n in s["schedule"]}) for s in c["states"].values()],
        )
    ),
    "E204 a reserved id": channel({"id": 0xFF00}),
    "E204 no time": edge(after_s=0),
    "E204 before the beginning": edge(after_s=-1.5),
    "E204 too long a time": edge(after_s=1.1e12),
    "E208 a time as a text": edge(after_s="5 s"),
    "E203 a time and a wrong request": edge(after_s=5.0, request="GO HOME"),
    "W211 a longer time": put(
        "transitions",
        value=[{"from": "A", "to": "B", "after_s": n, "priority": n} for n in (5, 8)],
    ),
    "E222 to itself": edge(to="A", health=GUARD),
    "E223 a state twice": edge(**{"from": ["A", "A"]}, health=GUARD),
    "E223 no state": edge(**{"from": []}, health=GUARD),
    "E224 no priority": put("transitions", value=[{"from": "A", "to": "B", "health": GUARD}] * 2),
    "E224 equal priorities": put("transitions", value=[{"from": "A", "to": "B", "health": GUARD, "priority": 3}] * 2),
    "E236 a misspelt message": mapped({"type": "sensor_msgs/IMU"}),
    "E236 a package of somebody's": mapped({"type": "acme_msgs/Thing"}),
    "E236 a service": mapped({"type": "std_srvs/Trigger", "field": "data"}),
    "E237 a misspelt field": mapped({"field": "angular_velocty"}),
    "E237 no such field": mapped({"field": "gyro"}),
    "E237 below a number": mapped({"field": "angular_velocity.x.y"}),
    "E237 the header": mapped({"field": "header.stamp.sec"}),
    "E237 text": mapped({"type": "nav_msgs/Odometry", "field": "child_frame_id"}),
    "E237 an element of no list": mapped({"field": "angular_velocity[0]"}),
    "E237 an element beyond the end": mapped({"field": "orientation_covariance[9]"}),
    "E237 a list of no elements by key": mapped(
        {"type": "tf2_msgs/TFMessage", "field": "transforms[frame=base].transform"}
    ),
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
    "E238 a safe value beyond uint16": safe("two.outputs.i", 70000, "UInt16"),
    "E238 a safe value below int8": safe("two.outputs.i", -129, "Int8"),
    "E238 a safe value that is no bool": safe("two.outputs.i", 2, "Bool"),
    "E238 a safe value beyond float32": safe("two.outputs.y", 1e40, "Float32"),
    "E238 a number of a safe value": safe("two.outputs.v", [0.0, -4e38, 5e38], "Float32MultiArray"),
    "E218 units of a message": mapped({"type": "sensor_msgs/Imu", "field": "angular_velocity.x"}, field="one.inputs.x"),
    "E239 axes of a number": mapped(
        {"type": "geometry_msgs/Vector3", "field": "x", "axes": "frd"}, field="one.inputs.x"
    ),
    "E239 axes of an orientation": mapped({"axes": "ned/frd"}),
    "E239 a frame without header": mapped({"type": "geometry_msgs/Twist", "field": "linear", "frame": "base"}),
    "E239 a child frame": mapped({"child_frame": "base"}),
    "E258 choices of floats": mapped({"choices": ["slow", "fast"]}),
    "E258 an unknown constant": mapped(
        {"type": "sensor_msgs/BatteryState", "field": "power_supply_status", "choices": ["FULL"]}, field="one.inputs.n"
    ),
    "E258 a choice of no index": mapped(
        {"type": "nav_msgs/Odometry", "field": "child_frame_id", "choices": ["base"]}, field="one.inputs.x"
    ),
    "E258 a choice of nothing": mapped({"choices": []}),
    "E258 a choice of lists": mapped({"choices": [[1]]}),
    "E259 a condition of no field": service({"accepted": "one.outputs.z > 1.0"}),
    "E259 a condition of units that differ": service({"accepted": "one.outputs.y > one.inputs.x"}),
    "E259 a number as a condition": service({"accepted": "one.outputs.y"}),
    "E259 a state that is none": service({"refused": "machine.state == 'C'"}),
    "E259 a condition without fields": service({"accepted": "1 < 2"}),
    "E259 calls of a number": channel(
        {"ros": {"type": "std_srvs/Trigger", "service": "go", "accepted": "machine.state == 'B'"}}
    ),
    "E259 calls that go out": service({}, direction="actuator", field="one.outputs.y"),
    "E259 an age": service({}, max_age_ticks=5),
    "E259 two of one name": service({}, {}),
    "E201 a topic of a service": service({"topic": "go"}),
    "E203 a name of a service": service({"service": "~/go"}),
    "E205 another type of service": service({"type": "std_srvs/Empty"}),
    "E244 half a tick": service({"within_s": 0.015}),
    "E241 two types": mapped({}, {"type": "sensor_msgs/MagneticField", "field": "magnetic_field"}),
    "E241 two frames": mapped({"frame": "imu"}, {}),
    "E241 a field twice": mapped({}, {}),
    "E241 taken and made": channel(
        {"name": "v.a", "field": "one.inputs.w", "ros": {"type": "geometry_msgs/Twist", "field": "linear"}},
        {
            "name": "v.b",
            "id": 2,
            "field": "two.outputs.v",
            "direction": "actuator",
            "ros": {"type": "geometry_msgs/Twist", "field": "angular"},
        },
    ),
    "E241 an actuator and a report": channel(
        {"field": "two.outputs.v", "direction": "actuator"}
        | {"ros": {"type": "geometry_msgs/Pose", "field": "position", "topic": "t"}},
        {"name": "b", "id": 2, "field": "one.outputs.v", "direction": "report"}
        | {"ros": {"type": "geometry_msgs/Pose", "field": "position", "topic": "t"}},
    ),
    "E206 what arms, misspelt": armed("oen.on_out"),
    "E206 what arms is the machine's": armed("machine.resumed"),
    "E208 what arms is no text": armed(True),
    "E204 a grace below 0": channel({"start_grace_s": -0.5}),
    "E208 a grace that is no time": channel({"start_grace_s": "3 s"}),
    "E244 a grace between ticks": put("start_grace_s", value=0.0123),
    "E214 a sensor's safe value": channel({"safe": 0.0}),
    "E214 a report's safe value": channel({"field": "one.outputs.y", "direction": "report", "safe": 0.0}),
    "E214 a report's age": channel({"field": "one.outputs.y", "direction": "report", "max_age_ticks": 1}),
    "E214 an actuator's grace": channel({"field": "one.outputs.y", "direction": "actuator", "start_grace_s": 1}),
    "E214 arm without actuators": put("arm", value="one.b"),
    "E214 a time-out and sensors alone": patch(
        lambda c: c.update(
            command_timeout_s=0.1, channels=[{"name": "a", "id": 1, "field": "one.inputs.x", "direction": "sensor"}]
        )
    ),
    "E215 what arms is an input": armed("one.on"),
    "E215 what arms, with its dictionary": armed("one.outputs.b"),
    "E216 what arms is not there": armed("one.bb"),
    "E216 what arms is an element": armed("one.v[0]"),
    "E248 what arms is a number": armed("one.y"),
    "E248 what arms is a vector": armed("one.v"),
    "E248 what arms is a health": armed("one.health"),
    "E207 a safe value of another type": armed("one.b", {"safe": True}),
    "E207 a safe value of another shape": armed("one.b", {"field": "two.outputs.v", "safe": [0.0, 0.0]}),
    "E207 a safe value that is too large": armed("one.b", {"field": "two.outputs.i", "safe": 2**40}),
    "E101 a safe value that is no number": armed("one.b", {"safe": float("nan")}),
    "E101 a time-out without end": timeout(float("inf")),
    "E249 no safe value": armed("one.b", {}),
    "E249 some safe values": armed(
        "one.b",
        {"safe": 0.0},
        {"name": "b", "id": 2, "field": "two.outputs.v"},
        {"name": "c", "id": 3, "field": "two.outputs.i"},
        {"name": "d", "id": 4, "field": "one.outputs.i"},
    ),
    "E249 a time-out without safe values": patch(lambda c: c.update(command_timeout_s=0.1, channels=[ACTUATOR])),
    "E204 no time-out": timeout(0),
    "E204 a time-out before its beginning": timeout(-0.5),
    "E204 a time-out of one tick": timeout(0.01),
    "E204 a time-out of an hour": timeout(3600),
    "E208 a time-out as a text": timeout("0.1 s"),
    "E229 a channel named as the gate": armed("one.b", {"name": "gate", "safe": 0.0}),
    "E226 two names": channel({}, {"id": 2, "field": "two.inputs.x"}),
    "E226 two ids": channel({}, {"name": "b", "field": "two.inputs.x"}),
    "E226 two fields": channel({}, {"name": "b", "id": 2}),
    "E227 assigned by its algorithm": channel({"field": "one.outputs.y"}),
    "E228 a cycle": connect({"from": "one.v", "to": "two.w"}, {"from": "two.v", "to": "one.w"}),
    "E228 itself": connect({"from": "one.i", "to": "one.n"}),
    "E229 one name in C": patch(
        lambda c: c["instances"].update(
            a_b={"algorithm": "Alg", "parameters": {"k": 1}}, aB={"algorithm": "Alg", "parameters": {"k": 1}}
        )
    ),
    "E232 a struct in itself": put("structs", "Goal", "next", value="Goal"),
    "E232 a struct named as a type": put("structs", "f64", value={"a": "f32"}),
    "E232 one bracket for two sizes": put("structs", "Goal", "grid", value="f64[2, 3] m"),
    "E232 an open bracket": put("structs", "Goal", "grid", value="f64[2"),
    "E232 a member": put("structs", "Goal", "Float", value="bool"),
    "E232 members of one field": put("structs", "Goal", value={"isSet": "bool", "isset": "bool"}),
    "E232 a type": put("structs", "Goal", "rate", value="float"),
    "E233 a library": put("targets", value={"simulation": {"libraries": ["-lgpiod"]}}),
    "E233 outside the folder": put("targets", value={"simulation": {"sources": ["../a.c"]}}),
    "E233 a source that is not there": put("targets", value={"simulation": {"sources": ["a.c"]}}),
    "E206 an instance of always": put("always", value={"noe": 100}),
    "E208 always as a list": put("always", value=["one"]),
    "E220 a rate of always": patch(lambda c: (c.update(always={"one": 30}), c["states"]["A"]["schedule"].pop("one"))),
    "E243 an instance of always again": put("always", value={"one": 100}),
    "E202 no schedule where always is empty": patch(lambda c: (c.update(always={}), c["states"]["A"].clear())),
    "E234 no parameter": put("instances", "one", "frozen", value=["kk"]),
    "E100 no such mesh": body(shape="mesh", mesh="craft.glb", position="one.outputs.v"),
    "E103 a mesh outside the folder": body(shape="mesh", mesh="../craft.glb", position="one.outputs.v"),
    "E201 a key of a panel": panel("one.outputs.y", colour="red"),
    "E202 a panel without title": put("views", value={"panels": [{"values": ["one.outputs.y"]}]}),
    "E202 a body that is nowhere": body(),
    "E205 a shape": body(shape="car", position="one.outputs.v"),
    "E205 a format of a mesh": body(shape="mesh", mesh="alg.py", position="one.outputs.v"),
    "E206 an instance in a panel": panel("noe.outputs.y"),
    "E208 a path in a panel": panel(3),  # type: ignore[arg-type]
    "E214 a shape that needs a mesh": body(shape="mesh", position="one.outputs.v"),
    "E214 a mesh that is not asked for": body(mesh="craft.glb", position="one.outputs.v"),
    "E215 a panel's path without record": panel("one.y"),
    "E216 a panel's field": panel("one.outputs.yy"),
    "E245 a struct in a panel": panel("one.state.g"),
    "E245 a health in a panel": panel("one.outputs.health"),
    "E245 an element that is not there": panel("one.outputs.v[3]"),
    "E245 an angle that is no quaternion": panel("one.outputs.v", angles=True),
    "E245 a position of two": body(position=["one.outputs.i", "two.outputs.i"]),
    "E245 a position that is a scalar": body(position="one.outputs.y"),
    "E245 an array as one axis": body(position=[0, 0, "one.outputs.v"]),
    "E245 an attitude that is no quaternion": body(attitude="one.outputs.v"),
    "E246 no curves": panel(),
    "E246 no panels": put("views", value={"panels": []}),
    "E246 too many panels": put("views", value={"panels": [{"title": "t", "values": ["one.outputs.y"]}] * 17}),
    "E246 too many curves": panel("one.outputs.v", "two.outputs.v", "one.state.g.place"),
    "E246 a title of two lines": panel("one.outputs.y", title="a\nb"),
    "E247 a panel of two units": panel("one.outputs.i", "one.inputs.x", "two.outputs.y"),
    "E247 a position in seconds": body(position=["one.outputs.y", 0, 0]),
    "E203 a frame with a slash": frames(frame("/imu")),
    "E214 two rotations of a frame": frames(frame(rotation=[1, 0, 0, 0], rpy=[0, 0, 0])),
    "E252 a constant that is not there": patch(
        lambda c: (c.update(constants={"gain": 2}), c["instances"]["one"].update(parameters={"k": "gian * 2"}))
    ),
    "E252 a constant of a later one": put("constants", value={"half": "track / 2", "track": 0.4}),
    "E252 another unit": put("constants", value={"a": {"value": 1, "unit": "m"}, "b": {"value": "a", "unit": "s"}}),
    "E253 a file that is not there": patch(
        lambda c: c["instances"]["one"].update(inputs={"w": {"csv": "absent.csv", "column": "w"}})
    ),
    **{
        f"E257 {what}": required(condition)
        for what, condition in {
            "no field": "one.outputs.z > 0.0",
            "no instance": "tow.outputs.y > 0.0",
            "no condition": "one.outputs.y + 1.0",
            "units": "one.outputs.y > one.inputs.x",
            "the same at all ticks": "1 < 2",
            "a value of the coming tick": "machine.next_state == 'A'",
            "a value of a receiver": "machine.elapsed < 0.1",
            "no state of this name": "machine.state == 'C'",
            "a vector": "one.outputs.v > 0.0",
            "an index": "one.outputs.v[3] > 0.0",
            "too many indices": "one.outputs.y[0] > 0.0",
            "between two ticks": "held(one.outputs.y > 0.0, 0.015)",
            "too long a window": "max_over(one.outputs.y, 100) > 0.0",
            "no time": "held(one.outputs.y > 0.0, one.outputs.y)",
            "a condition in the place of a value": "max_over(one.outputs.y > 0.0, 0.1) > 0.5 > once(one.outputs.y)",
            "too few arguments": "since(one.outputs.y > 0.0)",
            "a function of metrics": "rms(one.outputs.y) > 0.5",
            "an instance": "one > 0.0",
            "a division by zero": "one.outputs.i // 0 < 1",
            "too many values": "one.outputs.b == (" * 8 + "one.outputs.b" + ")" * 8,
        }.items()
    },
    "E257 a value of a receiver of a channel": patch(
        lambda c: c.update(
            channels=[{"name": "v.a", "id": 1, "field": "one.inputs.x", "direction": "sensor"}],
            requirements=[{"id": "R-1", "text": "t", "never": "channels.v.a.fresh"}],
        )
    ),
    "E257 no condition in a list": put("requirements", value=[{"id": "R-1", "text": "t", "then": []}]),
    "E257 one of a list": put(
        "requirements", value=[{"id": "R-1", "text": "t", "then": ["one.outputs.y > 0.0", "two"]}]
    ),
    "E208 a list of what never holds": put(
        "requirements", value=[{"id": "R-1", "text": "t", "never": ["one.outputs.y > 0.0"]}]
    ),
    "E257 no condition of three": put("requirements", value=[{"id": "R-1", "text": "t"}]),
    "E257 a limit and no `when`": required("one.outputs.y > 0.0", within_s=0.5),
    "E257 the same id": put(
        "requirements", value=[{"id": id_, "text": "t", "never": "one.outputs.y > 0.0"} for id_ in ("R-1", "R_1")]
    ),
    "E203 an id that is a word": required("one.outputs.y > 0.0", id="state"),
    "E203 a text of two lines": required("one.outputs.y > 0.0", text="One.\nTwo."),
    "E257 too many": put(
        "requirements", value=[{"id": f"R-{i}", "text": "t", "never": "one.outputs.b"} for i in range(257)]
    ),
    "E203 an id": required("one.outputs.y > 0.0", id="R 1"),
    "E204 a text of a page": required("one.outputs.y > 0.0", text="t" * 201),
    "E206 a clock": required("one.outputs.y > 0.0", clock="tow"),
    "E205 what stale does": required("one.outputs.y > 0.0", stale="keep"),
    "E244 a limit between ticks": required("one.outputs.y > 0.0", when="one.outputs.i > 0", within_s=0.015),
    "E100 requirements of no file": put("requirements", value="absent.json"),
    "E257 an effect on two": required("one.outputs.y > 0.0", effect={"fail": "one", "degrade": "two"}),
    "E206 an effect on no instance": required("one.outputs.y > 0.0", effect={"fail": "tow"}),
    "E257 an assumption with an effect": required("one.outputs.y > 0.0", assume=True, effect={"fail": "one"}),
    "E257 an effect on what it reads": required(
        "one.outputs.health in ('nominal', 'failed')", effect={"degrade": "one"}
    ),
    "E206 a transition by no requirement": guarded_by({"never": "one.outputs.b"}, "R-7"),
    "E257 a transition at the end": guarded_by({"at_end": "one.outputs.b"}),
    "E257 a transition with two guards": edge(health={"instance": "one", "in": ["failed"]}, requirement="R-1"),
    "W209 a requirement that is not evaluated": guarded_by({"never": "one.outputs.b"}, source="B", target="A"),
    "E201 a key of a requirement": required("one.outputs.y > 0.0", wehn="one.outputs.i > 0"),
    "E251 two parents": frames(frame(), frame(parent="mast")),
    "E251 a frame in itself": frames(frame("base")),
    "E251 a loop of frames": frames(frame(), frame("base", "mast"), frame("mast", "imu"), frame("a", "imu")),
    "E251 a rotation without length": frames(frame(rotation=[0.0, 0.0, 0.0, 0.0])),
    "E251 a position of two numbers": frames(frame(position=[0.0, 0.0])),
    "E251 too many frames": frames(*(frame(f"f{i}") for i in range(65))),
    "W201 unused": patch(lambda c: c["algorithms"].update(other={"source": "alg.py", "class": "Alg"})),
    "W202 nobody asks": edge(request="GO"),
    "W209 never": guarded_in_b(["failed"]),
    "W209 always": guarded_in_b(["failed", "stale"]),
    "W209 in none of several": patch(
        lambda c: (
            c["states"].update(C={"schedule": {}}),
            c["transitions"].append({"from": "A", "to": "C", "priority": 1, "health": GUARD}),
            c["transitions"][0].update(priority=2),
            c["transitions"].append({"from": ["B", "C"], "to": "A", "health": GUARD}),
        )
    ),
    "W213 before the first run": patch(
        lambda c: (
            c["states"]["B"].update(schedule={"one": 10}),
            c["transitions"].append({"from": "B", "to": "A", "health": {"instance": "one", "in": ["failed", "stale"]}}),
            c["transitions"][0].update(health={"instance": "two", "in": ["failed"]}),
            c["states"]["A"].update(schedule={"two": 50}),
        )
    ),
    "W203 unreachable": put("transitions", value=[]),
    "W204 in no schedule": put("states", "A", "schedule", value={"one": 100}),
    "W204 what arms never runs": patch(
        lambda c: (
            c.update(arm="two.b", channels=[{**ACTUATOR, "safe": 0.0}]),
            c["states"]["A"].update(schedule={"one": 100}),
        )
    ),
    "W212 what arms stops in a state": armed("one.b"),
    "W205 from no other state": patch(
        lambda c: (c["states"].pop("B"), c["transitions"][0].update({"from": "*", "to": "A"}))
    ),
}


@cache
def all_cases() -> dict[str, tuple[str, dict[str, str]]]:
    """Machine JSON and files by name. The name begins with the code."""
    good = json.dumps(CONFIG, indent=1)
    cases = {name: (good, {"alg.py": execute(body)}) for name, body in BODIES.items()}
    # The algorithm alone in its machine, without parameters if it has none.
    for name, text in ALGORITHMS.items():
        parameters = {"k": 1.5} if '"k":' in text else {}
        instance = {"algorithm": "Alg", "parameters": parameters}
        guard = {"from": "A", "to": "B", "health": GUARD}
        cases[name] = (
            patch(lambda c, i=instance, g=guard: c.update(instances={"one": i, "two": i}, transitions=[g])),
            {"alg.py": text},
        )
    cases.update({name: (good, files) for name, files in MODULES.items()})
    cases.update({name: (config, {"alg.py": GOOD}) for name, config in CONFIGS.items()})
    kept = patch(
        lambda c: (
            c.update(connections=[{"from": "one.v", "to": "two.w"}]),
            c["states"]["B"].update(schedule={"two": 50}),
        )
    )
    cases["W206 what another state left"] = (kept, {"alg.py": execute("self.v = self.w")})
    part = {
        "tick_hz": 10,
        "initial_state": "RUN",
        "algorithms": {},
        "instances": {},
        "states": {"RUN": {"schedule": {}}},
    }
    for name, changes, of_outer in (
        ("E254 two states", {"states": {"RUN": {"schedule": {}}, "STOP": {"schedule": {}}}}, {}),
        ("E255 a struct of another unit", {"structs": {"Goal": {"place": "f64[3] m", "speed": "f64 km/h"}}}, {}),
        ("E256 a request without a name", {"requests": ["DONE", "LOST"]}, {"requests": {"LOST": "GO"}}),
    ):
        outer = patch(lambda c, o=of_outer: c["instances"].update(lights={"machine": "parts/lights.json", **o}))
        cases[name] = (outer, {"alg.py": GOOD, "parts/lights.json": json.dumps({**part, **changes}, indent=1)})
    for name, call in (
        ("E441 literals that do not ascend", "interp(self.x, [0.0, 2.0, 2.0], [0.0, 1.0, 2.0])"),
        ("E441 a constant that descends", "extrapolate(self.x, FALL, [0.0, 1.0, 2.0])"),
    ):
        cases[name] = (good, {"alg.py": "FALL = [3.0, 2.0, 1.0]\n\n\n" + execute(f"self.y = {call}")})
    packet = {"field": "one.inputs.n", "as": "blob"}
    mapped_packet = {**packet, "ros": {"type": "std_msgs/UInt32", "field": "data"}}
    for name, declared, item in (
        ("E250 a blob of no bytes", "u32[1]", packet),
        ("E250 a blob with a message", "u32[9]", mapped_packet),
        ("E217 more bytes than a channel has", "u32[16384]", {"field": "one.inputs.n"}),
    ):
        cases[name] = (channel(item), {"alg.py": GOOD.replace('"n": "i32"', f'"n": "{declared}"')})
    reply = {"field": "one.outputs.i", "direction": "actuator", "as": "blob"}
    for name, safe in (
        ("E250 a safe value of too many bytes", [3, 0, 0]),
        ("E250 a safe value that is more than a byte", [1, 256, 0]),
    ):
        cases[name] = (channel({**reply, "safe": safe}), {"alg.py": GOOD.replace('"i": "i32"', '"i": "u32[3]"')})
    slow = connect({"from": "machine.dt", "to": "two.x"})
    cases["W207 a period of its own"] = (slow, {"alg.py": GOOD.replace('"f64 m"', '"f64 s"')})
    outside = put("instances", "one", "parameters", "k", value=-0.5)
    bounds = parameter("f64 N/rad in 0..10")
    cases["E204 outside the range"] = (outside, {"alg.py": bounds})
    frozen = patch(lambda c: c["instances"]["two"].update(parameters={"k": 10.5}, frozen=True))
    cases["E204 frozen outside the range"] = (frozen, {"alg.py": bounds})
    elements = patch(
        lambda c: [
            i.update(parameters={"k": [0, k, 2]}) for i, k in zip(c["instances"].values(), (-3, -2), strict=True)
        ]
    )
    vector = parameter("i32[3] in -2..").replace("self.k", "f64(self.k[0])")
    cases["E204 elements outside the range"] = (elements, {"alg.py": vector})
    for code, type_, value in (
        ("E225 a request of the JSON", "TransitionRequest", "GO"),
        ("E225 a request in a list of the JSON", "TransitionRequest[2]", ["", "GO"]),
        ("E205 a health of the JSON", "Health", "fine"),
        ("E208 a number for a request", "TransitionRequest", 1),
        ("E208 null for a request", "TransitionRequest", None),
        ("E207 a health in a list of the JSON", "Health[2]", ["failed"]),
    ):
        named = patch(lambda c, v=value: c["instances"]["one"]["parameters"].update(wish=v))
        other = "nominal" if "Health" in type_ else ""
        named = named.replace('"k": 2', '"k": 2, "wish": ' + json.dumps([other] * 2 if "[" in type_ else other))
        cases[code] = (named, {"alg.py": GOOD.replace('{"k": "f64"}', f'{{"k": "f64", "wish": "{type_}"}}')})
    asking = {"alg.py": execute('self.transition_request = "GO"')}
    fixture = patch(lambda c: (c.update(transitions=[]), c["states"].pop("B")))
    asked = patch(
        lambda c: (
            c["states"]["A"].update(schedule={"two": 50}),
            c["states"]["B"].update(schedule={"one": 50}),
            c["instances"]["two"].update(algorithm="Other"),
            c["algorithms"].update(Other={"source": "other.py", "class": "Alg"}),
            c.update(transitions=[{"from": "A", "to": "B", "request": "GO"}]),
        )
    )
    quiet = execute("self.y = self.k", PORTS.replace(', "r": "TransitionRequest"', ""))
    asking_only = {"alg.py": execute('self.transition_request = "GO"', PORTS.replace('"r": "TransitionRequest"', ""))}
    cases["W210 a request of what does not run"] = (asked, {**asking_only, "other.py": quiet})
    cases["W208 a request that nothing lists"] = (fixture, asking)
    cases["E203 a request that nothing lists"] = (fixture, {"alg.py": execute('self.transition_request = "GO HOME"')})
    unused = {"alg.py": GOOD + "\n\nclass Other:\n    inputs = dict()\n\n    def execute(self):\n        pass\n"}
    cases["E306 of a class that nothing uses"] = (good, unused)
    return cases

# SPDX-License-Identifier: Apache-2.0
"""Diagnostic codes of algorithm files: their text (E11x), module level (E3xx), statements (E4xx), warnings (W3xx)."""

from __future__ import annotations

from .code import Code, Kind

ALGORITHM_CODES: dict[str, Code] = {
    "E110": Code(
        "not valid Python",
        "An algorithm is a Python file; CPython's own parser reads it first, and its message is shown. "
        "Expressions nested deeper than 100 levels are refused too: no human reads them, and every pass needs a "
        "bounded stack.",
        Kind.BODY,
        "if self.armed\n    self.steps = 1",
        "if self.armed:\n    self.steps = 1",
    ),
    "E111": Code(
        "a name that no C identifier can be",
        "Every name becomes an identifier in C, and often a ROS field: ASCII, and at most 100 characters. "
        "Comments and units may hold any character.",
        Kind.BODY,
        "θ = self.speed\nself.force = θ",
        "theta = self.speed  # θ\nself.force = theta",
    ),
    "E301": Code(
        "not a type",
        "A port, argument or local says how many bits it has: `float` is f64 here and `int` one of i32, i64, "
        "u32, u64, because the target computes with exactly those. Each size of an array has brackets of its own, and is a "
        "number or a module constant, since memory is laid out at compile time; a unit may stand behind the type of a port.",
        Kind.FILE,
        'class Law:\n    inputs = {"inertia": "f64[3, 3] kg*m^2"}\n\n    def execute(self):\n        pass',
        'class Law:\n    inputs = {"inertia": "f64[3][3] kg*m^2"}\n\n    def execute(self):\n        pass',
    ),
    "E302": Code(
        "a name defined twice",
        "In Python the later definition wins without a word. One name has one meaning here, and the names of the "
        "language (builtins, types, constants) keep theirs. The four dictionaries of an algorithm share one set of names, "
        "since every port is `self.<name>`.",
        Kind.FILE,
        "class Law:\n"
        '    inputs = {"rate": "f64 rad/s"}\n'
        '    outputs = {"rate": "f64 rad/s"}\n\n'
        "    def execute(self):\n"
        "        self.rate = 0.0",
        "class Law:\n"
        '    inputs = {"measured_rate": "f64 rad/s"}\n'
        '    outputs = {"rate": "f64 rad/s"}\n\n'
        "    def execute(self):\n"
        "        self.rate = self.measured_rate",
    ),
    "E303": Code(
        "a statement at module level",
        "A file declares: algorithm classes, constants and functions. Nothing runs when it is loaded; what shall run "
        "once belongs in `start`, what runs in every tick in `execute`.",
        Kind.FILE,
        "LIMITS = [1.0, 2.0]\nfor i in range(2):\n    LIMITS[i] = 0.0",
        "LIMITS = [0.0, 0.0]",
    ),
    "E304": Code(
        "an import",
        "An algorithm is compiled from its own file and the files beside it: what it does cannot depend on which NumPy is "
        "installed. Everything of the language is a builtin and needs no import; `from fcsl_builtins import …` is allowed, "
        "so that editors know the names, and `from frames import wrap` takes a helper or a constant from frames.py.",
        Kind.FILE,
        "from math import sin",
        "from fcsl_builtins import sin",
    ),
    "E305": Code(
        "not the class of an algorithm",
        "An algorithm is a plain class: the dictionaries inputs, outputs, parameters and state, and the methods execute and "
        "start. It inherits nothing, and nobody calls its methods but the machine; other functions, and constants, stand at "
        "module level.",
        Kind.FILE,
        "class Law:\n"
        '    outputs = {"force": "f64 N"}\n\n'
        "    def execute(self):\n"
        "        self.force = 1.0\n\n"
        "    def limited(self, force: f64) -> f64:\n"
        "        return min(force, 2.0)",
        "def limited(force: f64) -> f64:\n"
        "    return min(force, 2.0)\n\n\n"
        "class Law:\n"
        '    outputs = {"force": "f64 N"}\n\n'
        "    def execute(self):\n"
        "        self.force = limited(1.0)",
    ),
    "E306": Code(
        "not the declaration of a port",
        "Ports stand in literal dictionaries, name and type both as strings: the compiler reads the class and runs nothing. "
        "Values come from elsewhere: parameters from the machine JSON (so that two vehicles share one algorithm), state "
        "from `start`, outputs from `execute`.",
        Kind.FILE,
        'class Law:\n    state = {"count": 5}\n\n    def execute(self):\n        pass',
        "class Law:\n"
        '    state = {"count": "i32"}\n\n'
        "    def start(self):\n"
        "        self.count = 5\n\n"
        "    def execute(self):\n"
        "        pass",
    ),
    "E307": Code(
        "a port name that cannot be used",
        "Every output becomes a field of a ROS 2 message and of a C struct: lower_snake_case and no word of C or "
        "C++, and neither header nor tick. inputs, outputs, parameters, state, start, execute and health are the algorithm's "
        "own, and `transition_request` is the output by which it requests.",
        Kind.FILE,
        'class Law:\n    outputs = {"isReady": "bool"}\n\n    def execute(self):\n        self.isReady = True',
        'class Law:\n    outputs = {"is_ready": "bool"}\n\n    def execute(self):\n        self.is_ready = True',
    ),
    "E308": Code(
        "not a constant",
        "Module constants are folded exactly at compile time, from literals and earlier constants with + - * / // %, "
        "small powers, conversions and `sqrt`. What needs another function, or may change, is computed in `start` "
        "and kept in `state`.",
        Kind.FILE,
        "GAINS = [1.0, sin(0.5)]",
        "class Law:\n"
        '    state = {"gain": "f64"}\n\n'
        "    def start(self):\n"
        "        self.gain = sin(0.5)\n\n"
        "    def execute(self):\n"
        "        pass",
    ),
    "E309": Code(
        "no execute",
        "`execute` is what runs in a tick; without one there is nothing to schedule. A block that only holds "
        "what a sensor channel writes has an empty one.",
        Kind.FILE,
        'class Law:\n    outputs = {"rate": "f64"}',
        'class Law:\n    outputs = {"rate": "f64"}\n\n    def execute(self):\n        pass',
    ),
    "E310": Code(
        "a method with arguments of its own",
        "execute and start take `self` and nothing else: inputs, parameters, outputs and state are its fields, and nobody "
        "but the machine calls them.",
        Kind.FILE,
        "class Law:\n"
        '    outputs = {"force": "f64 N"}\n\n'
        "    def execute(self, speed: f64):\n"
        "        self.force = speed",
        "class Law:\n"
        '    inputs = {"speed": "f64 m/s"}\n'
        '    outputs = {"force": "f64"}\n\n'
        "    def execute(self):\n"
        "        self.force = self.speed",
    ),
    "E311": Code(
        "an import of a name that is not there",
        "fcsl_builtins holds exactly the names of the language, and a file beside this one shares its helpers and "
        "constants; an import that finds nothing is a slip of the pen.",
        Kind.FILE,
        "from fcsl_builtins import clmap",
        "from fcsl_builtins import clamp",
    ),
    "E312": Code(
        "a range that cannot be",
        "`in 0..10` behind the type (and unit) of a parameter bounds what its JSON value and a host may make it; `in "
        "0..` and `in ..10` leave one side open. Bounds are literals of the parameter's type, and f64 holds them "
        "exactly. Inputs, outputs and state have no range: what computes them can say `clamp`.",
        Kind.FILE,
        'class Law:\n    outputs = {"force": "f64 N in 0..10"}\n\n    def execute(self):\n        self.force = 1.0',
        'class Law:\n    outputs = {"force": "f64 N"}\n\n    def execute(self):\n        self.force = 1.0',
    ),
    "E401": Code(
        "a literal that does not fit",
        "A literal takes the type of its place, exactly. 3000000000 is no i32, 2.5 is no integer, 1 / 2 between "
        "integer literals is neither 0 nor 0.5 without saying so, and a constant division by zero is a mistake "
        "that shows before the flight.",
        Kind.BODY,
        "self.steps = 3000000000",
        "self.steps = 2000000000",
    ),
    "E402": Code(
        "a value of another type than its place",
        "Types never mix silently: a conversion costs precision or range, so it must be visible in the code. Write "
        "the conversion (`f64(n)`), a comparison where a bool is needed, or arrays of one shape.",
        Kind.BODY,
        "self.force = self.mode",
        "self.force = f64(self.mode)",
    ),
    "E403": Code(
        "a local that may have no value",
        "On some path to this line nothing has been assigned. CPython would raise UnboundLocalError in that one "
        "tick; compiled code would fly with whatever was there. Assign before the branch.",
        Kind.BODY,
        "if self.armed:\n    push = self.speed\nself.force = push",
        "push = 0.0\nif self.armed:\n    push = self.speed\nself.force = push",
    ),
    "E404": Code(
        "not a value",
        "`self`, functions and types have names but are no values: they cannot be stored, passed or compared. Name a "
        "field, or call the function.",
        Kind.BODY,
        "self.force = sin",
        "self.force = sin(self.speed)",
    ),
    "E405": Code(
        "a loop variable after its loop",
        "In Python it keeps its last value, or is undefined when the loop did not run. That difference has no "
        "place in a control law: copy what you need into a local.",
        Kind.BODY,
        "for i in range(3):\n    self.torque[i] = self.rate[i]\nself.steps = i",
        "last: i32 = 0\nfor i in range(3):\n    self.torque[i] = self.rate[i]\n    last = i\nself.steps = last",
    ),
    "E406": Code(
        "an unknown name",
        "This name is not defined. Known are locals, arguments, fields of `self`, constants and functions of this "
        "file, and the builtins of the language. Python's other builtins (sum, print, …) and modules (math, numpy) "
        "are not part of the language.",
        Kind.BODY,
        "self.force = sine(self.speed)",
        "self.force = sin(self.speed)",
    ),
    "E407": Code(
        "not a health",
        'Health is "nominal", "degraded", "failed" or "stale"; an algorithm says one of the first three of itself. '
        "Only the scheduler says stale: of an instance that the active state does not schedule, or that has not run "
        "since it was scheduled again.",
        Kind.BODY,
        'self.health = "broken"',
        'self.health = "failed"',
    ),
    "E408": Code(
        "a field that is not declared",
        "`self` has the ports of the four dictionaries and no other fields. In Python, assigning a misspelt attribute makes "
        "a new one, and the output keeps its old value for ever.",
        Kind.BODY,
        "self.forse = 1.0",
        "self.force = 1.0",
    ),
    "E409": Code(
        "an input in `start`",
        "`start` runs once, before anything else does: no connection has been copied and no sensor sampled. What depends on "
        "inputs waits for the first `execute`.",
        Kind.FILE,
        "class Law:\n"
        '    inputs = {"speed": "f64"}\n'
        '    state = {"last": "f64"}\n\n'
        "    def start(self):\n"
        "        self.last = self.speed\n\n"
        "    def execute(self):\n"
        "        self.last = self.speed",
        "class Law:\n"
        '    inputs = {"speed": "f64"}\n'
        '    state = {"last": "f64", "has_run": "bool"}\n\n'
        "    def execute(self):\n"
        "        change = self.speed - self.last if self.has_run else 0.0\n"
        "        self.last = self.speed - 0.5 * change\n"
        "        self.has_run = True",
    ),
    "E410": Code(
        "not part of the language",
        "The language holds what has a bounded time, a bounded memory and one meaning in Python and in C. The "
        "message names what to write instead: a bounded `for` for `while`, arrays for lists and tuples, state "
        "for globals.",
        Kind.BODY,
        "n: i32 = 0\nwhile n < 10:\n    n += 1\nself.steps = n",
        "n: i32 = 0\nfor i in range(10):\n    n += 1\nself.steps = n",
    ),
    "E411": Code(
        "not something to index",
        "Only arrays are indexed, with integers, one for each dimension at most.",
        Kind.BODY,
        "self.force = self.speed[0]",
        "self.force = self.rate[0]",
    ),
    "E412": Code(
        "an index out of range",
        "The compiler knows this index (a constant, or the bounds of a loop), and it lies outside the array. An "
        "index that it does not know is checked in flight and faults.",
        Kind.BODY,
        "self.force = self.rate[3]",
        "self.force = self.rate[2]",
    ),
    "E413": Code(
        "not an operation on arrays",
        "Between arrays of one shape there are + and -; with a scalar * and /. What `*` of two arrays should "
        "mean has too many answers, so name it: dot, matvec, matmul, outer, or a loop. Comparing arrays needs a "
        "norm and a tolerance.",
        Kind.BODY,
        "self.torque = self.rate * self.rate",
        "for i in range(3):\n    self.torque[i] = self.rate[i] * self.rate[i]",
    ),
    "E414": Code(
        "an integer division by zero",
        "The divisor is zero whenever this line runs, so it would fault in every tick.",
        Kind.BODY,
        "self.steps = self.mode // 0",
        "self.steps = self.mode // 2",
    ),
    "E415": Code(
        "an operator between types that do not have it",
        "Both operands of an operator have one type: f64 and i32 never meet by themselves, `/` is for floats, "
        "and a bool is not a number. Convert the side that you mean to convert.",
        Kind.BODY,
        "self.force = self.speed * self.mode",
        "self.force = self.speed * f64(self.mode)",
    ),
    "E416": Code(
        "the wrong number of arguments",
        "Arguments are given by position, all of them; there are no defaults.",
        Kind.BODY,
        "self.force = clamp(self.speed, 1.0)",
        "self.force = clamp(self.speed, -1.0, 1.0)",
    ),
    "E417": Code(
        "a size that is not a constant",
        "Every array has its size at compile time: nothing is allocated in a tick. Take the largest size and "
        "count how much of it is in use. At most 65536 elements fit.",
        Kind.BODY,
        "buffer = zeros(self.mode)\nself.force = buffer[0]",
        "buffer = zeros(8)\nself.force = buffer[0]",
    ),
    "E418": Code(
        "sizes that do not fit together",
        "A library function works on any sizes that agree as its signature says, checked here and never in "
        "flight: the columns of a matrix are as many as the vector it multiplies has elements.",
        Kind.BODY,
        "self.force = dot(self.rate, [1.0, 0.0])",
        "self.force = dot(self.rate, [1.0, 0.0, 0.0])",
    ),
    "E420": Code(
        "a line that is never reached",
        "Nothing behind a `return`, `break` or `continue` runs. Often a guard lost its `if`.",
        Kind.BODY,
        "return\nself.force = 1.0",
        "self.force = 1.0",
    ),
    "E421": Code(
        "a value that is not used",
        "Functions here have no effect but their result, so a call whose result is dropped does nothing. `==` "
        "where `=` was meant is the other usual cause.",
        Kind.BODY,
        "self.force == 1.0",
        "self.force = 1.0",
    ),
    "E422": Code(
        "something that cannot be assigned",
        "Inputs belong to whoever is connected to them, parameters to the machine JSON, a loop variable to its "
        "loop, and arguments of a helper to its caller: each has exactly one writer, which is what makes a "
        "recording replay.",
        Kind.BODY,
        "self.speed = 0.0",
        "speed = self.speed\nspeed = max(speed, 0.0)\nself.force = speed",
    ),
    "E423": Code(
        "a local declared twice",
        "`x: f64 = …` gives a local its type, once. Later assignments have no annotation.",
        Kind.BODY,
        "push: f64 = self.speed\npush: f64 = 0.5 * push\nself.force = push",
        "push: f64 = self.speed\npush = 0.5 * push\nself.force = push",
    ),
    "E424": Code(
        "a loop without a bound",
        "A tick has a worst case only if every loop has one, so a loop runs over a `range` whose bounds are "
        "constants, variables of outer loops, or parameters that every instance lists under `frozen`. Else loop to the "
        "largest count and `break` where you are done.",
        Kind.BODY,
        "for i in range(self.mode):\n    self.steps = i",
        "for i in range(10):\n    if i >= self.mode:\n        break\n    self.steps = i",
    ),
    "E425": Code(
        "a result where there is none, or none where there is one",
        "execute and start write to outputs and state and return nothing; a helper returns exactly what its "
        "annotation says.",
        Kind.BODY,
        "return self.speed",
        "self.force = self.speed",
    ),
    "E430": Code(
        "recursion, or calls too deep",
        "The stack that a tick needs is computed and printed by the build. Recursion has no such bound; a bounded "
        "loop has. Helper calls nest at most 64 deep.",
        Kind.FILE,
        "def half(a: f64) -> f64:\n"
        "    return a if a < 1.0 else half(a / 2.0)\n\n\n"
        "class Law:\n"
        '    outputs = {"force": "f64"}\n\n'
        "    def execute(self):\n"
        "        self.force = half(9.0)",
        "def half(a: f64) -> f64:\n"
        "    r = a\n"
        "    for i in range(64):\n"
        "        if r < 1.0:\n"
        "            break\n"
        "        r = r / 2.0\n"
        "    return r\n\n\n"
        "class Law:\n"
        '    outputs = {"force": "f64"}\n\n'
        "    def execute(self):\n"
        "        self.force = half(9.0)",
    ),
    "E431": Code(
        "a helper without its types",
        "A helper states the type of each argument and of its result, or results, so that each file can be read, and "
        "checked, by itself. Defaults, *args and keyword arguments are not part of the language.",
        Kind.FILE,
        "def twice(a) -> f64:\n"
        "    return 2.0 * a\n\n\n"
        "class Law:\n"
        '    outputs = {"force": "f64"}\n\n'
        "    def execute(self):\n"
        "        self.force = twice(1.5)",
        "def twice(a: f64) -> f64:\n"
        "    return 2.0 * a\n\n\n"
        "class Law:\n"
        '    outputs = {"force": "f64"}\n\n'
        "    def execute(self):\n"
        "        self.force = twice(1.5)",
    ),
    "E432": Code(
        "a helper that may end without a result",
        "On some path it runs off its end. Python would return None there, which no number of this language is.",
        Kind.FILE,
        "def floor0(a: f64) -> f64:\n"
        "    if a > 0.0:\n"
        "        return a\n\n\n"
        "class Law:\n"
        '    outputs = {"force": "f64"}\n\n'
        "    def execute(self):\n"
        "        self.force = floor0(1.5)",
        "def floor0(a: f64) -> f64:\n"
        "    if a > 0.0:\n"
        "        return a\n"
        "    return 0.0\n\n\n"
        "class Law:\n"
        '    outputs = {"force": "f64"}\n\n'
        "    def execute(self):\n"
        "        self.force = floor0(1.5)",
    ),
    "E433": Code(
        "a request or health in `start`",
        'Both are cleared before each `execute`, so a value from `start` would be lost. In `start` only "nominal" '
        'and "" are allowed.',
        Kind.FILE,
        "class Law:\n"
        '    outputs = {"force": "f64"}\n\n'
        "    def start(self):\n"
        '        self.health = "degraded"\n\n'
        "    def execute(self):\n"
        "        self.force = 1.0",
        "class Law:\n"
        '    outputs = {"force": "f64"}\n\n'
        "    def execute(self):\n"
        "        self.force = 1.0\n"
        '        self.health = "degraded"',
    ),
    "E434": Code(
        "a call outside the machine where it may not happen",
        "Call an extern or the hardware only in `execute`, and only where the call is always evaluated: not after "
        "`and` or `or`, nor in a branch of a conditional expression. Then a reader sees from the line whether the "
        "hardware is touched. Helpers are pure, and in `start` there is no hardware yet.",
        Kind.BODY,
        "self.ready = self.armed and hw_read_gpio(4)",
        "self.ready = hw_read_gpio(4) and self.armed",
    ),
    "E435": Code(
        "not the declaration of an extern",
        "An extern declares a C function that a target links: the decorator names its header, the annotations "
        "its types, and the body is `...`. Scalars are passed by value, arrays and structs by pointer to const.",
        Kind.FILE,
        'from fcsl_builtins import extern\n\n\n@extern(header="cpu_temp.h")\ndef cpu_temp_c() -> f64:\n    return 20.0',
        'from fcsl_builtins import extern\n\n\n@extern(header="cpu_temp.h")\ndef cpu_temp_c() -> f64: ...',
    ),
    "E436": Code(
        "a struct that is not built whole",
        "A struct is built from all its members, each once, by position or by name: there is no default that a "
        "new member could silently take.",
        Kind.BODY,
        "self.goal = Goal(self.rate, sped=0.0)",
        "self.goal = Goal(self.rate, speed=0.0)",
    ),
    "E437": Code(
        "values that do not match the names",
        "Unpacking gives each name one value: as many values as names, or an array that has a name and exactly "
        "that many rows.",
        Kind.BODY,
        "roll, pitch = self.rate\nself.force = roll - pitch",
        "roll, pitch, yaw = self.rate\nself.force = roll - pitch + yaw",
    ),
    "E438": Code(
        "a slice whose shape is not known, or not there",
        "A slice is a value, and the shape of a value is known at compile time: its ends are constants inside "
        "the array, it is not empty and has no step. Python would cut a slice off at the end of the array in "
        "silence.",
        Kind.BODY,
        "self.torque = self.rate[1:4]",
        "self.torque[0:2] = self.rate[1:3]",
    ),
    "E439": Code(
        "a shift out of range",
        "A number of n bits is shifted by 0 to n - 1. Beyond that C has no answer, and Python another one than "
        "any processor.",
        Kind.BODY,
        "self.steps = self.mode >> 32",
        "self.steps = self.mode >> 31",
    ),
    "E440": Code(
        "a string that names nothing",
        "A string is the name of a request or of a health, and its place says of which: a field, an argument, a result, a "
        "member, a local that is declared so, or the other side of a comparison. There is no other text in the language.",
        Kind.BODY,
        'word = "ABORT"\nself.transition_request = word',
        'word: TransitionRequest = "ABORT"\nself.transition_request = word',
    ),
    "W301": Code(
        "a helper that nothing calls",
        "It is checked all the same and not compiled. Dead code in a flight program is read by every reviewer.",
        Kind.FILE,
        "def twice(a: f64) -> f64:\n    return 2.0 * a",
        "def twice(a: f64) -> f64:\n"
        "    return 2.0 * a\n\n\n"
        "class Law:\n"
        '    outputs = {"force": "f64"}\n\n'
        "    def execute(self):\n"
        "        self.force = twice(1.5)",
    ),
    "W302": Code(
        "a fault that may follow a write outside the machine",
        "A fault takes back what this `execute` wrote to outputs and state, but not what it wrote to hardware or "
        "through an extern. Compute first and write last; or, where a fault cannot happen, let the types show it.",
        Kind.BODY,
        "hw_write_gpio(4, self.armed)\nself.steps = self.steps + self.mode",
        "self.steps = self.steps + self.mode\nhw_write_gpio(4, self.armed)",
    ),
    "W303": Code(
        "a local that is never read",
        "What is assigned to it is lost. Often it was meant to be a port, which is a field of `self`. `x += 1` reads "
        "nothing but x itself. Names that begin with `_`, and loop variables, cause no warning.",
        Kind.BODY,
        "force = -self.gain * self.speed",
        "self.force = -self.gain * self.speed",
    ),
    "W304": Code(
        "an output that is never written",
        "Neither `execute` nor `start` assigns it, and no channel fills it: it stays zero for all who read it. An "
        "empty `execute` causes no warning, because a host writes the outputs of such an algorithm.",
        Kind.FILE,
        "class Law:\n"
        '    outputs = {"force": "f64 N", "saturated": "bool"}\n\n'
        "    def execute(self):\n"
        "        self.force = 2.0",
        "class Law:\n"
        '    outputs = {"force": "f64 N", "saturated": "bool"}\n\n'
        "    def execute(self):\n"
        "        self.force = 2.0\n"
        "        self.saturated = True",
    ),
    "W305": Code(
        "an input, a parameter or state that is never used",
        "A connection to such an input carries a value that changes nothing, and so does tuning such a parameter. "
        "State that is only written causes no warning, because observers may read it. An empty `execute` causes none "
        "either.",
        Kind.FILE,
        "class Law:\n"
        '    inputs = {"rate": "f64 rad/s", "bias": "f64 rad/s"}\n'
        '    outputs = {"torque": "f64 N*m"}\n\n'
        "    def execute(self):\n"
        "        self.torque = -2.0 * self.rate",
        "class Law:\n"
        '    inputs = {"rate": "f64 rad/s", "bias": "f64 rad/s"}\n'
        '    outputs = {"torque": "f64 N*m"}\n\n'
        "    def execute(self):\n"
        "        self.torque = -2.0 * (self.rate - self.bias)",
    ),
    "W306": Code(
        "a comparison with NaN",
        "NaN equals nothing, itself included, and is neither less nor greater than anything: `==` and the order are always "
        "False, `!=` is always True. `isnan(x)` asks whether x is one.",
        Kind.BODY,
        'if self.speed == nan:\n    self.health = "failed"',
        'if isnan(self.speed):\n    self.health = "failed"',
    ),
}

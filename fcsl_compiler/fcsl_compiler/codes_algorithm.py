# SPDX-License-Identifier: Apache-2.0
"""Diagnostic codes of algorithm files: their text (E11x), module level (E3xx), statements (E4xx), warnings (W3xx)."""

from __future__ import annotations

from .codes import Code, Kind

ALGORITHM_CODES: dict[str, Code] = {
    "E110": Code(
        "not valid Python",
        "An algorithm is a Python file; CPython's own parser reads it first, and its message is shown. "
        "Expressions nested deeper than 100 levels are refused too: no human reads them, and every pass needs a "
        "bounded stack.",
        Kind.BODY,
        "if u.armed\n    y.steps = 1",
        "if u.armed:\n    y.steps = 1",
    ),
    "E111": Code(
        "a name that no C identifier can be",
        "Every name becomes an identifier in C, and often a ROS field: ASCII, and at most 100 characters. "
        "Comments and units may hold any character.",
        Kind.BODY,
        "θ = u.speed\ny.force = θ",
        "theta = u.speed  # θ\ny.force = theta",
    ),
    "E301": Code(
        "not a type",
        "A port, argument or local says how many bits it has: `float` is f64 here and `int` one of i32, i64, "
        "u32, u64, because the target computes with exactly those. Array sizes are numbers or module constants, "
        "since memory is laid out at compile time; a unit may stand behind the type of a port.",
        Kind.FILE,
        "class Inputs:\n    speed: float\n\n\ndef execute(u: Inputs) -> None:\n    pass",
        'class Inputs:\n    speed: "f64 m/s"\n\n\ndef execute(u: Inputs) -> None:\n    pass',
    ),
    "E302": Code(
        "a name defined twice",
        "In Python the later definition wins without a word. One name has one meaning here, and the names of the "
        "language (builtins, types, constants) keep theirs.",
        Kind.FILE,
        "LIMIT = 2.0\nLIMIT = 3.0",
        "LIMIT_LOW = 2.0\nLIMIT_HIGH = 3.0",
    ),
    "E303": Code(
        "a statement at module level",
        "A file declares: port classes, constants and functions. Nothing runs when it is loaded; what shall run "
        "once belongs in `start`, what runs in every tick in `execute`.",
        Kind.FILE,
        "LIMITS = [1.0, 2.0]\nfor i in range(2):\n    LIMITS[i] = 0.0",
        "LIMITS = [0.0, 0.0]",
    ),
    "E304": Code(
        "an import",
        "An algorithm is compiled from its own file: what it does cannot depend on which NumPy is installed. "
        "Everything of the language is a builtin and needs no import; `from fcsl_builtins import …` is allowed, "
        "so that editors know the names.",
        Kind.FILE,
        "from math import sin",
        "from fcsl_builtins import sin",
    ),
    "E305": Code(
        "not a port class",
        "The interface of an algorithm is four plain classes: Inputs, Parameters, Outputs, State. Behaviour "
        "lives in functions; there is nothing to inherit and nothing to instantiate.",
        Kind.FILE,
        "class Output:\n    force: f64",
        "class Outputs:\n    force: f64",
    ),
    "E306": Code(
        "not a port declaration",
        "A line of a port class is `name: type`. Values come from elsewhere: parameters from the machine JSON "
        "(so that two vehicles share one algorithm), state from `start`, outputs from `execute`.",
        Kind.FILE,
        "class State:\n    count: i32 = 5",
        "class State:\n    count: i32\n\n\ndef start(x: State) -> None:\n    x.count = 5",
    ),
    "E307": Code(
        "a port name that cannot be used",
        "Every output becomes a field of a ROS 2 message and of a C struct: lower_snake_case and no word of C or "
        "C++. The names transition_request, health, header and tick are taken by what every instance reports.",
        Kind.FILE,
        "class Outputs:\n    isReady: bool",
        "class Outputs:\n    is_ready: bool",
    ),
    "E308": Code(
        "not a constant",
        "Module constants are folded exactly at compile time, from literals and earlier constants with + - * / "
        "// % and small powers. What needs a function, or may change, is computed in `start` and kept in State.",
        Kind.FILE,
        "GAINS = [1.0, sin(0.5)]",
        "class State:\n    gain: f64\n\n\ndef start(x: State) -> None:\n    x.gain = sin(0.5)",
    ),
    "E309": Code(
        "no execute",
        "`execute` is what runs in a tick; without one there is nothing to schedule. A block that only holds "
        "what a sensor channel writes has an empty one.",
        Kind.FILE,
        "class Outputs:\n    rate: f64",
        "class Outputs:\n    rate: f64\n\n\ndef execute(y: Outputs) -> None:\n    pass",
    ),
    "E310": Code(
        "an argument that is not a record",
        "execute and start receive the algorithm's own records, each at most once, recognised by their "
        "annotation. `start` runs before anything else does, so it has no inputs.",
        Kind.FILE,
        "class Inputs:\n    speed: f64\n\n\ndef execute(speed: f64) -> None:\n    pass",
        "class Inputs:\n    speed: f64\n\n\ndef execute(u: Inputs) -> None:\n    pass",
    ),
    "E311": Code(
        "an import of a name that is not there",
        "fcsl_builtins holds exactly the names of the language; an import that an editor cannot resolve is a "
        "slip of the pen.",
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
        'class Outputs:\n    force: "f64 N in 0..10"',
        'class Outputs:\n    force: "f64 N"',
    ),
    "E401": Code(
        "a literal that does not fit",
        "A literal takes the type of its place, exactly. 3000000000 is no i32, 2.5 is no integer, 1 / 2 between "
        "integer literals is neither 0 nor 0.5 without saying so, and a constant division by zero is a mistake "
        "that shows before the flight.",
        Kind.BODY,
        "y.steps = 3000000000",
        "y.steps = 2000000000",
    ),
    "E402": Code(
        "a value of another type than its place",
        "Types never mix silently: a conversion costs precision or range, and the reader shall see where. Write "
        "the conversion (`f64(n)`), a comparison where a bool is needed, or arrays of one shape.",
        Kind.BODY,
        "y.force = u.mode",
        "y.force = f64(u.mode)",
    ),
    "E403": Code(
        "a local that may have no value",
        "On some path to this line nothing has been assigned. CPython would raise UnboundLocalError in that one "
        "tick; compiled code would fly with whatever was there. Assign before the branch.",
        Kind.BODY,
        "if u.armed:\n    push = u.speed\ny.force = push",
        "push = 0.0\nif u.armed:\n    push = u.speed\ny.force = push",
    ),
    "E404": Code(
        "not a value",
        "Records and functions have names but are no values: they cannot be stored, passed or compared. Name a "
        "field, or call the function.",
        Kind.BODY,
        "y.force = sin",
        "y.force = sin(u.speed)",
    ),
    "E405": Code(
        "a loop variable after its loop",
        "In Python it keeps its last value, or is undefined when the loop did not run. That difference has no "
        "place in a control law: copy what you need into a local.",
        Kind.BODY,
        "for i in range(3):\n    y.torque[i] = u.rate[i]\ny.steps = i",
        "last: i32 = 0\nfor i in range(3):\n    y.torque[i] = u.rate[i]\n    last = i\ny.steps = last",
    ),
    "E406": Code(
        "an unknown name",
        "Nothing of this name is in sight: locals, arguments, records, constants and functions of this file, and "
        "the builtins of the language are. Python's own builtins (len, sum, print, …) and modules (math, numpy) "
        "are not part of the language.",
        Kind.BODY,
        "y.force = sine(u.speed)",
        "y.force = sin(u.speed)",
    ),
    "E407": Code(
        "not a health",
        "Health is nominal, degraded, failed or stale; an algorithm says one of the first three of itself. Only "
        "the scheduler says stale, of what has not run in this state.",
        Kind.BODY,
        "y.health = Health.broken",
        "y.health = Health.failed",
    ),
    "E408": Code(
        "a field that is not declared",
        "A record has the fields of its class and no others. In Python, assigning a misspelt attribute makes a "
        "new one, and the output keeps its old value for ever.",
        Kind.BODY,
        "y.forse = 1.0",
        "y.force = 1.0",
    ),
    "E410": Code(
        "not part of the language",
        "The language holds what has a bounded time, a bounded memory and one meaning in Python and in C. The "
        "message names what to write instead: a bounded `for` for `while`, arrays for lists and tuples, State "
        "for globals.",
        Kind.BODY,
        "n: i32 = 0\nwhile n < 10:\n    n += 1\ny.steps = n",
        "n: i32 = 0\nfor i in range(10):\n    n += 1\ny.steps = n",
    ),
    "E411": Code(
        "not something to index",
        "Only an array that has a name is indexed, with integers, one for each dimension at most.",
        Kind.BODY,
        "y.force = u.speed[0]",
        "y.force = u.rate[0]",
    ),
    "E412": Code(
        "an index out of range",
        "The compiler knows this index (a constant, or the bounds of a loop), and it lies outside the array. An "
        "index that it does not know is checked in flight and faults.",
        Kind.BODY,
        "y.force = u.rate[3]",
        "y.force = u.rate[2]",
    ),
    "E413": Code(
        "not an operation on arrays",
        "Between arrays of one shape there are + and -; with a scalar * and /. What `*` of two arrays should "
        "mean has too many answers, so name it: dot, matvec, matmul, outer, or a loop. Comparing arrays needs a "
        "norm and a tolerance.",
        Kind.BODY,
        "y.torque = u.rate * u.rate",
        "for i in range(3):\n    y.torque[i] = u.rate[i] * u.rate[i]",
    ),
    "E414": Code(
        "an integer division by zero",
        "The divisor is zero whenever this line runs, so it would fault in every tick.",
        Kind.BODY,
        "y.steps = u.mode // 0",
        "y.steps = u.mode // 2",
    ),
    "E415": Code(
        "an operator between types that do not have it",
        "Both operands of an operator have one type: f64 and i32 never meet by themselves, `/` is for floats, "
        "and a bool is not a number. Convert the side that you mean to convert.",
        Kind.BODY,
        "y.force = u.speed * u.mode",
        "y.force = u.speed * f64(u.mode)",
    ),
    "E416": Code(
        "the wrong number of arguments",
        "Arguments are given by position, all of them; there are no defaults.",
        Kind.BODY,
        "y.force = clamp(u.speed, 1.0)",
        "y.force = clamp(u.speed, -1.0, 1.0)",
    ),
    "E417": Code(
        "a size that is not a constant",
        "Every array has its size at compile time: nothing is allocated in a tick. Take the largest size and "
        "count how much of it is in use. At most 65536 elements fit.",
        Kind.BODY,
        "buffer = zeros(u.mode)\ny.force = buffer[0]",
        "buffer = zeros(8)\ny.force = buffer[0]",
    ),
    "E418": Code(
        "sizes that do not fit together",
        "A library function works on any sizes that agree as its signature says, checked here and never in "
        "flight: the columns of a matrix are as many as the vector it multiplies has elements.",
        Kind.BODY,
        "y.force = dot(u.rate, [1.0, 0.0])",
        "y.force = dot(u.rate, [1.0, 0.0, 0.0])",
    ),
    "E420": Code(
        "a line that is never reached",
        "Nothing behind a `return`, `break` or `continue` runs. Often a guard lost its `if`.",
        Kind.BODY,
        "return\ny.force = 1.0",
        "y.force = 1.0",
    ),
    "E421": Code(
        "a value that is not used",
        "Functions here have no effect but their result, so a call whose result is dropped does nothing. `==` "
        "where `=` was meant is the other usual cause.",
        Kind.BODY,
        "y.force == 1.0",
        "y.force = 1.0",
    ),
    "E422": Code(
        "something that cannot be assigned",
        "Inputs belong to whoever is connected to them, parameters to the machine JSON, a loop variable to its "
        "loop, and arguments of a helper to its caller: each has exactly one writer, which is what makes a "
        "recording replay.",
        Kind.BODY,
        "u.speed = 0.0",
        "speed = u.speed\nspeed = max(speed, 0.0)\ny.force = speed",
    ),
    "E423": Code(
        "a local declared twice",
        "`x: f64 = …` gives a local its type, once. Later assignments have no annotation.",
        Kind.BODY,
        "push: f64 = u.speed\npush: f64 = 0.5 * push\ny.force = push",
        "push: f64 = u.speed\npush = 0.5 * push\ny.force = push",
    ),
    "E424": Code(
        "a loop without a bound",
        "A tick has a worst case only if every loop has one, so a loop runs over a `range` whose bounds are "
        "constants or variables of outer loops. Loop to the largest count and `break` where you are done.",
        Kind.BODY,
        "for i in range(u.mode):\n    y.steps = i",
        "for i in range(10):\n    if i >= u.mode:\n        break\n    y.steps = i",
    ),
    "E425": Code(
        "a result where there is none, or none where there is one",
        "execute and start write to outputs and state and return nothing; a helper returns exactly what its "
        "annotation says.",
        Kind.BODY,
        "return u.speed",
        "y.force = u.speed",
    ),
    "E430": Code(
        "recursion",
        "The stack that a tick needs is computed and printed by the build. Recursion has no such bound; a "
        "bounded loop has.",
        Kind.FILE,
        "class Outputs:\n"
        "    y: f64\n\n\n"
        "def half(a: f64) -> f64:\n"
        "    return a if a < 1.0 else half(a / 2.0)\n\n\n"
        "def execute(y: Outputs) -> None:\n"
        "    y.y = half(9.0)",
        "class Outputs:\n"
        "    y: f64\n\n\n"
        "def half(a: f64) -> f64:\n"
        "    r = a\n"
        "    for i in range(64):\n"
        "        if r < 1.0:\n"
        "            break\n"
        "        r = r / 2.0\n"
        "    return r\n\n\n"
        "def execute(y: Outputs) -> None:\n"
        "    y.y = half(9.0)",
    ),
    "E431": Code(
        "a helper without its types",
        "A helper states the type of each argument and of its one result, so that each file can be read, and "
        "checked, by itself. Defaults, *args and keyword arguments are not part of the language.",
        Kind.FILE,
        "class Outputs:\n"
        "    y: f64\n\n\n"
        "def twice(a) -> f64:\n"
        "    return 2.0 * a\n\n\n"
        "def execute(y: Outputs) -> None:\n"
        "    y.y = twice(1.5)",
        "class Outputs:\n"
        "    y: f64\n\n\n"
        "def twice(a: f64) -> f64:\n"
        "    return 2.0 * a\n\n\n"
        "def execute(y: Outputs) -> None:\n"
        "    y.y = twice(1.5)",
    ),
    "E432": Code(
        "a helper that may end without a result",
        "On some path it runs off its end. Python would return None there, which no number of this language is.",
        Kind.FILE,
        "class Outputs:\n"
        "    y: f64\n\n\n"
        "def floor0(a: f64) -> f64:\n"
        "    if a > 0.0:\n"
        "        return a\n\n\n"
        "def execute(y: Outputs) -> None:\n"
        "    y.y = floor0(1.5)",
        "class Outputs:\n"
        "    y: f64\n\n\n"
        "def floor0(a: f64) -> f64:\n"
        "    if a > 0.0:\n"
        "        return a\n"
        "    return 0.0\n\n\n"
        "def execute(y: Outputs) -> None:\n"
        "    y.y = floor0(1.5)",
    ),
    "E433": Code(
        "a request or health at the wrong place",
        "Both are the word of one run of `execute`, cleared before it. `start` is in no tick, and a helper "
        "speaks for no instance: let it return a bool, and decide in execute.",
        Kind.FILE,
        "class Outputs:\n"
        "    y: f64\n\n\n"
        "def start(y: Outputs) -> None:\n"
        "    y.health = Health.degraded\n\n\n"
        "def execute(y: Outputs) -> None:\n"
        "    y.y = 1.0",
        "class Outputs:\n"
        "    y: f64\n\n\n"
        "def execute(y: Outputs) -> None:\n"
        "    y.y = 1.0\n"
        "    y.health = Health.degraded",
    ),
    "E434": Code(
        "a call outside the machine inside something else",
        "A call of an extern or of the hardware is a statement of its own in `execute`, `value = f(…)` or "
        "`f(…)`: then its order is plain, and a fault in an argument prevents the call. Helpers are pure, and in "
        "`start` there is no hardware yet.",
        Kind.BODY,
        "y.ready = u.armed and hw_read_gpio(4)",
        "level = hw_read_gpio(4)\ny.ready = u.armed and level",
    ),
    "E435": Code(
        "not the declaration of an extern",
        "An extern declares a C function that a target links: the decorator names its header, the annotations "
        "its types, and the body is `...`. Scalars are passed by value, arrays and structs by pointer to const.",
        Kind.FILE,
        "from fcsl_builtins import extern\n\n\n"
        '@extern(header="cpu_temp.h", lang="c")\n'
        "def cpu_temp_c() -> f64:\n"
        "    return 20.0",
        'from fcsl_builtins import extern\n\n\n@extern(header="cpu_temp.h", lang="c")\ndef cpu_temp_c() -> f64: ...',
    ),
    "E436": Code(
        "a struct that is not built whole",
        "A struct is built from all its members, each once, by position or by name: there is no default that a "
        "new member could silently take.",
        Kind.BODY,
        "x.goal = Goal(u.rate, sped=0.0)",
        "x.goal = Goal(u.rate, speed=0.0)",
    ),
    "E437": Code(
        "values that do not match the names",
        "Unpacking gives each name one value: as many values as names, or an array that has a name and exactly "
        "that many rows.",
        Kind.BODY,
        "roll, pitch = u.rate\ny.force = roll - pitch",
        "roll, pitch, yaw = u.rate\ny.force = roll - pitch + yaw",
    ),
    "E438": Code(
        "a slice whose shape is not known, or not there",
        "A slice is a value, and the shape of a value is known at compile time: its ends are constants inside "
        "the array, it is not empty and has no step. Python would cut a slice off at the end of the array in "
        "silence.",
        Kind.BODY,
        "y.torque = u.rate[1:4]",
        "y.torque[0:2] = u.rate[1:3]",
    ),
    "E439": Code(
        "a shift out of range",
        "A number of n bits is shifted by 0 to n - 1. Beyond that C has no answer, and Python another one than "
        "any processor.",
        Kind.BODY,
        "y.steps = u.mode >> 32",
        "y.steps = u.mode >> 31",
    ),
    "W301": Code(
        "a helper that nothing calls",
        "It is checked all the same and not compiled. Dead code in a flight program is read by every reviewer.",
        Kind.FILE,
        "def twice(a: f64) -> f64:\n    return 2.0 * a",
        "class Outputs:\n"
        "    y: f64\n\n\n"
        "def twice(a: f64) -> f64:\n"
        "    return 2.0 * a\n\n\n"
        "def execute(y: Outputs) -> None:\n"
        "    y.y = twice(1.5)",
    ),
    "W302": Code(
        "a fault that may follow a write outside the machine",
        "A fault takes back what this `execute` wrote to outputs and state, but not what it wrote to hardware or "
        "through an extern. Compute first and write last; or, where a fault cannot happen, let the types show it.",
        Kind.BODY,
        "hw_write_gpio(4, u.armed)\ny.steps = y.steps + u.mode",
        "y.steps = y.steps + u.mode\nhw_write_gpio(4, u.armed)",
    ),
}

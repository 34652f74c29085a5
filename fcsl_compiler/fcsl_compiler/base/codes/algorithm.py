# SPDX-License-Identifier: Apache-2.0
"""Diagnostic codes of algorithm files: their text (E11x), module level (E3xx), statements (E4xx), warnings (W3xx)."""

from __future__ import annotations

from .code import Code, Kind

ALGORITHM_CODES: dict[str, Code] = {
    "E110": Code(
        "not valid Python",
        "An algorithm is a Python file. CPython's parser reads it first, and its message is shown. Expressions "
        "nested deeper than 100 levels are rejected too, because every pass needs a bounded stack.",
        Kind.BODY,
        "if self.armed\n    self.steps = 1",
        "if self.armed:\n    self.steps = 1",
    ),
    "E111": Code(
        "a name that is not a valid C identifier",
        "Every name becomes an identifier in C, and often a ROS field. It must be ASCII and at most 100 characters"
        " long. Comments and units may contain any character.",
        Kind.BODY,
        "θ = self.speed\nself.force = θ",
        "theta = self.speed  # θ\nself.force = theta",
    ),
    "E301": Code(
        "not a type",
        "The type of a port, argument or local must state its width, because the target computes with exactly that"
        " width: use f64 or f32 instead of `float`, and i32, i64, u32 or u64 instead of `int`. Each size of an "
        "array has separate brackets. A size is a number or a module constant, because memory is allocated at "
        "compile time. The type of a port may be followed by a unit.",
        Kind.FILE,
        'class Law:\n    inputs = {"inertia": "f64[3, 3] kg*m^2"}\n\n    def execute(self):\n        pass',
        'class Law:\n    inputs = {"inertia": "f64[3][3] kg*m^2"}\n\n    def execute(self):\n        pass',
    ),
    "E302": Code(
        "a name defined twice",
        "In Python a second definition silently replaces the first. In FCSL each name has one meaning, and the "
        "names of the language (builtins, types, constants) cannot be redefined. The four dictionaries of an "
        "algorithm share one namespace, because every port is `self.<name>`.",
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
        "A file contains only declarations: algorithm classes, constants and functions. Nothing is executed when "
        "it is loaded. Write code that runs once in `start`, and code that runs in every tick in `execute`.",
        Kind.FILE,
        "LIMITS = [1.0, 2.0]\nfor i in range(2):\n    LIMITS[i] = 0.0",
        "LIMITS = [0.0, 0.0]",
    ),
    "E304": Code(
        "an import",
        "An algorithm is compiled from its file and the files in the same folder, so its behaviour cannot depend "
        "on an installed version of NumPy. All names of the language are builtins and need no import. `from "
        "fcsl_builtins import …` is allowed for editors. `from frames import wrap` imports a helper or a constant "
        "from frames.py.",
        Kind.FILE,
        "from math import sin",
        "from fcsl_builtins import sin",
    ),
    "E305": Code(
        "not a valid algorithm class",
        "An algorithm is a plain class with the dictionaries inputs, outputs, parameters and state, and the "
        "methods execute and start. It has no base classes. Only the machine calls its methods. Define other "
        "functions, and constants, at module level.",
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
        "not a valid port declaration",
        "Ports are declared in literal dictionaries with names and types as strings, because the compiler reads "
        "the class without executing it. Values are not part of the declaration: parameters get them from the "
        "machine JSON (so that two vehicles can share one algorithm), state from `start`, outputs from `execute`.",
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
        "Every output becomes a field of a C struct and, in lower case, of a ROS 2 message: `P` becomes `p`. Single "
        "underscores separate letters and digits. No two outputs become the same field, and none a keyword of C or "
        "C++, `header` or `tick`. The names inputs, outputs, "
        "parameters, state, start, execute and health are reserved. `transition_request` is reserved for the "
        "output that requests a transition.",
        Kind.FILE,
        'class Law:\n    outputs = {"is__ready": "bool"}\n\n    def execute(self):\n        self.is__ready = True',
        'class Law:\n    outputs = {"is_ready": "bool"}\n\n    def execute(self):\n        self.is_ready = True',
    ),
    "E308": Code(
        "not a constant",
        "Module constants are folded exactly at compile time. They consist of literals and earlier constants with "
        "+ - * / // % and small powers. Compute a value that needs a function, or that changes, in `start` and "
        "keep it in `state`.",
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
        "`execute` is the method that runs in a tick. Without it there is nothing to schedule. A block that only "
        "stores the values of a sensor channel has an empty `execute`.",
        Kind.FILE,
        'class Law:\n    outputs = {"rate": "f64"}',
        'class Law:\n    outputs = {"rate": "f64"}\n\n    def execute(self):\n        pass',
    ),
    "E310": Code(
        "a method with arguments other than self",
        "execute and start take only `self`: inputs, parameters, outputs and state are its fields, and only the "
        "machine calls these methods.",
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
        "an import of a name that does not exist",
        "fcsl_builtins contains exactly the names of the language. A file in the same folder offers its helpers "
        "and constants. An import of any other name is probably a spelling mistake.",
        Kind.FILE,
        "from fcsl_builtins import clmap",
        "from fcsl_builtins import clamp",
    ),
    "E312": Code(
        "an invalid range",
        "`in 0..10` after the type (and unit) of a parameter limits its value in the JSON and the values that a "
        "host may set. `in 0..` and `in ..10` leave one side open. Bounds are literals of the parameter's type, or constants of the module, and"
        " must be exactly representable in f64. Inputs, outputs and state have no range: limit them with `clamp` "
        "where they are computed.",
        Kind.FILE,
        'class Law:\n    outputs = {"force": "f64 N in 0..10"}\n\n    def execute(self):\n        self.force = 1.0',
        'class Law:\n    outputs = {"force": "f64 N"}\n\n    def execute(self):\n        self.force = 1.0',
    ),
    "E313": Code(
        "an invalid default",
        "`= 2.5` behind the type, unit and range of a parameter is its value in instances whose JSON does not give one. It "
        "is written as in the machine JSON; of an array, one value is that of every element. Only parameters have defaults: "
        "outputs and state begin at zero, and `start` may assign them.",
        Kind.FILE,
        'class Law:\n    outputs = {"force": "f64 N = 2.5"}\n\n    def execute(self):\n        self.force = 1.0',
        'class Law:\n    outputs = {"force": "f64 N"}\n\n    def start(self):\n        self.force = 2.5\n\n    def execute(self):\n        pass',
    ),
    "E401": Code(
        "a literal that does not fit",
        "A literal takes the type that its context requires, and must be representable in it. 3000000000 is not an"
        " i32, 2.5 is not an integer, and the meaning of 1 / 2 between integer literals is ambiguous (0 or 0.5). A"
        " constant division by zero is reported at compile time.",
        Kind.BODY,
        "self.steps = 3000000000",
        "self.steps = 2000000000",
    ),
    "E402": Code(
        "a value of a different type than its target",
        "Types are never converted implicitly, because a conversion can lose precision or range and must be "
        "visible in the source. Write the conversion (`f64(n)`), a comparison where a bool is needed, or use "
        "arrays of the same shape.",
        Kind.BODY,
        "self.force = self.mode",
        "self.force = f64(self.mode)",
    ),
    "E403": Code(
        "a local that may have no value",
        "On some path to this line the local has not been assigned. CPython would raise UnboundLocalError in that "
        "tick; compiled code would use an undefined value. Assign the local before the branch.",
        Kind.BODY,
        "if self.armed:\n    push = self.speed\nself.force = push",
        "push = 0.0\nif self.armed:\n    push = self.speed\nself.force = push",
    ),
    "E404": Code(
        "not a value",
        "`self`, functions and types have names but are not values. They cannot be stored, passed or compared. Use"
        " a field, or call the function.",
        Kind.BODY,
        "self.force = sin",
        "self.force = sin(self.speed)",
    ),
    "E405": Code(
        "a loop variable after its loop",
        "In Python the variable keeps its last value after the loop, or is undefined if the loop did not run. "
        "Control code must not depend on this difference. Copy the value into a local within the loop.",
        Kind.BODY,
        "for i in range(3):\n    self.torque[i] = self.rate[i]\nself.steps = i",
        "last: i32 = 0\nfor i in range(3):\n    self.torque[i] = self.rate[i]\n    last = i\nself.steps = last",
    ),
    "E406": Code(
        "an unknown name",
        "No definition of this name is visible. Visible are locals, arguments, fields of `self`, constants and "
        "functions of this file, and the builtins of the language. Python's own builtins (len, sum, print, …) and "
        "modules (math, numpy) are not part of the language.",
        Kind.BODY,
        "self.force = sine(self.speed)",
        "self.force = sin(self.speed)",
    ),
    "E407": Code(
        "not a health",
        'Health is "nominal", "degraded", "failed" or "stale". An algorithm can set the first three. Only the '
        'scheduler sets "stale", for an instance that has not run in the active state.',
        Kind.BODY,
        'self.health = "broken"',
        'self.health = "failed"',
    ),
    "E408": Code(
        "a field that is not declared",
        "The fields of `self` are the ports in the four dictionaries. In Python an assignment to a misspelt "
        "attribute creates a new attribute, and the output silently keeps its old value.",
        Kind.BODY,
        "self.forse = 1.0",
        "self.force = 1.0",
    ),
    "E409": Code(
        "an input in `start`",
        "`start` runs once, before any connection is copied and any sensor sampled. Inputs have no values yet. "
        "Compute values that depend on inputs in the first `execute`.",
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
        "Every construct of the language has a bounded execution time, bounded memory and the same meaning in "
        "Python and in C. The message names the replacement: a bounded `for` instead of `while`, arrays instead of"
        " lists and tuples, state instead of globals.",
        Kind.BODY,
        "n: i32 = 0\nwhile n < 10:\n    n += 1\nself.steps = n",
        "n: i32 = 0\nfor i in range(10):\n    n += 1\nself.steps = n",
    ),
    "E411": Code(
        "not an array element",
        "Only arrays can be indexed. Indices are integers, at most one per dimension.",
        Kind.BODY,
        "self.force = self.speed[0]",
        "self.force = self.rate[0]",
    ),
    "E412": Code(
        "an index out of range",
        "The index is known at compile time (a constant, or a value within the bounds of a loop) and is outside "
        "the array. An index that is not known at compile time is checked at run time and causes a fault.",
        Kind.BODY,
        "self.force = self.rate[3]",
        "self.force = self.rate[2]",
    ),
    "E413": Code(
        "not an operation on arrays",
        "Operators and functions work element by element on arrays of the same shape, * and / on vectors. The product of "
        "two matrices is ambiguous, so name the operation: matmul, matvec, outer, or a loop. A scalar is not added to an "
        "array. A chain of comparisons would need one truth value.",
        Kind.BODY,
        "self.torque = 1.0 + self.rate",
        "self.torque = [1.0 + self.rate[0], self.rate[1], self.rate[2]]",
    ),
    "E414": Code(
        "an integer division by zero",
        "The divisor is always zero, so this line would fault in every tick.",
        Kind.BODY,
        "self.steps = self.mode // 0",
        "self.steps = self.mode // 2",
    ),
    "E415": Code(
        "an operator that these types do not have",
        "Both operands of an operator must have the same type: f64 and i32 are not combined implicitly, `/` "
        "requires floats, and a bool is not a number. Convert one of the operands explicitly.",
        Kind.BODY,
        "self.force = self.speed * self.mode",
        "self.force = self.speed * f64(self.mode)",
    ),
    "E416": Code(
        "the wrong number of arguments",
        "All arguments are given by position. There are no default values.",
        Kind.BODY,
        "self.force = clamp(self.speed, 1.0)",
        "self.force = clamp(self.speed, -1.0, 1.0)",
    ),
    "E417": Code(
        "a size that is not a constant",
        "The size of every array is fixed at compile time, because nothing is allocated in a tick. Use the maximum"
        " size and count the elements in use. An array has at most 65536 elements.",
        Kind.BODY,
        "buffer = zeros(self.mode)\nself.force = buffer[0]",
        "buffer = zeros(8)\nself.force = buffer[0]",
    ),
    "E418": Code(
        "sizes that do not fit together",
        "A library function accepts all sizes that match its signature. The compiler checks them, so there is no "
        "check at run time. For example, a matrix must have as many columns as the vector that it multiplies has "
        "elements.",
        Kind.BODY,
        "self.force = dot(self.rate, [1.0, 0.0])",
        "self.force = dot(self.rate, [1.0, 0.0, 0.0])",
    ),
    "E420": Code(
        "a line that is never reached",
        "Code after a `return`, `break` or `continue` never runs. Often an `if` is missing.",
        Kind.BODY,
        "return\nself.force = 1.0",
        "self.force = 1.0",
    ),
    "E421": Code(
        "a value that is not used",
        "Functions have no effect except their result, so a call with an unused result does nothing. Another "
        "common cause is `==` written instead of `=`.",
        Kind.BODY,
        "self.force == 1.0",
        "self.force = 1.0",
    ),
    "E422": Code(
        "a target that cannot be assigned",
        "Each value has exactly one writer: inputs are written by connections, parameters by the machine JSON, a "
        "loop variable by its loop, and arguments of a helper by its caller. This makes a recording reproducible.",
        Kind.BODY,
        "self.speed = 0.0",
        "speed = self.speed\nspeed = max(speed, 0.0)\nself.force = speed",
    ),
    "E423": Code(
        "a local declared twice",
        "`x: f64 = …` declares a local and its type once. Later assignments have no annotation.",
        Kind.BODY,
        "push: f64 = self.speed\npush: f64 = 0.5 * push\nself.force = push",
        "push: f64 = self.speed\npush = 0.5 * push\nself.force = push",
    ),
    "E424": Code(
        "a loop without a bound",
        "A tick has a worst-case execution time only if every loop has a bound. A loop therefore runs over a "
        "`range` whose bounds are constants, variables of outer loops, or parameters that every instance lists in "
        "`frozen`. Otherwise loop to the maximum count and leave with `break`.",
        Kind.BODY,
        "for i in range(self.mode):\n    self.steps = i",
        "for i in range(10):\n    if i >= self.mode:\n        break\n    self.steps = i",
    ),
    "E425": Code(
        "a return value that does not match the function",
        "execute and start write to outputs and state, and return nothing. A helper returns exactly the type in "
        "its annotation.",
        Kind.BODY,
        "return self.speed",
        "self.force = self.speed",
    ),
    "E430": Code(
        "recursion, or calls too deep",
        "The build computes and prints the stack that a tick needs. Recursion has no such bound; use a bounded "
        "loop. A chain of helper calls has at most 64 members.",
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
        "a helper without type annotations",
        "A helper declares the types of all arguments and of its result, so that a file can be read and checked on"
        " its own. Defaults, *args and keyword arguments are not part of the language.",
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
        "On some path the function ends without `return`. Python would return None, which is not a value of this "
        "language.",
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
        "Health and request belong to one run of `execute` and are cleared before it. `start` does not run in a "
        'tick. It may assign only the initial values "nominal" and "", which have no effect.',
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
        "a call outside the machine in a place where it is not allowed",
        "A call of an extern or of the hardware is allowed in `execute`, where it is always evaluated: not after "
        "`and` or `or`, and not in a branch of a conditional expression. The line then shows whether the hardware "
        "is accessed. Helpers are pure, and `start` has no hardware.",
        Kind.BODY,
        "self.ready = self.armed and hw_read_gpio(4)",
        "self.ready = hw_read_gpio(4) and self.armed",
    ),
    "E435": Code(
        "not a valid extern declaration",
        "An extern declares a function of C or Nim that a target links. The decorator names its header or its file in "
        "Nim, the annotations its types, and the body is `...`. Scalars are passed by value, arrays and structs (of C "
        "alone) by pointer to const.",
        Kind.FILE,
        'from fcsl_builtins import extern\n\n\n@extern(header="cpu_temp.h")\ndef cpu_temp_c() -> f64:\n    return 20.0',
        'from fcsl_builtins import extern\n\n\n@extern(header="cpu_temp.h")\ndef cpu_temp_c() -> f64: ...',
    ),
    "E436": Code(
        "a struct with wrong or missing members",
        "A struct is built from all its members, each exactly once, by position or by name. There are no default "
        "values, so that a new member cannot be forgotten.",
        Kind.BODY,
        "self.goal = Goal(self.rate, sped=0.0)",
        "self.goal = Goal(self.rate, speed=0.0)",
    ),
    "E437": Code(
        "values that do not match the names",
        "Unpacking gives each name one value. Write as many values as names, or an array that is stored under a "
        "name and has exactly that many rows.",
        Kind.BODY,
        "roll, pitch = self.rate\nself.force = roll - pitch",
        "roll, pitch, yaw = self.rate\nself.force = roll - pitch + yaw",
    ),
    "E438": Code(
        "a slice with unknown or invalid shape",
        "A slice is a value, and the shape of a value is known at compile time. Its ends must be constants within "
        "the array. It must not be empty and has no step. Python would silently truncate a slice at the end of the"
        " array.",
        Kind.BODY,
        "self.torque = self.rate[1:4]",
        "self.torque[0:2] = self.rate[1:3]",
    ),
    "E439": Code(
        "a shift out of range",
        "A number of n bits can be shifted by 0 to n - 1. For other counts the result is undefined in C, and "
        "Python's result differs from that of any processor.",
        Kind.BODY,
        "self.steps = self.mode >> 32",
        "self.steps = self.mode >> 31",
    ),
    "E440": Code(
        "a string without a meaning",
        "A string is the name of a request or of a health. The context determines which: a field, an argument, a "
        "result, a member, a local with a declared type, or the other operand of a comparison. The language has no"
        " other strings.",
        Kind.BODY,
        'word = "ABORT"\nself.transition_request = word',
        'word: TransitionRequest = "ABORT"\nself.transition_request = word',
    ),
    "E441": Code(
        "breakpoints that do not ascend",
        "The cell of a table that holds a point is found by bisection, so breakpoints ascend: each is greater than the one "
        "before. This is checked where they are literals, constants, or parameters with a value in the JSON. Those that a "
        "host sets later are not.",
        Kind.BODY,
        "self.force = interp(self.speed, [0.0, 2.0, 1.0], [0.0, 1.0, 2.0])",
        "self.force = interp(self.speed, [0.0, 1.0, 2.0], [0.0, 2.0, 1.0])",
    ),
    "W301": Code(
        "a helper that is never called",
        "The helper is checked but not compiled. Unused code in a flight program costs review effort.",
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
        "A fault restores outputs and state to their values before this `execute`. It cannot undo writes to "
        "hardware or through an extern. Compute first and write last, or choose types for which no fault can "
        "occur.",
        Kind.BODY,
        "hw_write_gpio(4, self.armed)\nself.steps = self.steps + self.mode",
        "self.steps = self.steps + self.mode\nhw_write_gpio(4, self.armed)",
    ),
    "W303": Code(
        "a local that is never read",
        "The assigned value is lost. Often the target should be a port, which is a field of `self`. `x += 1` does "
        "not count as a read of x. Names that begin with `_` and loop variables are not reported.",
        Kind.BODY,
        "force = -self.gain * self.speed",
        "self.force = -self.gain * self.speed",
    ),
    "W304": Code(
        "an output that is never written",
        "Neither `execute` nor `start` assigns the output, and no channel writes it: it stays zero. Algorithms "
        "with an empty `execute` are not reported, because a host writes their outputs.",
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
        "A connection to such an input has no effect, and tuning such a parameter has none either. State that is "
        "written but never read is not reported, because observers may use it. Algorithms with an empty `execute` "
        "are not reported.",
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
        "NaN is not equal to any value, itself included, and is neither less nor greater than any value. `==` and "
        "the order comparisons are always False, `!=` is always True. `isnan(x)` tests for NaN.",
        Kind.BODY,
        'if self.speed == nan:\n    self.health = "failed"',
        'if isnan(self.speed):\n    self.health = "failed"',
    ),
    "W307": Code(
        "a large array that each run copies",
        "After a fault, outputs and state are what they were before the run. Of a large array, a run remembers the elements "
        "that it writes one by one. An array that it writes as a whole or in a loop, before a statement that may fault, is "
        "copied at the beginning of each run: half a megabyte takes 20 µs, and as much stack. Nothing is copied where no "
        "statement can fault: write an index as `% SIZE` of an unsigned number, and use `wrap_add` and its kind. Or write to "
        "the array when all that may fault is done.",
        Kind.FILE,
        "class Law:\n"
        '    inputs = {"x": "f64[2]"}\n'
        '    state = {"values": "f64[4096]", "head": "i32"}\n\n'
        "    def execute(self):\n"
        "        for k in range(2):\n"
        "            self.values[self.head + k] = self.x[k]\n"
        "        self.head = (self.head + 2) % 4096",
        "class Law:\n"
        '    inputs = {"x": "f64[2]"}\n'
        '    state = {"values": "f64[4096]", "head": "i32"}\n\n'
        "    def execute(self):\n"
        "        self.values[self.head] = self.x[0]\n"
        "        self.values[self.head + 1] = self.x[1]\n"
        "        self.head = (self.head + 2) % 4096",
    ),
}

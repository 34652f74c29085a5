# SPDX-License-Identifier: Apache-2.0
"""Programs in the dialect, one for each part of the language, and how a program becomes a machine to compare with CPython."""

from pathlib import Path
from typing import Any

from fcsl_test_abi import write_machine
from fcsl_test_twins import Twins

PROGRAMS: dict[str, str] = {
    "aliasing": """
class Inputs:
    a: "f64[3]"
    m: "f64[2, 3]"
    s: "f64"
class Outputs:
    x: "f64[3]"
    m: "f64[3, 3]"
    n: "f64[2, 3]"
class State:
    h: "f64[3]"
def rotate(v: "f64[3]") -> "f64[3]":
    return [v[2], v[0], v[1]]
def twice(v: "f64[3]") -> "f64[3]":
    w = v
    w[0] = w[1] + w[2]
    return v + w
def execute(u: Inputs, y: Outputs, x: State) -> None:
    y.x = u.a
    y.x = rotate(y.x)
    y.x = [y.x[1], y.x[0] + y.x[2], y.x[1]]
    y.x = y.x + y.x
    y.x = y.x - y.x[0] * y.x
    y.x = -y.x
    y.x = y.x if u.s > 0.0 else rotate(y.x)
    y.x = twice(y.x) + twice(twice(y.x))
    x.h = x.h * 0.5 + y.x
    x.h = x.h / (u.s * u.s + 1.0)
    y.m[0] = u.a
    y.m[1] = y.m[0] + y.m[2]
    y.m[2] = y.m[1]
    y.m[0] = rotate(y.m[2])
    y.m[1] = y.m[1] - y.m[1][0] * y.m[0]
    t = y.m
    t[1, 1] = 99.5
    y.m[2] = [t[1, 1], y.m[1, 1], t[-1][-3]]
    y.n = u.m
    y.n[0] = y.n[1]
    y.n[1] = u.m[0]
    y.n = y.n + u.m
""",
    "integers": """
class Inputs:
    a: "i32"
    b: "i32"
    c: "u32"
    d: "i64"
class Outputs:
    r: "i32"
    w: "u32"
    l: "i64"
    v: "i32[4]"
    k: "u64"
LIMIT: i32 = 1000000
BIG: i64 = 2000000000
WORD: u64 = 4000000000
def execute(u: Inputs, y: Outputs) -> None:
    y.w = u.c * 2654435761 + 12345
    y.w -= 7
    y.w = -y.w
    y.k = WORD * 4 + u64(u.c)
    y.l = BIG + BIG - -BIG
    y.l = y.l + u.d
    y.r = u.a * u.b // 3 - LIMIT % 7
    y.v = [u.a, u.b, -u.a, u.a - u.b]
    y.v = y.v + y.v
    y.v[u.a] = y.v[u.b % 4] // u.b
    for i in range(4):
        y.v[i] = y.v[i] + i32(i * i) - i
""",
    "short_circuit": """
class Inputs:
    i: "i32"
    d: "i32"
    x: "f64"
class Outputs:
    hit: "bool"
    any: "bool"
    q: "i32"
    chain: "bool"
    pick: "i32"
class State:
    t: "i32[3]"
def execute(u: Inputs, y: Outputs, x: State) -> None:
    x.t = [1, 2, 3]
    y.hit = 0 <= u.i < 3 and x.t[u.i] == 2
    y.any = u.d == 0 or 6 // u.d > 1
    y.q = 12 // u.d if u.d != 0 else -1
    y.chain = 0.0 < u.x <= u.x * u.x < 9.0 != u.x
    y.pick = x.t[u.i] if u.i < 3 and not u.i < 0 else x.t[0] if y.any else x.t[2]
    if u.d > 1 and (x.t[1] // (u.d - 2) == 1 or u.x > 1.0):
        y.q = 77
""",
    "chain_order": """
class Inputs:
    a: "i32"
    b: "i32"
class Outputs:
    r: "bool"
    s: "bool"
def execute(u: Inputs, y: Outputs) -> None:
    y.r = u.a < 10 // u.b < 5
    y.s = 0 < u.a < 100 // u.a < 100 // (u.b - 3) < 50
""",
    "loops": """
N = 5
class Inputs:
    v: "f64[N]"
    stop: "i32"
    m: "i64[3, 3]"
class Outputs:
    total: "f64"
    count: "i64"
    first: "i64"
    lower: "f64"
    back: "f64[N]"
    trace: "i64"
def find(v: "f64[5]", limit: f64) -> i64:
    for i in range(N):
        if v[i] > limit:
            return i
    return -1
def execute(u: Inputs, y: Outputs) -> None:
    total = 0.0
    count = 0
    for i in range(N):
        if u.v[i] < 0.0:
            continue
        if count == i64(u.stop):
            break
        total += u.v[i]
        count += 1
    y.total = total
    y.count = count
    y.first = find(u.v, total)
    lower = 0.0
    for i in range(N):
        for j in range(i):
            if j == 2 and u.stop > 2:
                break
            lower += u.v[i] * u.v[j]
        lower = lower - u.v[i]
    y.lower = lower
    for i in range(N - 1, -1, -1):
        y.back[i] = u.v[N - 1 - i]
    for i in range(1, N, 2):
        y.back[i] -= f64(i)
    y.trace = 0
    for i in range(3):
        for j in range(i, 3):
            y.trace += u.m[i][j] * i64(i // 2 + j % 2 + i ** 2)
    for i in range(3, 3):
        y.trace = 0
""",
    "constants": """
GAIN = 0.1
TABLE = [0.5, -1.5, 2.25]
GRID = [[1, 2], [3, 4]]
FLAGS = [True, False]
SINGLE: f32 = 0.1
MIXED: "f32[2]" = [0.1, 3]
NEGATIVE: f64 = -2.5
COUNT: i64 = -3
class Inputs:
    i: "i32"
    x: "f64"
    f: "f32"
class Outputs:
    a: "f64"
    b: "f32"
    c: "i64"
    d: "bool"
    e: "f64[3]"
    g: "f32[2]"
def execute(u: Inputs, y: Outputs) -> None:
    y.a = TABLE[u.i] * GAIN + u.x * (GAIN + 0.2) - -NEGATIVE
    y.b = SINGLE * u.f + GAIN
    y.c = GRID[1][0] + GRID[0, 1] * i64(u.i) - -COUNT
    y.d = FLAGS[0] and not FLAGS[1]
    y.e = TABLE
    y.e[0] = 7.0
    y.e = y.e + TABLE
    y.g = MIXED
    y.g[1] = y.g[1] / 3 + u.f
    y.a += 2 * u.x ** 2 - u.x ** 3 / 4 + u.x ** 0 + 2.0 ** 3
""",
    "floats": """
class Inputs:
    x: "f64"
    y: "f64"
    f: "f32"
    g: "f32"
class Outputs:
    a: "f64"
    b: "f64"
    c: "f32"
    d: "f32"
    e: "i32"
    h: "f64"
def execute(u: Inputs, y: Outputs) -> None:
    y.a = clamp(u.x / u.y, min(u.x, 1.0), max(u.y, 0.0, u.x))
    y.b = sin(u.x) * cos(u.y) + atan2(u.y, u.x) - sqrt(abs(u.x)) + exp(-abs(u.y)) + hypot(u.x, u.y)
    y.c = u.f / 3 + u.g * 0.1 - f32(u.x)
    y.d = sin(u.f) + sqrt(u.g) + sign(u.f) * floor(u.g)
    y.h = u.x % u.y + u.x // u.y + f64(u.f) + (1 if u.x < u.y else 2.5) + u.x ** 2.5 + pow(u.y, -1)
    y.e = i32(u.x * 1000.0)
""",
    "calls": """
class Inputs:
    v: "f64[3]"
    k: "i32"
class Outputs:
    r: "f64"
    v: "f64[3]"
    w: "f64[3]"
    n: "i32"
class State:
    last: "f64[3]"
    ticks: "i64"
class Parameters:
    offset: "f64[3]"
    scale: "f64"
def start(p: Parameters, x: State, y: Outputs) -> None:
    x.last = p.offset * p.scale
    y.w = x.last
def half(v: "f64[3]") -> "f64[3]":
    return v / 2.0
def pick(v: "f64[3]", k: i32) -> f64:
    if k < 0:
        return -v[-k]
    return v[k]
def deep(v: "f64[3]", k: i32) -> f64:
    return pick(half(half(v)) + half(v), k) * dot(half(v), v)
def factor(n: i32) -> i32:
    return 100 // n
def execute(u: Inputs, p: Parameters, y: Outputs, x: State) -> None:
    y.v = half(y.v) + half(u.v - p.offset)
    y.v = cross3(y.v, half(y.v))
    y.r = deep(y.v, u.k) + pick(u.v, u.k)
    x.ticks += 1
    y.n = factor(u.k) + factor(factor(u.k + 1))
    x.last = y.v if x.ticks % 2 == 0 else x.last + u.v
    unread = y.n
""",
    "nested_choice": """
class Inputs:
    v: "f64[2]"
    i: "i64"
    flag: "bool"
class Outputs:
    v: "f64[2]"
    s: "f64"
    n: "i64"
def execute(u: Inputs, y: Outputs) -> None:
    y.v = [u.v[1], u.v[0]] if u.flag else u.v * u.v[u.i]
    y.s = dot(u.v if u.flag else -u.v, [1.0, u.v[u.i] if not u.flag else 2.0])
    y.n = (1 if u.flag else 2) * u.i
    y.n += 3 if u.i < 0 else 4
    t = y.v - (u.v if y.s > 0.0 else y.v)
    y.v = t if u.i == 1 else y.v
""",
    "structs": """
HOME: "Pose" = Pose([1.0, 2.0, 3.0], [1.0, 0.0, 0.0, 0.0], True)
class Inputs:
    pose: "Pose"
    targets: "Target[3]"
    i: "i32"
class Outputs:
    pose: "Pose"
    best: "Target"
    sum: "f64"
class State:
    history: "Target[2, 2]"
    last: "Pose"
def mirror(p: "Pose", s: f64) -> "Pose":
    q = p
    q.position[0] = -s * p.position[0]
    q.valid = not p.valid
    return q
def same(p: "Pose") -> "Pose":
    return p
def heavier(a: "Target", b: "Target") -> "Target":
    return a if a.weight > b.weight else b
def start(x: State) -> None:
    x.history[1, 1].pose = HOME
def execute(u: Inputs, y: Outputs, x: State) -> None:
    y.pose = mirror(u.pose, 2.0)
    alias = y.pose
    alias.position[1] = 77.0
    y.best = heavier(u.targets[0], u.targets[u.i])
    x.history[0, 1] = Target(u.pose, weight=2.5)
    x.history[0, 0] = x.history[0, 1]
    x.history[0, 0].pose.position[u.i] = 7.0
    x.last, y.pose = y.pose, x.last
    x.last = same(x.last)
    x.last.attitude[3] += alias.position[1]
    first, second, third = u.targets
    first.weight = second.weight
    row = x.history[0]
    row[1].weight = 9.0
    x.history[1, 0] = row[1] if u.pose.valid else third
    y.sum = first.weight + u.targets[0].weight + x.history[0, 1].weight + HOME.position[u.i]
    if u.i == 1:
        y.pose = HOME
        y.pose.position = [0.5, u.pose.position[0], -1]
""",
    "slices": """
N = 2
class Inputs:
    v: "f64[5]"
    m: "i32[3, 3]"
    k: "i32"
class Outputs:
    v: "f64[5]"
    m: "i32[3, 3]"
    column: "i32[3]"
    s: "f64"
    n: "i32"
class State:
    line: "f64[5]"
    cube: "u32[2, 2, 3]"
def execute(u: Inputs, y: Outputs, x: State) -> None:
    x.line = u.v
    x.line[1:4] = x.line[0:3]
    x.line[:N] += x.line[-N:]
    x.line[N:] -= [1.0, x.line[u.k], 2]
    y.v = x.line
    y.v[-3:-1] = -y.v[:2] * 0.5
    y.m = u.m
    y.m[0:2, 1] = y.m[1:, 2]
    y.m[:, 0] = y.m[2]
    y.m[u.k, 1:3] = y.m[u.k, 0:2]
    y.column = u.m[:, -1]
    a, b, c = y.column
    a, c = c, a
    y.n = a + b - c
    x.cube[1, :, 1:] = x.cube[0, :, 0:2]
    x.cube[0, 1] = [u32(7), x.cube[1, 1, 2] + 1, 3]
    x.cube[:, 1, 2] += [4000000000, 5]
    y.s = dot(y.v[1:3], x.line[0:2])
    y.v[0], y.v[1] = y.v[1], y.v[0]
    low, high = x.line[1:3]
    y.s += low * high
""",
    "bits": """
MASK: u32 = 0xF0F0
class Inputs:
    a: "u32"
    b: "u64"
    c: "i32"
    d: "i64"
    n: "i32"
class Outputs:
    a: "u32"
    b: "u64"
    c: "i32"
    d: "i64"
    e: "u32"
def execute(u: Inputs, y: Outputs) -> None:
    y.a = (u.a << 4 | 3) & ~MASK ^ u32(240) >> 2
    y.b = u.b << u.n ^ u.b >> 7
    y.c = u.c >> u.n & 255 | ~u.c
    y.d = (u.d >> 63) - ~u.d // 3 ^ -1
    y.e = 1 << u.a % 32
    y.a |= 1
    y.b <<= 1
    y.c ^= 5
    y.d >>= 2
    for i in range(8):
        y.e += u32(i >> 1) << i
        y.d += ~i & 3
""",
    "literals": """
K = 3
GAIN = 0.1
class Inputs:
    flag: "bool"
    other: "bool"
    f: "f32"
    n: "i32"
    w: "u64"
    x: "f64"
class Outputs:
    f: "f32"
    g: "f32"
    h: "f32[2]"
    n: "i32"
    w: "u64"
    x: "f64"
    k: "i64"
def pick(a: f32, n: i32) -> f32:
    return a * (GAIN if n > 2 else 1) + 0.2
def third(flag: bool) -> f32:
    if flag:
        return 1 / 3.0
    return 2
def execute(u: Inputs, y: Outputs) -> None:
    y.f = u.f * (0.1 if u.flag else 2) + third(u.other)
    t = 0.1 if u.flag else u.f
    y.g = t * t + (0.1 if u.other else 0.3) * 3.0
    if u.other:
        t = 1
    y.f += t / 3 - pick(0.7, 3 if u.flag else 1)
    y.h = [0.1, 1 if u.flag else 0.7]
    y.h = y.h * 0.1 + [u.f, 0.1] * u.f
    y.n = max(2, 1) - abs(-5) + (1 if u.flag else 2147483647) * (2 if u.other else 1)
    m = 1 if u.flag else u.n
    m -= 1
    y.n -= m // (2 if u.other else 3)
    y.w = (u.w + 1) * (4000000000 if u.flag else 2) - K
    y.x = sqrt(2) + sin(0.5) * u.x - (1 if u.flag else 2.5) / 4
    y.g = y.g + sin(0.5) * sqrt(2.0) - min(u.f, 0.3, 1)
    i = 5 if u.flag else 7
    y.k = i * i * (10 if u.other else 1)
    z = -(0 if u.flag else 0.5)
    y.x = y.x + 1.0 / z
    a, b = 1, 2.5
    y.x += f64(a) * b + pow(2, 0.5) + 2 ** 3 + 2.0 ** -1
    s = u.f
    c, s = s, 3
    y.f += c * s
""",
    "loop_variables": """
class Inputs:
    n: "i32"
    w: "u32"
class Outputs:
    n: "i32"
    w: "u32"
    k: "i64"
    x: "f64"
def execute(u: Inputs, y: Outputs) -> None:
    y.n = 0
    y.k = 0
    for i in range(3):
        for j in range(2147483645, 2147483648):
            last = j
            y.n += i * u.n
            y.w = u.w + i
            best = max(i, 1) + min(i, j) - abs(-i)
            y.k += best + last - i ** 2
            if u.n > 5:
                y.x = f64(i * j * j)
            if u.n == 3:
                y.k = j * j + j * j * i
            if u.n < -5 and i % 2 == 1:
                y.k = 7 // (i - 1)
            y.n += i32(i) if i > 1 else i
""",
    "saturation": """
class Inputs:
    a: "i32"
    b: "i32"
    c: "u64"
    x: "f64"
    f: "f32"
class Outputs:
    a: "i32"
    b: "u32"
    c: "u64"
    d: "i64"
    x: "f64"
    f: "f32"
def execute(u: Inputs, y: Outputs) -> None:
    y.a = wrap_add(u.a, u.b) // 3 + sat_mul(u.a, u.b) // 5 - wrap_sub(1, u.b) // 7
    y.b = wrap_u32(u.a) ^ sat_u32(u.x) ^ wrap_u32(u.c)
    y.c = sat_sub(u.c, 5) + sat_u64(u.f)
    y.d = sat_i64(u.x) // 2 + wrap_i64(u.c) // 4 + i64(wrap_i32(3000000000))
    for i in range(3):
        y.d += i64(wrap_i32(i * 2000000000)) + sat_add(i, 2)
    y.x = lerp(u.x, 2, 0.25) + wrap_angle(u.x) + copysign(3, u.x) + fmod(u.x, 0.7) + round(u.x / 2) + cbrt(u.x)
    y.f = lerp(0.1, u.f, 0.75) + wrap_angle(u.f) + round(u.f) + tanh(u.f) + log1p(abs(u.f)) + expm1(0.1)
    y.a += u.b if isinf(u.f) or isinf(u.x / 0) else 0
""",
}

#: The machine's structs, for the programs that use them.
STRUCTS: dict[str, Any] = {
    "Target": {"pose": "Pose", "weight": "f64 kg"},
    "Pose": {"position": "f64[3] m", "attitude": "f64[4]", "valid": "bool"},
}

PARAMETERS: dict[str, dict[str, Any]] = {"calls": {"offset": [0.5, -1.0, 2.0], "scale": 3.0}}


def build(
    folder: Path, name: str, text: str, parameters: dict[str, Any] | None = None, structs: dict[str, Any] | None = None
) -> Twins:
    """A machine of one instance, `one`, which runs in every tick: compiled and in CPython."""
    config = {
        "tick_hz": 1,
        "initial_state": "A",
        "structs": structs or {},
        "instances": {"one": {"algorithm": name, "parameters": parameters or {}}},
        "states": {"A": {"schedule": {"one": 1}}},
    }
    return Twins(write_machine(folder, f"run_{name}", config, {name: text}))

# SPDX-License-Identifier: Apache-2.0
"""Programs in the language, one for each of its parts. `build` makes a machine of a program to compare with CPython."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fcsl_test_abi import classes, write_machine
from fcsl_test_twins import Twins

PROGRAMS: dict[str, str] = {
    "aliasing": """
def rotate(v: "f64[3]") -> "f64[3]":
    return [v[2], v[0], v[1]]
def twice(v: "f64[3]") -> "f64[3]":
    w = v
    w[0] = w[1] + w[2]
    return v + w
class Aliasing:
    inputs = {"a": "f64[3]", "block": "f64[2][3]", "s": "f64"}
    outputs = {"x": "f64[3]", "m": "f64[3][3]", "n": "f64[2][3]"}
    state = {"h": "f64[3]"}

    def execute(self):
        self.x = self.a
        self.x = rotate(self.x)
        self.x = [self.x[1], self.x[0] + self.x[2], self.x[1]]
        self.x = self.x + self.x
        self.x = self.x - self.x[0] * self.x
        self.x = -self.x
        self.x = self.x if self.s > 0.0 else rotate(self.x)
        self.x = twice(self.x) + twice(twice(self.x))
        self.h = self.h * 0.5 + self.x
        self.h = self.h / (self.s * self.s + 1.0)
        self.m[0] = self.a
        self.m[1] = self.m[0] + self.m[2]
        self.m[2] = self.m[1]
        self.m[0] = rotate(self.m[2])
        self.m[1] = self.m[1] - self.m[1][0] * self.m[0]
        t = self.m
        t[1, 1] = 99.5
        self.m[2] = [t[1, 1], self.m[1, 1], t[-1][-3]]
        self.n = self.block
        self.n[0] = self.n[1]
        self.n[1] = self.block[0]
        self.n = self.n + self.block
""",
    "integers": """
LIMIT: i32 = 1000000
BIG: i64 = 2000000000
WORD: u64 = 4000000000
class Integers:
    inputs = {"a": "i32", "b": "i32", "c": "u32", "d": "i64"}
    outputs = {"r": "i32", "w": "u32", "l": "i64", "v": "i32[4]", "k": "u64"}

    def execute(self):
        self.w = self.c * 2654435761 + 12345
        self.w -= 7
        self.w = -self.w
        self.k = WORD * 4 + u64(self.c)
        self.l = BIG + BIG - -BIG
        self.l = self.l + self.d
        self.r = self.a * self.b // 3 - LIMIT % 7
        self.v = [self.a, self.b, -self.a, self.a - self.b]
        self.v = self.v + self.v
        self.v[self.a] = self.v[self.b % 4] // self.b
        for i in range(4):
            self.v[i] = self.v[i] + i32(i * i) - i
""",
    "short_circuit": """
class ShortCircuit:
    inputs = {"i": "i32", "d": "i32", "x": "f64"}
    outputs = {"hit": "bool", "any": "bool", "q": "i32", "chain": "bool", "pick": "i32"}
    state = {"t": "i32[3]"}

    def execute(self):
        self.t = [1, 2, 3]
        self.hit = 0 <= self.i < 3 and self.t[self.i] == 2
        self.any = self.d == 0 or 6 // self.d > 1
        self.q = 12 // self.d if self.d != 0 else -1
        self.chain = 0.0 < self.x <= self.x * self.x < 9.0 != self.x
        self.pick = self.t[self.i] if self.i < 3 and not self.i < 0 else self.t[0] if self.any else self.t[2]
        if self.d > 1 and (self.t[1] // (self.d - 2) == 1 or self.x > 1.0):
            self.q = 77
""",
    "chain_order": """
class ChainOrder:
    inputs = {"a": "i32", "b": "i32"}
    outputs = {"r": "bool", "s": "bool"}

    def execute(self):
        self.r = self.a < 10 // self.b < 5
        self.s = 0 < self.a < 100 // self.a < 100 // (self.b - 3) < 50
""",
    "loops": """
N = 5
def find(v: "f64[5]", limit: f64) -> i64:
    for i in range(N):
        if v[i] > limit:
            return i
    return -1
class Loops:
    inputs = {"v": "f64[N]", "stop": "i32", "m": "i64[3][3]"}
    outputs = {"total": "f64", "count": "i64", "first": "i64", "lower": "f64", "back": "f64[N]", "trace": "i64"}

    def execute(self):
        total = 0.0
        count = 0
        for i in range(N):
            if self.v[i] < 0.0:
                continue
            if count == i64(self.stop):
                break
            total += self.v[i]
            count += 1
        self.total = total
        self.count = count
        self.first = find(self.v, total)
        lower = 0.0
        for i in range(N):
            for j in range(i):
                if j == 2 and self.stop > 2:
                    break
                lower += self.v[i] * self.v[j]
            lower = lower - self.v[i]
        self.lower = lower
        for i in range(N - 1, -1, -1):
            self.back[i] = self.v[N - 1 - i]
        for i in range(1, N, 2):
            self.back[i] -= f64(i)
        self.trace = 0
        for i in range(3):
            for j in range(i, 3):
                self.trace += self.m[i][j] * i64(i // 2 + j % 2 + i ** 2)
        for i in range(3, 3):
            self.trace = 0
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
class Constants:
    inputs = {"i": "i32", "x": "f64", "f": "f32"}
    outputs = {"a": "f64", "b": "f32", "c": "i64", "d": "bool", "e": "f64[3]", "g": "f32[2]"}

    def execute(self):
        self.a = TABLE[self.i] * GAIN + self.x * (GAIN + 0.2) - -NEGATIVE
        self.b = SINGLE * self.f + GAIN
        self.c = GRID[1][0] + GRID[0, 1] * i64(self.i) - -COUNT
        self.d = FLAGS[0] and not FLAGS[1]
        self.e = TABLE
        self.e[0] = 7.0
        self.e = self.e + TABLE
        self.g = MIXED
        self.g[1] = self.g[1] / 3 + self.f
        self.a += 2 * self.x ** 2 - self.x ** 3 / 4 + self.x ** 0 + 2.0 ** 3
""",
    "floats": """
class Floats:
    inputs = {"x": "f64", "y": "f64", "f": "f32", "g": "f32"}
    outputs = {"a": "f64", "b": "f64", "c": "f32", "d": "f32", "e": "i32", "h": "f64"}

    def execute(self):
        self.a = clamp(self.x / self.y, min(self.x, 1.0), max(self.y, 0.0, self.x))
        self.b = sin(self.x) * cos(self.y) + atan2(self.y, self.x) - sqrt(abs(self.x)) + exp(-abs(self.y)) + hypot(self.x, self.y)
        self.c = self.f / 3 + self.g * 0.1 - f32(self.x)
        self.d = sin(self.f) + sqrt(self.g) + sign(self.f) * floor(self.g)
        self.h = self.x % self.y + self.x // self.y + f64(self.f) + (1 if self.x < self.y else 2.5) + self.x ** 2.5 + pow(self.y, -1)
        self.e = i32(self.x * 1000.0)
""",
    "calls": """
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
class Calls:
    inputs = {"given": "f64[3]", "k": "i32"}
    outputs = {"r": "f64", "v": "f64[3]", "w": "f64[3]", "n": "i32"}
    parameters = {"offset": "f64[3]", "scale": "f64"}
    state = {"last": "f64[3]", "ticks": "i64"}

    def start(self):
        self.last = self.offset * self.scale
        self.w = self.last

    def execute(self):
        self.v = half(self.v) + half(self.given - self.offset)
        self.v = cross3(self.v, half(self.v))
        self.r = deep(self.v, self.k) + pick(self.given, self.k)
        self.ticks += 1
        self.n = factor(self.k) + factor(factor(self.k + 1))
        self.last = self.v if self.ticks % 2 == 0 else self.last + self.given
        unread = self.n
""",
    "nested_choice": """
class NestedChoice:
    inputs = {"pair": "f64[2]", "i": "i64", "flag": "bool"}
    outputs = {"v": "f64[2]", "s": "f64", "n": "i64"}

    def execute(self):
        self.v = [self.pair[1], self.pair[0]] if self.flag else self.pair * self.pair[self.i]
        self.s = dot(self.pair if self.flag else -self.pair, [1.0, self.pair[self.i] if not self.flag else 2.0])
        self.n = (1 if self.flag else 2) * self.i
        self.n += 3 if self.i < 0 else 4
        t = self.v - (self.pair if self.s > 0.0 else self.v)
        self.v = t if self.i == 1 else self.v
""",
    "structs": """
HOME: "Pose" = Pose([1.0, 2.0, 3.0], [1.0, 0.0, 0.0, 0.0], True)
def mirror(p: "Pose", s: f64) -> "Pose":
    q = p
    q.position[0] = -s * p.position[0]
    q.valid = not p.valid
    return q
def same(p: "Pose") -> "Pose":
    return p
def heavier(a: "Target", b: "Target") -> "Target":
    return a if a.weight > b.weight else b
class Structs:
    inputs = {"seen": "Pose", "targets": "Target[3]", "i": "i32"}
    outputs = {"pose": "Pose", "best": "Target", "sum": "f64"}
    state = {"history": "Target[2][2]", "last": "Pose"}

    def start(self):
        self.history[1, 1].pose = HOME

    def execute(self):
        self.pose = mirror(self.seen, 2.0)
        alias = self.pose
        alias.position[1] = 77.0
        self.best = heavier(self.targets[0], self.targets[self.i])
        self.history[0, 1] = Target(self.seen, weight=2.5)
        self.history[0, 0] = self.history[0, 1]
        self.history[0, 0].pose.position[self.i] = 7.0
        self.last, self.pose = self.pose, self.last
        self.last = same(self.last)
        self.last.attitude[3] += alias.position[1]
        first, second, third = self.targets
        first.weight = second.weight
        row = self.history[0]
        row[1].weight = 9.0
        self.history[1, 0] = row[1] if self.seen.valid else third
        self.sum = first.weight + self.targets[0].weight + self.history[0, 1].weight + HOME.position[self.i]
        if self.i == 1:
            self.pose = HOME
            self.pose.position = [0.5, self.seen.position[0], -1]
""",
    "slices": """
N = 2
class Slices:
    inputs = {"row": "f64[5]", "square": "i32[3][3]", "k": "i32"}
    outputs = {"v": "f64[5]", "m": "i32[3][3]", "column": "i32[3]", "s": "f64", "n": "i32"}
    state = {"line": "f64[5]", "cube": "u32[2][2][3]"}

    def execute(self):
        self.line = self.row
        self.line[1:4] = self.line[0:3]
        self.line[:N] += self.line[-N:]
        self.line[N:] -= [1.0, self.line[self.k], 2]
        self.v = self.line
        self.v[-3:-1] = -self.v[:2] * 0.5
        self.m = self.square
        self.m[0:2, 1] = self.m[1:, 2]
        self.m[:, 0] = self.m[2]
        self.m[self.k, 1:3] = self.m[self.k, 0:2]
        self.column = self.square[:, -1]
        a, b, c = self.column
        a, c = c, a
        self.n = a + b - c
        self.cube[1, :, 1:] = self.cube[0, :, 0:2]
        self.cube[0, 1] = [u32(7), self.cube[1, 1, 2] + 1, 3]
        self.cube[:, 1, 2] += [4000000000, 5]
        self.s = dot(self.v[1:3], self.line[0:2])
        self.v[0], self.v[1] = self.v[1], self.v[0]
        low, high = self.line[1:3]
        self.s += low * high
""",
    "bits": """
MASK: u32 = 0xF0F0
class Bits:
    inputs = {"word": "u32", "wide": "u64", "small": "i32", "large": "i64", "n": "i32"}
    outputs = {"a": "u32", "b": "u64", "c": "i32", "d": "i64", "e": "u32"}

    def execute(self):
        self.a = (self.word << 4 | 3) & ~MASK ^ u32(240) >> 2
        self.b = self.wide << self.n ^ self.wide >> 7
        self.c = self.small >> self.n & 255 | ~self.small
        self.d = (self.large >> 63) - ~self.large // 3 ^ -1
        self.e = 1 << self.word % 32
        self.a |= 1
        self.b <<= 1
        self.c ^= 5
        self.d >>= 2
        for i in range(8):
            self.e += u32(i >> 1) << i
            self.d += ~i & 3
""",
    "literals": """
K = 3
GAIN = 0.1
def pick(a: f32, n: i32) -> f32:
    return a * (GAIN if n > 2 else 1) + 0.2
def third(flag: bool) -> f32:
    if flag:
        return 1 / 3.0
    return 2
class Literals:
    inputs = {"flag": "bool", "other": "bool", "single": "f32", "count": "i32", "word": "u64", "real": "f64"}
    outputs = {"f": "f32", "g": "f32", "h": "f32[2]", "n": "i32", "w": "u64", "x": "f64", "k": "i64"}

    def execute(self):
        self.f = self.single * (0.1 if self.flag else 2) + third(self.other)
        t = 0.1 if self.flag else self.single
        self.g = t * t + (0.1 if self.other else 0.3) * 3.0
        if self.other:
            t = 1
        self.f += t / 3 - pick(0.7, 3 if self.flag else 1)
        self.h = [0.1, 1 if self.flag else 0.7]
        self.h = self.h * 0.1 + [self.single, 0.1] * self.single
        self.n = max(2, 1) - abs(-5) + (1 if self.flag else 2147483647) * (2 if self.other else 1)
        m = 1 if self.flag else self.count
        m -= 1
        self.n -= m // (2 if self.other else 3)
        self.w = (self.word + 1) * (4000000000 if self.flag else 2) - K
        self.x = sqrt(2) + sin(0.5) * self.real - (1 if self.flag else 2.5) / 4
        self.g = self.g + sin(0.5) * sqrt(2.0) - min(self.single, 0.3, 1)
        i = 5 if self.flag else 7
        self.k = i * i * (10 if self.other else 1)
        z = -(0 if self.flag else 0.5)
        self.x = self.x + 1.0 / z
        a, b = 1, 2.5
        self.x += f64(a) * b + pow(2, 0.5) + 2 ** 3 + 2.0 ** -1
        s = self.single
        c, s = s, 3
        self.f += c * s
""",
    "loop_variables": """
class LoopVariables:
    inputs = {"count": "i32", "word": "u32"}
    outputs = {"n": "i32", "w": "u32", "k": "i64", "x": "f64"}

    def execute(self):
        self.n = 0
        self.k = 0
        for i in range(3):
            for j in range(2147483645, 2147483648):
                last = j
                self.n += i * self.count
                self.w = self.word + i
                best = max(i, 1) + min(i, j) - abs(-i)
                self.k += best + last - i ** 2
                if self.count > 5:
                    self.x = f64(i * j * j)
                if self.count == 3:
                    self.k = j * j + j * j * i
                if self.count < -5 and i % 2 == 1:
                    self.k = 7 // (i - 1)
                self.n += i32(i) if i > 1 else i
""",
    "saturation": """
class Saturation:
    inputs = {"first": "i32", "second": "i32", "word": "u64", "real": "f64", "single": "f32"}
    outputs = {"a": "i32", "b": "u32", "c": "u64", "d": "i64", "x": "f64", "f": "f32"}

    def execute(self):
        self.a = wrap_add(self.first, self.second) // 3 + sat_mul(self.first, self.second) // 5 - wrap_sub(1, self.second) // 7
        self.b = wrap_u32(self.first) ^ sat_u32(self.real) ^ wrap_u32(self.word)
        self.c = sat_sub(self.word, 5) + sat_u64(self.single)
        self.d = sat_i64(self.real) // 2 + wrap_i64(self.word) // 4 + i64(wrap_i32(3000000000))
        for i in range(3):
            self.d += i64(wrap_i32(i * 2000000000)) + sat_add(i, 2)
        self.x = lerp(self.real, 2, 0.25) + wrap_angle(self.real) + copysign(3, self.real) + fmod(self.real, 0.7) + round(self.real / 2) + cbrt(self.real)
        self.f = lerp(0.1, self.single, 0.75) + wrap_angle(self.single) + round(self.single) + tanh(self.single) + log1p(abs(self.single)) + expm1(0.1)
        self.a += self.second if isinf(self.single) or isinf(self.real / 0) else 0
""",
    "nested": """
N = 2
CUBE = [[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], [[-1.0, -2.0, -3.0], [-4.0, -5.0, -6.0]]]
STEPS: "i32[N][3][1]" = [[[1], [2], [3]], [[4], [5], [6]]]


def plane(c: "f64[2][2][3]", k: i32) -> "f64[2][3]":
    return c[k]


def turned(c: "f64[N][N][3]") -> "f64[3][N][2]":
    m = [[[0.0, 0.0], [0.0, 0.0]], [[0.0, 0.0], [0.0, 0.0]], [[0.0, 0.0], [0.0, 0.0]]]
    for i in range(N):
        for j in range(N):
            for k in range(3):
                m[k][j][i] = c[i][j, k]
    return m


def corner(t: "Target[2][1][2]", i: i32) -> "Pose[2]":
    return [t[0][0][i].pose, t[1, 0, 0].pose]


class Nested:
    inputs = {"given": "f64[2][2][3]", "words": "u32[1][2][2]", "targets": "Target[2][1][2]", "i": "i32", "j": "u32"}
    outputs = {
        "cube": "f64[2][2][3]",
        "face": "f64[2][3]",
        "line": "f64[3]",
        "turned": "f64[3][N][2]",
        "sum": "f64",
        "steps": "i32[2][3][1]",
        "bits": "u32[2][2]",
        "flags": "bool[2][1][3]",
        "poses": "Pose[2]",
    }
    state = {"memory": "f64[2][2][3]", "grid": "Target[2][1][2]", "deep": "i64[1][2][1][2]"}

    def start(self):
        self.memory = CUBE
        self.deep[0][1][0][1] = 7

    def execute(self):
        self.cube = self.given
        self.cube[0] = self.given[1] + CUBE[0]
        self.cube[1][0] = self.cube[0][self.i]
        self.cube[1, 1] = -self.cube[0, 0] * 0.5
        self.cube[self.i][1][2] += CUBE[1][self.i][0]
        self.cube[0][0, 1] -= self.cube[self.i, self.j, 0]
        self.face = plane(self.given, self.i)
        self.face[1] = CUBE[1, 0] if self.i > 5 else self.face[0]
        self.line = self.cube[1, 1] if self.i > 5 else self.cube[0, 1]
        self.turned = turned(self.given)
        self.turned[2][1] = self.turned[0, 0]
        self.turned[:, 0, 1] = self.cube[0][1]
        self.sum = CUBE[0][1][2] + self.turned[-1][0][1] + self.memory[1, 1][0]
        self.steps = STEPS
        self.steps[0][2][0] = STEPS[1][self.i][0] - self.steps[0, 2, 0]
        self.bits = self.words[0]
        self.bits[1] = self.words[0, :, 1]
        self.flags[self.i][0][1] = self.given[0][0][0] < self.given[1, 1, 2]
        self.memory, self.cube = self.cube, self.memory
        self.memory[:, 1, 1:] = self.given[:, 0, 0:2]
        self.grid[0] = self.targets[1]
        self.grid[1][0] = [self.targets[0][0][self.i], self.grid[0, 0, 1]]
        self.grid[1, 0, 0].pose.position[self.i] += 1.0
        self.poses = corner(self.grid, self.i)
        (first,) = self.deep
        first[1][0][0] = first[1, 0][1] + 1
        self.deep[0] = first
""",
    "words": """
from fcsl_builtins import Health, TransitionRequest, f64, i32

QUIET: Health = "nominal"
WORST = "failed"
FALLBACK: TransitionRequest = "HOLD"
HOME = "GO"
ORDER: "TransitionRequest[3]" = ["GO", "", "HOLD"]
LEVELS: "Health[2][2]" = [["nominal", "degraded"], ["failed", "stale"]]
REPORT: "Report" = Report("degraded", ["GO", ""], 1.5)


def worse(a: Health, b: Health) -> Health:
    if a == WORST or b == "failed":
        return "failed"
    return a if a != QUIET else b


def chosen(level: Health, wish: TransitionRequest) -> TransitionRequest:
    t = wish
    if wish == "":
        t = FALLBACK
    return "ABORT" if level == "failed" else t


def both(r: TransitionRequest) -> "TransitionRequest[2]":
    return [r, HOME]


def renamed(r: "Report", level: Health) -> "Report":
    s = r
    s.level = level
    s.wishes[0] = "HOLD" if r.wishes[0] == "" else r.wishes[1]
    return s


def same(r: "Report", s: "Report") -> bool:
    return r.level == s.level and r.wishes[0] == s.wishes[0] != "ABORT"


class Words:
    inputs = {
        "level": "Health",
        "levels": "Health[3]",
        "wish": "TransitionRequest",
        "wishes": "TransitionRequest[2]",
        "seen": "Report",
        "i": "i32",
        "on": "bool",
    }
    outputs = {
        "worst": "Health",
        "levels_then": "Health[2][2]",
        "last": "TransitionRequest",
        "queue": "TransitionRequest[4]",
        "sent": "Report",
        "reports": "Report[2]",
        "count": "i32",
        "same": "bool",
        "transition_request": "TransitionRequest",
    }
    parameters = {"on_done": "TransitionRequest", "least": "Health", "plan": "TransitionRequest[2]", "first": "Report"}
    state = {"before": "Health", "pending": "TransitionRequest", "kept": "Report", "ring": "TransitionRequest[3]"}

    def start(self):
        self.kept = self.first
        self.before = "stale"
        self.ring = ORDER

    def execute(self):
        self.same = self.transition_request == "" and self.health == "nominal"
        self.worst = worse(self.level, self.least)
        for i in range(3):
            self.worst = worse(self.worst, self.levels[i]) if self.on else worse(QUIET, self.levels[2 - i])
        self.levels_then = LEVELS
        self.levels_then[1] = [self.before, "degraded"]
        self.levels_then[self.i][0] = LEVELS[1, self.i]
        self.before, old = self.level, self.before
        self.last = chosen(self.worst, self.wish)
        self.queue = [self.wish, self.on_done, "", self.plan[self.i]]
        self.queue[1:3] = both(self.queue[3])
        self.queue[0] = HOME if self.on else self.wishes[self.i]
        word: TransitionRequest = "HOLD"
        if self.on:
            word = "GO"
        self.pending = word if old == "stale" else self.pending if self.i == 1 else ""
        self.sent = renamed(self.seen, self.least)
        self.kept = renamed(self.kept, old)
        self.kept.wishes = self.wishes
        self.reports = [REPORT, Report(weight=2, level="failed", wishes=["", self.last])]
        self.reports[self.i].wishes[1] = self.ring[0]
        self.ring[0], self.ring[1], self.ring[2] = self.ring[1], self.ring[2], self.ring[0]
        self.count = (1 if self.level == self.least else 0) + (2 if self.wish != self.on_done else 0)
        self.count += 4 if "degraded" == self.level else 8 if self.level != "stale" else 16
        self.count += 32 if "failed" != self.levels[0] == self.level != "stale" else 0
        self.same = self.same and same(self.sent, self.kept) != self.on
        self.transition_request = self.last if self.on else self.on_done
        self.health = self.worst
        if self.transition_request == self.queue[1] and self.health != "nominal":
            self.health = "degraded" if self.i == 1 else self.health
""",
    "shapes": """
'''What may be written and means nothing.'''
from __future__ import annotations

from typing import ClassVar

from fcsl_builtins import extern, f64


def half(x: f64) -> f64:
    '''Half of it.'''
    return x / 2.0


class Shapes:
    '''Comments, annotations and bodies in every form.'''

    state: ClassVar[dict[str, str]] = {"n": "i64"}
    pass
    outputs: dict[str, str] = {
        "x": "f64",  # a half
        "y": 'f64',
        '''z''': "f64" " m",  # joined
    }
    ...
    '''Between them.'''
    inputs: ClassVar = {"given": "f64", "on": "bool"}
    parameters: dict = {}

    def start(self) -> None:
        '''Nothing to do.'''

    def execute(self) -> None:
        '''Writes halves.'''
        ...
        if self.on:
            pass
        elif self.given > 1.0:
            ...
        else:
            self.x = half(self.given); self.y = -self.x
            return None
        for i in range(3):
            ...
        self.n += 1
        self.z = (
            self.x +
            half(self.y)  # on lines of its own
        )
""",
}

#: Algorithms that import helpers and constants of other files.
FILES: dict[str, str] = {
    "law.py": """\
from __future__ import annotations

from frames import HOME, LEVEL, N, SIZES, WISH, judged, total, wrap

GAIN = 2 * N


class Law:
    inputs = {"v": "f64[N]", "i": "i32"}
    outputs = {"x": "f64", "grid": "i64[N][2]", "goal": "Goal", "transition_request": "TransitionRequest"}
    state = {"level": "Health"}

    def start(self):
        self.goal = HOME

    def execute(self):
        self.x = total(self.v) + wrap(self.v[0]) * GAIN
        self.grid[:, 0] = SIZES
        self.grid[1][1] = SIZES[self.i]
        self.goal.speed += HOME.place[self.i]
        self.level = judged(self.x, self.level)
        self.health = self.level if self.x > 5.0 else LEVEL
        self.transition_request = WISH if self.x > 1.0 else ""
""",
    "frames.py": """\
from axes import AXES, turned
from fcsl_builtins import f64, pi

TURN: f64 = 2.0 * pi
SIZES = [1, 2, 3]
N = 3
LEVEL: Health = "degraded"
WISH: TransitionRequest = "GO"
HOME: "Goal" = Goal([1.0, 2.0, 3.0], 0.5)


def wrap(angle: f64) -> f64:
    return angle % TURN


def total(v: "f64[N]") -> f64:
    s = 0.0
    for i in range(N):
        s += wrap(v[i]) * f64(SIZES[i])
    return dot(turned(v), AXES[0]) + s


def judged(x: f64, level: Health) -> Health:
    return LEVEL if x > 1.0 and level != "failed" else level
""",
    "axes.py": """\
AXES = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]


def turned(v: "f64[3]") -> "f64[3]":
    return [v[1], v[2], v[0]]
""",
    "other.py": """\
from fcsl_builtins import f64
from frames import wrap


def total(x: f64) -> f64:
    return wrap(x) - 1.0


class Other:
    inputs = {"x": "f64"}
    outputs = {"y": "f64"}

    def execute(self):
        self.y = total(self.x)
""",
}

#: The machine's structs, for the programs that use them.
STRUCTS: dict[str, Any] = {
    "Target": {"pose": "Pose", "weight": "f64 kg"},
    "Pose": {"position": "f64[3] m", "attitude": "f64[4]", "valid": "bool"},
    "Goal": {"place": "f64[3] m", "speed": "f64 m/s"},
    "Report": {"level": "Health", "wishes": "TransitionRequest[2]", "weight": "f64"},
}

#: The machine's requests.
REQUESTS = ("GO", "HOLD", "ABORT")

PARAMETERS: dict[str, dict[str, Any]] = {
    "calls": {"offset": [0.5, -1.0, 2.0], "scale": 3.0},
    "words": {
        "on_done": "HOLD",
        "least": "degraded",
        "plan": ["", "ABORT"],
        "first": {"level": "stale", "wishes": ["ABORT", ""], "weight": -1},
    },
}

#: Statements with external calls inside expressions. Their ports are in OUTSIDE_PORTS. Each is one branch of a machine.
OUTSIDE: dict[str, str] = {
    "condition": "if hw_read_gpio(u32(self.i)):\n    self.n = 1\nelif hw_read_u32(3) > 1:\n    self.n = 2\nelse:\n    self.n = 3",
    "conditions inside": "if self.on:\n    if not hw_read_gpio(1):\n        self.w = hw_read_adc(2)\nelse:\n    self.w = hw_read_adc(3)",
    "left of and": "self.b = hw_read_gpio(1) and self.on and 6 // self.d > 1",
    "left of or": "self.b = hw_read_u32(1) > 2 or 6 // self.d > 1",
    "left of both": "self.b = (hw_read_gpio(1) or self.on) and 6 // self.d > 1",
    "not": "self.b = not hw_read_gpio(2)",
    "unary": "self.n = -i32(hw_read_u32(1)) - abs(-i32(hw_read_u32(2)))",
    "arguments": "self.w = max(hw_read_u32(1), hw_read_adc(2), u32(self.i))",
    "calls in calls": "self.w = hw_read_u32(hw_read_u32(hw_read_u32(1) + 1) + hw_read_u32(2))",
    "a fault left of it": "self.n = 6 // self.d + i32(hw_read_u32(1)) + 6 // self.i",
    "a fault between": "self.n = i32(hw_read_u32(1)) + 6 // self.d * i32(hw_read_u32(2))",
    "a fault in an argument": "self.w = hw_read_u32(u32(6 // self.d)) + hw_read_u32(self.t[self.i])",
    "a fault in an argument behind": "self.w = hw_read_u32(hw_read_u32(self.t[self.i]) + u32(6 // self.d))",
    "a fault of itself": "self.n = 6 // i32(hw_read_u32(1)) + i32(hw_read_u32(2))",
    "subscripts": "self.w = self.t[hw_read_u32(1)] + self.t[hw_read_u32(2)]",
    "subscripts of two": "self.n = self.m[hw_read_u32(1)][hw_read_u32(2)] + self.m[self.i, hw_read_u32(3)]",
    "subscripts in subscripts": "self.w = self.t[self.t[hw_read_u32(1)]] + self.t[self.i]",
    "rows": "self.r = self.m[hw_read_u32(1)]",
    "columns": "self.r = self.m[:, hw_read_u32(1)]",
    "members": "self.y = self.goals[hw_read_u32(1)].place[hw_read_u32(2)] + self.goals[self.i].speed",
    "members behind a fault": "self.y = self.goals[self.i].place[hw_read_u32(1)] + f64(hw_read_u32(2))",
    "chain": "self.b = hw_read_u32(1) < hw_read_u32(2) < 3",
    "chain that shares a fault": "self.b = 0 < i32(hw_read_u32(1)) < 6 // self.d < 5",
    "chain that begins with a fault": "self.b = 6 // self.d < i32(hw_read_u32(1)) <= 6 // self.i",
    "chain that begins with a call": "self.b = i32(hw_read_u32(1)) < 6 // self.d < 5",
    "chain that begins with a choice": "self.b = (1 if self.on else 2) < hw_read_u32(1) < 3",
    "chain that shares a call": "self.b = self.n <= i32(hw_read_u32(1)) * self.i < 10 // self.d != 3",
    "chain of equals": "self.b = hw_read_gpio(1) == hw_read_gpio(2) != self.on",
    "choice": "self.n = 6 // self.i if hw_read_gpio(1) else 6 // self.d",
    "choice in an argument": "self.w = hw_read_u32(1 if hw_read_gpio(1) else 2) + self.t[self.i]",
    "choice of words": 'self.health = "degraded" if hw_read_u32(1) > 2 else "nominal"',
    "compared words": 'self.b = hw_read_u32(1) > 1 and self.health == "nominal"',
    "target": "self.t[hw_read_u32(1)] = hw_read_u32(2)",
    "target that faults": "self.t[self.i] = hw_read_u32(2)",
    "target of two": "self.m[hw_read_u32(1)][hw_read_u32(2)] = i32(hw_read_u32(3))",
    "target of members": "self.goals[hw_read_u32(1)].place[hw_read_u32(2)] = f64(hw_read_u32(3))",
    "target of members behind a fault": "self.goals[self.i].place[hw_read_u32(1)] = f64(hw_read_u32(2))",
    "target of a plain value": "self.m[hw_read_u32(1)][hw_read_u32(2)] = 6 // self.d",
    "target of a slice": "self.m[hw_read_u32(1), 0:2] = [i32(hw_read_u32(2)), 6 // self.d]",
    "augmented": "self.t[hw_read_u32(1)] += hw_read_u32(2)",
    "augmented after a fault": "self.t[self.i] += hw_read_u32(2)",
    "augmented by a plain value": "self.m[hw_read_u32(1)][self.i] *= 6 // self.d",
    "augmented twice": "self.m[hw_read_u32(1), hw_read_u32(2)] -= i32(hw_read_u32(3)) // self.d",
    "augmented in a subscript": "self.t[self.t[hw_read_u32(1)]] += hw_read_u32(2)",
    "augmented beside a fault": "self.m[1 // self.d][hw_read_u32(1)] += i32(hw_read_u32(2))",
    "augmented behind a fault": "self.m[hw_read_u32(1)][1 // self.d] += i32(hw_read_u32(2))",
    "augmented slice": "self.m[hw_read_u32(1), 0:2] += [i32(hw_read_u32(2)), 6 // self.d]",
    "augmented member": "self.goals[hw_read_u32(1)].speed += f64(hw_read_u32(2))",
    "augmented element of a member": "self.goals[hw_read_u32(1)].place[hw_read_u32(2)] *= f64(hw_read_u32(3))",
    "augmented element behind a fault": "self.goals[self.i].place[hw_read_u32(1)] *= f64(hw_read_u32(2))",
    "augmented local": "local = self.t\nlocal[hw_read_u32(1)] |= hw_read_u32(2)\nself.t = local",
    "augmented shift": "self.w <<= hw_read_u32(1)",
    "augmented field": "self.n += 6 // self.d * i32(hw_read_u32(1))",
    "unpacked": "self.w, self.n = hw_read_u32(1), 6 // self.d",
    "unpacked behind a fault": "self.n, self.w = 6 // self.d, hw_read_u32(1)",
    "unpacked to subscripts": "self.t[hw_read_u32(1)], self.t[hw_read_u32(2)] = hw_read_u32(3), hw_read_u32(4)",
    "unpacked swap": "self.t[self.i], self.w = self.w, hw_read_u32(1)",
    "unpacked locals": "one, two = hw_read_u32(1), hw_read_u32(2)\none, two = two, one + hw_read_u32(3)\nself.w = one * 10 + two",
    "unpacked array": "first, second, third = self.t\nself.w = first + hw_read_u32(second) * third",
    "unpacked row": "low, high = self.m[hw_read_u32(1)]\nself.n = low * 10 + high",
    "array": "self.t = [hw_read_u32(1), self.t[self.i], hw_read_u32(2)]",
    "rows of an array": "self.m = [[i32(hw_read_u32(1)), 6 // self.d], [i32(hw_read_u32(2)), 1]]",
    "struct": "self.goals[0] = Goal(speed=f64(hw_read_u32(1)), place=[f64(hw_read_u32(2)), f64(6 // self.d), 1.0])",
    "struct by position": "self.goals[1] = Goal([f64(hw_read_u32(1)), f64(self.t[self.i]), 2.0], f64(hw_read_u32(2)))",
    "helper": "self.n = ratio(hw_read_u32(1), self.d) + ratio(hw_read_u32(2), i32(hw_read_u32(3)))",
    "library": "self.y = dot([f64(hw_read_u32(1)), 2.0], [f64(hw_read_u32(2)), f64(6 // self.d)])",
    "elementwise": "self.m = self.m * i32(hw_read_u32(1)) + self.m",
    "power": "self.n = i32(hw_read_u32(1)) ** 2 + 6 // self.d",
    "shift": "self.w = (hw_read_u32(1) << hw_read_u32(2) | 1) ^ hw_read_u32(3)",
    "the same field on both sides": "self.t[0] = self.t[0] + hw_read_u32(1) * self.t[self.i]",
    "writes": "hw_write_u32(hw_read_u32(1), hw_read_u32(2) + self.t[self.i])\nhw_write_gpio(1, hw_read_gpio(2) and self.on)",
    "a write and a fault": "hw_write_u32(1, self.t[0])\nself.n = 6 // self.d\nhw_write_u32(2, 5)",
    "a write of a choice": "hw_write_gpio(hw_read_u32(1), 6 // self.d > 2 if hw_read_gpio(3) else self.on)",
    "loop": "for i in range(3):\n    if hw_read_gpio(u32(i)):\n        continue\n    self.t[i] = hw_read_u32(u32(i))\n"
    "    if hw_read_u32(9) == 3:\n        break",
    "loop with a target": "for i in range(2):\n    self.m[i][hw_read_u32(u32(i))] += i32(hw_read_u32(5)) // self.d",
    "typed local": "level: u32 = hw_read_u32(1)\nlevel += hw_read_u32(2) * level\nself.w = level",
    "assertion of a call": "assert hw_read_gpio(1) and self.d < 2, 'pin'\nself.w = hw_read_u32(2)",
    "calls around an assertion": "self.n = i32(hw_read_u32(4))\nassert self.on\nself.w = hw_read_u32(2)",
    "return": "if hw_read_gpio(1):\n    return\nself.w = hw_read_u32(2)",
}

OUTSIDE_PORTS = """
def ratio(a: u32, b: i32) -> i32:
    return i32(a) // b


class Outside:
    inputs = {"which": "i32", "i": "i32", "d": "i32", "on": "bool"}
    outputs = {"n": "i32", "w": "u32", "b": "bool", "r": "i32[2]", "y": "f64"}
    state = {"t": "u32[3]", "m": "i32[2][2]", "goals": "Goal[2]"}

    def start(self):
        self.w = 1
        self.t = [1, 2, 0]
        self.m = [[1, 2], [3, 4]]
        self.goals[1].speed = 2.5
        self.goals[1].place = [1.0, 2.0, 3.0]

    def execute(self):
"""


def outside() -> str:
    """A class that runs statement number `which`."""
    text = OUTSIDE_PORTS
    for number, body in enumerate(OUTSIDE.values()):
        text += f"        if self.which == {number}:\n" + "".join(f"            {line}\n" for line in body.split("\n"))
    return text


def build(
    folder: Path,
    name: str,
    text: str,
    parameters: dict[str, Any] | None = None,
    structs: dict[str, Any] | None = None,
    requests: Sequence[str] = (),
) -> Twins:
    """A machine with one instance, `one`, of the only class in the text, which runs in every tick: compiled and in
    CPython."""
    (algorithm,) = classes(text)
    config = {
        "tick_hz": 1,
        "initial_state": "A",
        "structs": structs or {},
        "requests": list(requests),
        "instances": {"one": {"algorithm": algorithm, "parameters": parameters or {}}},
        "states": {"A": {"schedule": {"one": 1}}},
    }
    return Twins(write_machine(folder, f"run_{name}", config, {name: text}))

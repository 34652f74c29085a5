"""Structs, slices, unpacking and bits: every kind of value that has parts."""

from fcsl_builtins import hw_read_adc, hw_write_gpio

FLAT: "Pose" = Pose([0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], True)
COEFFICIENTS = [0.5, 0.25]


class Inputs:
    pose: "Pose"  # of the vehicle
    targets: "Target[3]"
    n: i32
    word: u32


class Parameters:
    home: "Pose"
    matrix: "f64[2, 2]"
    gain: "f32"


class Outputs:
    pose: "Pose"  # mirrored
    best: "Target"
    column: "f64[2] m"
    bits: u32
    sum: "f64 m"
    half: f32


class State:
    m: "f64[2, 3]"
    history: "Target[2, 2]"
    line: "f64[5]"


def mirror(p: "Pose", s: f64) -> "Pose":
    q = p
    q.position[0] = -s * p.position[0]
    q.valid = not p.valid
    return q


def heavier(a: "Target", b: "Target") -> "Target":
    return a if a.weight > b.weight else b


def start(p: Parameters, x: State) -> None:
    x.history[0, 0].pose = p.home


def execute(u: Inputs, p: Parameters, y: Outputs, x: State) -> None:
    y.pose = mirror(u.pose, 2.0)
    y.best = heavier(u.targets[0], u.targets[u.n])
    x.history[0, 1] = Target(u.pose, weight=2.5)
    x.history[1, u.n] = y.best
    x.history[1, 0].pose.position[u.n] = 7.0
    x.m[0] = u.pose.position
    x.m[1, 0:2] = u.pose.position[1:]
    y.column = x.m[:, 1]
    x.m[:, 2] = y.column + x.m[:, 0]
    a, b, c = u.pose.position
    a, b = b, a
    x.line[0], x.line[1] = a, b
    x.line[1:4] = x.line[0:3]
    x.line[2:] += [1.0, COEFFICIENTS[u.n], c]
    low, high = x.line[-2:]
    y.sum = low + high + p.matrix[1, 0]
    y.bits = (u.word << 4 | 3) & ~u32(1) ^ u32(0xF0) >> u.n
    y.half = p.gain * (1.0 if u.pose.valid else 2) - (3.0 if u.pose.valid else 1)
    if u.n == 1:
        y.pose = FLAT
    volts = hw_read_adc(u.n)
    y.column[0] += volts
    hw_write_gpio(7, volts > 0.5)

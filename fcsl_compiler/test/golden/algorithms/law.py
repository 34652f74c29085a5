"""One of everything that the compiler writes out: records, start, a helper, an array constant, a library call, a fault."""

from fcsl_builtins import clamp, dot

N = 3
WEIGHTS = [0.1, 0.5, 0.25]


class Inputs:
    rate: "f64[N] rad/s"
    dt: "f64 s"
    echo: "i32"
    word: "Health"


class Parameters:
    gain: "f64 in 0..10"  # of the sum
    limits: "f64[2] N*m in -2.5.."  # least, greatest
    step: "i32 in ..100"


class Outputs:
    torque: "f64 N*m"  # about the first axis
    history: "f32[2, 2]"
    count: "i32"


class State:
    sum: "f64 rad"
    index: "u32"


def start(p: Parameters, x: State) -> None:
    x.sum = p.limits[0]


def weighted(rate: "f64[3]", gain: "f64") -> "f64":
    return gain * dot(WEIGHTS, rate)


def execute(u: Inputs, p: Parameters, y: Outputs, x: State) -> None:
    x.sum += weighted(u.rate, p.gain) * u.dt
    y.torque = clamp(x.sum, p.limits[0], p.limits[1])
    y.history[x.index] = [f32(y.torque), 0.5]
    x.index = (x.index + 1) % 2
    y.count = u.echo + p.step
    total = 0
    for i in range(1, N):
        for j in range(i):
            total += i // (j + 1)
    if y.torque == p.limits[1] and not 0 < i64(y.count) <= total < 100:
        y.transition_request = TransitionRequest.REST
    y.health = Health.degraded if u.word != Health.nominal else Health.nominal

"""Attitude by Mahony's explicit complementary filter: the gyro is integrated to first order, the accelerometer levels it."""

from fcsl_builtins import cross3, norm, quat_conj, quat_mul, quat_normalize, quat_rotate

UP = [0.0, 0.0, 1.0]


class Inputs:
    gyro: "f64[3]"
    accel: "f64[3]"
    dt: "f64 s"


class Parameters:
    kp: "f64 1/s"
    ki: "f64 1/s^2"


class Outputs:
    q: "f64[4]"  # body to world
    rate: "f64[3]"
    accel: "f64[3]"  # without gravity, world axes


class State:
    bias: "f64[3]"


def start(y: Outputs) -> None:
    y.q = [1.0, 0.0, 0.0, 0.0]


def execute(u: Inputs, p: Parameters, x: State, y: Outputs) -> None:
    size = norm(u.accel)
    y.rate = u.gyro - x.bias
    turn = y.rate
    if size > 1.0:
        error = cross3(u.accel / size, quat_rotate(quat_conj(y.q), UP))
        x.bias = x.bias - error * (p.ki * u.dt)
        turn = turn + error * p.kp
    h = 0.5 * u.dt
    dq = quat_mul(y.q, [0.0, turn[0], turn[1], turn[2]])
    y.q = quat_normalize(y.q + h * dq)
    y.accel = quat_rotate(y.q, u.accel)
    y.accel[2] = y.accel[2] - 9.80665

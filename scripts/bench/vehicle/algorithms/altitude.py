"""Kalman filter of altitude and climb rate, driven by the vertical acceleration, corrected by the barometer."""


class Inputs:
    accel: "f64[3]"
    altitude: f64
    dt: "f64 s"


class Parameters:
    period: "f64 s"
    q: f64
    r: f64


class Outputs:
    altitude: f64
    climb: f64


class State:
    p00: f64
    p01: f64
    p11: f64


def start(p: Parameters, x: State) -> None:
    x.p00 = p.r
    x.p11 = p.r


def execute(u: Inputs, p: Parameters, x: State, y: Outputs) -> None:
    dt = p.period
    y.altitude = y.altitude + dt * y.climb + 0.5 * dt * dt * u.accel[2]
    y.climb = y.climb + dt * u.accel[2]
    p00 = x.p00 + 2.0 * dt * x.p01 + dt * dt * x.p11 + p.q * dt * dt * dt / 3.0
    p01 = x.p01 + dt * x.p11 + p.q * dt * dt / 2.0
    p11 = x.p11 + p.q * dt
    s = p00 + p.r
    k0 = p00 / s
    k1 = p01 / s
    innovation = u.altitude - y.altitude
    y.altitude += k0 * innovation
    y.climb += k1 * innovation
    x.p00 = (1.0 - k0) * p00
    x.p01 = (1.0 - k0) * p01
    x.p11 = p11 - k1 * p01

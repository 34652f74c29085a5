# SPDX-License-Identifier: Apache-2.0
"""A linear Kalman filter of N states on three measurements: predict, then update."""

from fcsl_builtins import kf_gain, kf_predict_cov, kf_predict_state, kf_update_cov, kf_update_state

N = 9


class Inputs:
    z: "f64[3]"


class Parameters:
    f: "f64[N, N]"
    h: "f64[3, N]"
    q: "f64[N, N]"
    r: "f64[3, 3]"


class Outputs:
    x: "f64[N]"


class State:
    p: "f64[N, N]"


def execute(u: Inputs, p: Parameters, y: Outputs, x: State) -> None:
    y.x = kf_predict_state(p.f, y.x)
    x.p = kf_predict_cov(p.f, x.p, p.q)
    k = kf_gain(x.p, p.h, p.r)
    y.x = kf_update_state(y.x, k, u.z, p.h)
    x.p = kf_update_cov(x.p, k, p.h)

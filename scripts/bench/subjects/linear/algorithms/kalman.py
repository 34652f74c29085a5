# SPDX-License-Identifier: Apache-2.0
from fcsl_builtins import kf_gain, kf_predict_cov, kf_predict_state, kf_update_cov, kf_update_state

N = 9


class Kalman:
    """A linear Kalman filter of N states on three measurements: predict, then update."""

    inputs = {"z": "f64[3]"}
    outputs = {"x": "f64[N]"}
    parameters = {"f": "f64[N][N]", "h": "f64[3][N]", "q": "f64[N][N]", "r": "f64[3][3]"}
    state = {"p": "f64[N][N]"}

    def execute(self):
        self.x = kf_predict_state(self.f, self.x)
        self.p = kf_predict_cov(self.f, self.p, self.q)
        k = kf_gain(self.p, self.h, self.r)
        self.x = kf_update_state(self.x, k, self.z, self.h)
        self.p = kf_update_cov(self.p, k, self.h)

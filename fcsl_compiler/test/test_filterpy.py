# SPDX-License-Identifier: Apache-2.0
"""The Kalman filter against filterpy's, over the same measurements."""

from pathlib import Path

import numpy as np
import pytest
from fcsl_test_numbers import gamma, run, within
from fcsl_test_programs import build
from filterpy.kalman import KalmanFilter
from test_kalman import CASES, STEPS, TEXT, Judge, drive


@pytest.mark.parametrize("name", CASES)
def test_against_filterpy(tmp_path: Path, name: str) -> None:
    case = CASES[name]
    machine = build(tmp_path, f"filterpy_{name.replace(' ', '_')}", TEXT, case.parameters()).native
    reference, rng = KalmanFilter(dim_x=3, dim_z=2, dim_u=1), np.random.default_rng(1)
    reference.F, reference.B, reference.H, reference.Q, reference.R = case.f, case.b, case.h, case.q, case.r
    reference.P, reference.x = case.p0.copy(), np.zeros(3)
    judge = Judge(case)
    for step in range(STEPS):
        given = drive(step, rng)
        before = machine.get("one.state.x")
        found = run(machine, given)
        reference.predict(u=given["u"])
        reference.update(given["z"])
        judge.compare(found, reference.P_prior, reference.x, reference.P, reference.K, reference.y, f"step {step}")
        within(found["coasting"], case.f @ before, 2 * gamma(3) * (np.abs(case.f) @ np.abs(before)), "without input")

# SPDX-License-Identifier: Apache-2.0
"""The peers as CasADi's SX expressions, from which it generates C with every zero and every one left out."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from .model import DT, GAINS, INERTIA, Matrix


def _constant(matrix: Matrix) -> Any:
    """Its zeros are structural: CasADi knows them before it multiplies."""
    return ca.sparsify(ca.DM(matrix))


def _write(function: Any, folder: Path) -> None:
    assert function.sz_iw() == 0  # of SX, all intermediate values are locals of the C function
    here = Path.cwd()
    os.chdir(folder)  # it writes where it stands
    try:
        function.generate("peer.c", {"with_header": True, "casadi_int": "int"})
    finally:
        os.chdir(here)


def kalman(model: dict[str, Matrix], folder: Path) -> None:
    """peer.c and peer.h in `folder`: (x, P, z) to (x, P)."""
    f, h, q, r = (_constant(model[name]) for name in "fhqr")
    n = f.shape[0]
    x, p, z = ca.SX.sym("x", n), ca.SX.sym("P", n, n), ca.SX.sym("z", 3)
    before = ca.mtimes(f, x)
    prior = ca.mtimes(ca.mtimes(f, p), f.T) + q
    hp = ca.mtimes(h, prior)
    gain = ca.mtimes(ca.mtimes(prior, h.T), ca.inv_minor(ca.mtimes(hp, h.T) + r))
    after = before + ca.mtimes(gain, z - ca.mtimes(h, before))
    results = ca.cse([after, ca.densify(prior - ca.mtimes(gain, hp))])
    _write(ca.Function("peer", [x, p, z], results), folder)


def attitude(folder: Path) -> None:
    """peer.c and peer.h in `folder`: (integral, q, rate, q_wanted, rate_wanted) to (integral, torque)."""
    integral, rate, rate_wanted = (ca.SX.sym(name, 3) for name in ("integral", "rate", "rate_wanted"))
    q, w = ca.SX.sym("q", 4), ca.SX.sym("q_wanted", 4)
    inertia = _constant(np.array(INERTIA))
    vector = q[0] * w[1:] - w[0] * q[1:] - ca.cross(q[1:], w[1:])
    side = ca.if_else(ca.dot(q, w) >= 0.0, 2.0, -2.0)
    error = rate_wanted + side * GAINS["attitude_gain"] * vector - rate
    limit = GAINS["limit"]
    after = ca.fmax(ca.fmin(integral + DT * error, limit), -limit)
    torque: Any = ca.mtimes(inertia, GAINS["rate_gain"] * error + GAINS["integral_gain"] * after)
    torque = torque + ca.cross(rate, ca.mtimes(inertia, rate))
    inputs = [integral, q, rate, w, rate_wanted]
    _write(ca.Function("peer", inputs, ca.cse([after, torque])), folder)

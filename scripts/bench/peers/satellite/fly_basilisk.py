# SPDX-License-Identifier: Apache-2.0
"""The satellite in Basilisk: `python3 -m bench.peers.satellite.fly_basilisk SECONDS` prints ns per step and the errors at the end.

Runge-Kutta of fourth order, as in FCSL; the attitude is three modified Rodrigues parameters. One task at 1 kHz has the spacecraft
alone, and a call from Python goes on for a second.
"""

from __future__ import annotations

import json
import sys
from importlib.metadata import version

from Basilisk.simulation import gravityEffector, spacecraft, svIntegrators
from Basilisk.utilities import SimulationBaseClass, macros

from . import case
from .timing import time_seconds


def quaternion(sigma: case.Vector) -> case.Vector:
    square = sum(part * part for part in sigma)
    return [(1 - square) / (1 + square), *(2 * part / (1 + square) for part in sigma)]


def main() -> None:
    simulation = SimulationBaseClass.SimBaseClass()
    simulation.CreateNewProcess("process").addTask(simulation.CreateNewTask("task", macros.sec2nano(case.STEP_S)))
    body = spacecraft.Spacecraft()
    body.hub.mHub = case.MASS
    body.hub.IHubPntBc_B = [[case.INERTIA[i] if i == k else 0.0 for k in range(3)] for i in range(3)]
    body.hub.r_CN_NInit, body.hub.v_CN_NInit = case.POSITION, case.VELOCITY
    body.hub.sigma_BNInit, body.hub.omega_BN_BInit = [0.0, 0.0, 0.0], case.RATES
    planet = gravityEffector.GravBodyData()
    planet.planetName = "planet"
    planet.mu, planet.isCentralBody = case.MU, True
    body.gravField.gravBodies = spacecraft.GravBodyVector([planet])
    body.setIntegrator(svIntegrators.svIntegratorRK4(body))
    simulation.AddModelToTask("task", body)
    simulation.InitializeSimulation()

    def second(number: int) -> None:
        simulation.ConfigureStopTime(macros.sec2nano(float(number)))
        simulation.ExecuteSimulation()

    seconds = int(sys.argv[1])
    ns = time_seconds(second, seconds)
    at_end = body.scStateOutMsg.read()
    errors = case.errors(float(seconds), at_end.r_BN_N, quaternion(at_end.sigma_BN))
    print("\n" + json.dumps({"ns": ns, "errors": errors, "version": version("bsk")}))


if __name__ == "__main__":
    main()

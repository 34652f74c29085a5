# SPDX-License-Identifier: Apache-2.0
"""The satellite in JSBSim: `python3 -m bench.peers.satellite.fly_jsbsim SECONDS` prints ns per step and the errors at the end.

JSBSim has no Runge-Kutta method: it integrates by Adams and Bashforth's fourth order here. Its models of what a satellite has
not (atmosphere, engines, ground and so on) are switched off. Each step is a call from Python.
"""

from __future__ import annotations

import json
import math
import sys
import tempfile
from pathlib import Path

import jsbsim

from . import case
from .timing import time_seconds

FT_M = 0.3048
ADAMS_BASHFORTH_4 = 5
INTEGRATORS = ("rate/rotational", "rate/translational", "position/rotational", "position/translational")
NEEDED = ("FGPropagate", "FGInertial", "FGMassBalance", "FGAccelerations", "FGAircraft")
RADIUS_M = 6378137.0
PLANET = f"""<?xml version="1.0"?>
<planet name="point mass">
  <semimajor_axis unit="M">{RADIUS_M}</semimajor_axis>
  <semiminor_axis unit="M">{RADIUS_M}</semiminor_axis>
  <rotation_rate unit="RAD/SEC">0</rotation_rate>
  <GM unit="FT3/SEC2">{case.MU / FT_M**3!r}</GM>
  <J2>0</J2>
</planet>
"""
AIRCRAFT = f"""<?xml version="1.0"?>
<fdm_config name="satellite" version="2.0" release="BETA">
  <metrics>
    <wingarea unit="M2">1</wingarea>
    <wingspan unit="M">1</wingspan>
    <chord unit="M">1</chord>
    <location name="AERORP" unit="M"><x>0</x><y>0</y><z>0</z></location>
  </metrics>
  <mass_balance>
    <ixx unit="KG*M2">{case.INERTIA[0]}</ixx>
    <iyy unit="KG*M2">{case.INERTIA[1]}</iyy>
    <izz unit="KG*M2">{case.INERTIA[2]}</izz>
    <emptywt unit="KG">{case.MASS}</emptywt>
    <location name="CG" unit="M"><x>0</x><y>0</y><z>0</z></location>
  </mass_balance>
  <ground_reactions/>
  <propulsion/>
  <flight_control name="none"/>
  <aerodynamics/>
</fdm_config>
"""


def start(folder: Path) -> jsbsim.FGFDMExec:
    """The satellite above the equator at longitude 0, which is the x axis of the inertial frame."""
    (folder / "aircraft/satellite").mkdir(parents=True)
    (folder / "aircraft/satellite/satellite.xml").write_text(AIRCRAFT)
    (folder / "planet.xml").write_text(PLANET)
    fdm = jsbsim.FGFDMExec(str(folder))
    fdm.set_debug_level(0)
    if not (fdm.load_planet(str(folder / "planet.xml"), False) and fdm.load_model("satellite")):
        sys.exit("bench: JSBSim refuses the satellite")
    fdm.set_dt(case.STEP_S)
    fdm["simulation/gravity-model"] = 0
    fdm["ic/lat-gc-rad"] = fdm["ic/long-gc-rad"] = 0.0
    fdm["ic/phi-rad"] = fdm["ic/theta-rad"] = fdm["ic/psi-true-rad"] = 0.0
    fdm["ic/ve-fps"], fdm["ic/vn-fps"] = case.VELOCITY[1] / FT_M, case.VELOCITY[2] / FT_M
    fdm["ic/p-rad_sec"], fdm["ic/q-rad_sec"], fdm["ic/r-rad_sec"] = case.RATES
    for name in INTEGRATORS:
        fdm[f"simulation/integrator/{name}"] = ADAMS_BASHFORTH_4
    height = (case.POSITION[0] - RADIUS_M) / FT_M
    for _ in range(3):  # its radius of the planet is rounded to a hundredth of a foot
        fdm["ic/h-sl-ft"] = height
        if not fdm.run_ic():
            sys.exit("bench: JSBSim refuses the start")
        height += case.POSITION[0] / FT_M - fdm["position/eci-x-ft"]
    models = fdm.query_property_catalog("simulation/models")
    for line in models.splitlines() if isinstance(models, str) else models:
        name = line.split()[0]
        if name.endswith("/enabled") and not any(needed in name for needed in NEEDED):
            fdm[name] = 0
    return fdm


def position(fdm: jsbsim.FGFDMExec) -> case.Vector:
    return [fdm[f"position/eci-{axis}-ft"] * FT_M for axis in "xyz"]


def attitude(fdm: jsbsim.FGFDMExec) -> case.Vector:
    """As a rotation from where it began: Euler's angles are against north, east and down at its place."""
    roll, pitch, yaw = (fdm[f"attitude/{angle}-rad"] for angle in ("phi", "theta", "psi"))
    down = -math.pi / 2
    place = [case.about([0, 0, fdm["position/long-gc-rad"]]), case.about([0, down - fdm["position/lat-gc-rad"], 0])]
    turns = [*place, case.about([0, 0, yaw]), case.about([0, pitch, 0]), case.about([roll, 0, 0])]
    q = case.about([0, -down, 0])
    for turn in turns:
        q = case.multiply(q, turn)
    return q


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        fdm = start(Path(folder))
        steps = range(round(1 / case.STEP_S))

        def second(_: int) -> None:
            for _ in steps:
                fdm.run()

        ns = time_seconds(second, int(sys.argv[1]))
        # A fresh line: JSBSim prints what it has read on standard output.
        errors = case.errors(fdm["simulation/sim-time-sec"], position(fdm), attitude(fdm))
        print("\n" + json.dumps({"ns": ns, "errors": errors, "version": jsbsim.__version__}))


if __name__ == "__main__":
    main()

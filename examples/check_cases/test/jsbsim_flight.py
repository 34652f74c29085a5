# SPDX-License-Identifier: Apache-2.0
"""The check-cases in JSBSim (https://jsbsim.sourceforge.net, PyPI), set up from the report's definitions in its own units."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsbsim

#: Frames a second. Half of this makes every difference that is due to the steps four times as large.
RATE_HZ = 1000
#: JSBSim's number of the Adams-Bashforth method of second order.
_ADAMS_BASHFORTH_2 = 3
_DEGREE = math.pi / 180
_SPIN = 7.292115e-5  # rad/s
_FOOT = 0.3048  # m
# All in feet, pounds and slugs: JSBSim's own factors are rounded, to 1.5e-9 from metres and to 2.2e-7 from slugs to pounds.
_ROUND_FT = 20902254.5305
_EQUATOR_FT = 6378137.0 / _FOOT
_POLE_FT = _EQUATOR_FT * (1 - 1 / 298.257223563)
_GM = 3.986004418e14 / _FOOT**3  # ft^3/s^2
_POUNDS = 32.174049  # of JSBSim, in a slug
#: 101325 Pa, as the standard atmosphere has it; JSBSim begins with 2116.228.
_SEA_LEVEL_PSF = 101325 / (14.593902937206364829 / _FOOT)

_SPHERE = {"area": 0.1963495, "span": 1.0, "chord": 1.0, "ixx": 3.6, "iyy": 3.6, "izz": 3.6, "mass": 1.0}
_BRICK = {
    "area": 0.22222, "span": 0.33333, "chord": 0.66667,
    "ixx": 0.00189422, "iyy": 0.006211019, "izz": 0.007194665, "mass": 0.155404754,
}  # fmt: skip
_TUMBLING = (10 * _DEGREE - _SPIN, 20 * _DEGREE, 30 * _DEGREE)
#: What differs from a sphere with drag that falls from 30 000 ft over the WGS-84 Earth. `rate` is over ground, rad/s.
_FALLING: dict[str, object] = {
    "drag": 0.1,
    "damping": 0.0,
    "rate": (-_SPIN, 0.0, 0.0),
    "height": 30000.0,
    "spin": _SPIN,
}
_FALLING |= {"velocity": (0.0, 0.0, 0.0), "yaw": 0.0, "body": _SPHERE, "is_round": False, "wind": None}
CASES: dict[int, dict[str, object]] = {
    1: {"drag": 0.0},
    2: {"body": _BRICK, "drag": 0.0, "rate": _TUMBLING},
    3: {"body": _BRICK, "drag": 0.0, "rate": _TUMBLING, "damping": -1.0},
    4: {"is_round": True, "spin": 0.0, "rate": (10 * _DEGREE, 20 * _DEGREE, 30 * _DEGREE)},
    5: {"is_round": True, "rate": _TUMBLING},
    6: {},
    7: {"wind": lambda height: 20.0},
    8: {"wind": lambda height: 0.003 * height - 20.0},
    9: {"height": 0.0, "velocity": (0.0, 1000.0, -1000.0), "yaw": 90 * _DEGREE, "rate": (0.0, 0.0, 0.0)},
    10: {"height": 0.0, "velocity": (1000.0, 0.0, -1000.0), "rate": (0.0, 0.0, 0.0)},
}
#: The report's column, JSBSim's property, and what that is multiplied by.
_COLUMNS = {
    "altitudeMsl_ft": ("position/h-sl-ft", 1.0),
    "longitude_deg": ("position/long-gc-deg", 1.0),
    "latitude_deg": ("position/lat-geod-deg", 1.0),
    "feVelocity_ft_s_X": ("velocities/v-north-fps", 1.0),
    "feVelocity_ft_s_Y": ("velocities/v-east-fps", 1.0),
    "feVelocity_ft_s_Z": ("velocities/v-down-fps", 1.0),
    "airDensity_slug_ft3": ("atmosphere/rho-slugs_ft3", 1.0),
    "speedOfSound_ft_s": ("atmosphere/a-fps", 1.0),
    "eulerAngle_deg_Roll": ("attitude/phi-rad", 1 / _DEGREE),
    "eulerAngle_deg_Pitch": ("attitude/theta-rad", 1 / _DEGREE),
    "eulerAngle_deg_Yaw": ("attitude/psi-rad", 1 / _DEGREE),
    "bodyAngularRateWrtEi_deg_s_Roll": ("velocities/pi-rad_sec", 1 / _DEGREE),
    "bodyAngularRateWrtEi_deg_s_Pitch": ("velocities/qi-rad_sec", 1 / _DEGREE),
    "bodyAngularRateWrtEi_deg_s_Yaw": ("velocities/ri-rad_sec", 1 / _DEGREE),
}


def _moment(axis: str, length: str, per_speed: str, rate: str, coefficient: object) -> str:
    factors = ["aero/qbar-psf", "metrics/Sw-sqft", length, per_speed, rate]
    product = "".join(f"<property>{name}</property>" for name in factors) + f"<value>{coefficient}</value>"
    return f'<axis name="{axis}"><function name="aero/{axis}"><product>{product}</product></function></axis>'


def _aircraft(case: dict[str, object]) -> str:
    """JSBSim's description of the vehicle and of its planet."""
    body = case["body"]
    assert isinstance(body, dict)
    radii = (_ROUND_FT, _ROUND_FT) if case["is_round"] else (_EQUATOR_FT, _POLE_FT)
    drag = f"<property>aero/qbar-psf</property><property>metrics/Sw-sqft</property><value>{case['drag']}</value>"
    damping = case["damping"]
    moments = [
        _moment("ROLL", "metrics/bw-ft", "aero/bi2vel", "velocities/p-aero-rad_sec", damping),
        _moment("PITCH", "metrics/cbarw-ft", "aero/ci2vel", "velocities/q-aero-rad_sec", damping),
        _moment("YAW", "metrics/bw-ft", "aero/bi2vel", "velocities/r-aero-rad_sec", damping),
    ]
    inertia = "".join(f'<{name} unit="SLUG*FT2">{body[name]}</{name}>' for name in ("ixx", "iyy", "izz"))
    origin = "<x>0</x><y>0</y><z>0</z></location>"
    return f"""<?xml version="1.0"?>
<fdm_config name="vehicle" version="2.0">
  <fileheader/>
  <planet name="Earth">
    <equatorial_radius unit="FT">{radii[0]}</equatorial_radius><semiminor_axis unit="FT">{radii[1]}</semiminor_axis>
    <rotation_rate unit="RAD/SEC">{case["spin"]}</rotation_rate>
    <GM unit="FT3/SEC2">{_GM}</GM><J2>{0.0 if case["is_round"] else 1.08262982e-3}</J2>
  </planet>
  <metrics>
    <wingarea unit="FT2">{body["area"]}</wingarea><wingspan unit="FT">{body["span"]}</wingspan>
    <chord unit="FT">{body["chord"]}</chord><location name="AERORP" unit="IN">{origin}
  </metrics>
  <mass_balance>
    {inertia}<emptywt unit="LBS">{body["mass"] * _POUNDS}</emptywt><location name="CG" unit="IN">{origin}
  </mass_balance>
  <ground_reactions/><propulsion/><flight_control name="none"/>
  <aerodynamics>
    <axis name="DRAG"><function name="aero/DRAG"><product>{drag}</product></function></axis>{"".join(moments)}
  </aerodynamics>
</fdm_config>
"""


def fly(number: int, folder: Path, density: Callable[[float], float] | None = None) -> list[dict[str, float]]:
    """The report's columns at 10, 20 and 30 s. `folder` gets JSBSim's files; `density` (slug/ft^3, of the height in ft)
    replaces that of JSBSim's atmosphere."""
    case = _FALLING | CASES[number]
    aircraft = folder / "aircraft/vehicle"
    aircraft.mkdir(parents=True)
    (aircraft / "vehicle.xml").write_text(_aircraft(case))
    fdm = jsbsim.FGFDMExec(str(folder))
    fdm.set_debug_level(0)
    assert fdm.load_model("vehicle")
    fdm.set_dt(1 / RATE_HZ)
    fdm["atmosphere/P-sl-psf"] = _SEA_LEVEL_PSF
    velocity, rate, height, wind = case["velocity"], case["rate"], case["height"], case["wind"]
    assert isinstance(velocity, tuple) and isinstance(rate, tuple) and isinstance(height, float)
    begin: dict[str, Any] = {"lat-geod-deg": 0.0, "long-gc-deg": 0.0, "h-sl-ft": height, "psi-true-rad": case["yaw"]}
    begin |= dict(zip(("vn-fps", "ve-fps", "vd-fps"), velocity, strict=True))
    begin |= dict(zip(("p-rad_sec", "q-rad_sec", "r-rad_sec"), rate, strict=True))
    if callable(wind):  # here a direction is where the wind goes to
        begin |= {"vw-mag-fps": wind(height), "vw-dir-deg": 90.0}
    for name, value in begin.items():
        fdm[f"ic/{name}"] = value
    for name in ("rate/rotational", "rate/translational", "position/rotational", "position/translational"):
        fdm[f"simulation/integrator/{name}"] = _ADAMS_BASHFORTH_2
    fdm["simulation/gravity-model"] = 0 if case["is_round"] else 1
    if density:
        fdm["atmosphere/override/density"] = density(height)
    assert fdm.run_ic()
    rows = []
    for frame in range(30 * RATE_HZ + 1):
        if frame and frame % (10 * RATE_HZ) == 0:
            rows.append({name: fdm[path] * factor for name, (path, factor) in _COLUMNS.items()})
        # A frame moves the vehicle and then asks the air: it needs that of where the vehicle will be.
        height = fdm["position/h-sl-ft"] - fdm["velocities/v-down-fps"] / RATE_HZ
        if callable(wind):
            fdm["atmosphere/wind-east-fps"] = wind(height)
        if density:
            fdm["atmosphere/override/density"] = density(height)
        assert fdm.run()
    return rows

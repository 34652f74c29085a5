# SPDX-License-Identifier: Apache-2.0
"""NASA's atmospheric check-cases: JSBSim, SciPy, closed forms, and what the program writes."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk

PACKAGE = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(PACKAGE))

import check_cases  # noqa: E402
import jsbsim_flight  # noqa: E402

#: How far from JSBSim a signal may be at 10, 20 and 30 s, in the report's units: with JSBSim's own air, and with the density of
#: the Standard in JSBSim. JSBSim's molar mass of air is 28.9645, the Standard's 28.9644. So its density differs by 3.5e-6 at sea
#: level and by -0.7e-6 at 30 000 ft, and its speed of sound by 1.7e-6, which no density changes. This is the first column, where
#: it exceeds the second, and the speed of sound. All else is due to JSBSim's steps of 1/1000 s.
TOLERANCES = {
    "altitudeMsl_ft": (0.015, 3e-5),
    "longitude_deg": (6e-8, 2e-11),
    "latitude_deg": (6e-8, 2e-11),
    "feVelocity_ft_s": (9e-4, 1e-6),
    "airDensity_slug_ft3": (7e-9, 3e-12),
    "speedOfSound_ft_s": (2.5e-3, 2.5e-3),
    "eulerAngle_deg": (1.5e-4, 1e-4),
    "bodyAngularRateWrtEi_deg_s": (1.2e-5, 1.2e-5),
}
GM, EQUATOR, J2, SPIN = 3.986004418e14, 6378137.0, 1.08262982e-3, 7.292115e-5
ROUND = 6371007.1809


def density_1976(height: float) -> float:
    """kg/m^3 at a geometric height in m, below 11 km. Source: U.S. Standard Atmosphere, 1976, equations 18, 23, 33a and 42."""
    geopotential = 6356766.0 * height / (6356766.0 + height)
    temperature = 288.15 - 0.0065 * geopotential
    pressure = 101325.0 * (288.15 / temperature) ** (9.80665 * 28.9644 / (8314.32 * -0.0065))
    return float(pressure * 28.9644 / (8314.32 * temperature))


@pytest.fixture(scope="module")
def flown() -> dict[int, dict[str, np.ndarray]]:
    return {case: check_cases.fly(case) for case in check_cases.CASES}


@pytest.mark.parametrize("air", ["of JSBSim", "of the Standard"])
@pytest.mark.parametrize("case", check_cases.CASES)
def test_it_flies_as_jsbsim_does(flown: dict[int, dict[str, np.ndarray]], case: int, air: str, tmp_path: Path) -> None:
    """JSBSim was one of the simulations of the report."""
    slug_ft3 = check_cases.SLUG / check_cases.FOOT**3
    density = None if air == "of JSBSim" else lambda height: density_1976(height * check_cases.FOOT) / slug_ft3
    far = []
    for time_s, row in zip((10, 20, 30), jsbsim_flight.fly(case, tmp_path, density), strict=True):
        for name, value in row.items():
            distance = abs(flown[case][name][10 * time_s] - value)
            (limits,) = [limits for start, limits in TOLERANCES.items() if name.startswith(start)]
            turned = min(distance, abs(distance - 360.0)) if name.startswith("eulerAngle") else distance
            if not turned <= limits[density is not None]:
                far.append((time_s, name, value, turned))
    assert far == []


@pytest.mark.parametrize(
    ("case", "is_round", "spin", "wind", "height", "velocity"),
    [
        (4, True, 0.0, lambda height: 0.0, 9144.0, (0.0, 0.0)),
        (5, True, SPIN, lambda height: 0.0, 9144.0, (0.0, 0.0)),
        (6, False, SPIN, lambda height: 0.0, 9144.0, (0.0, 0.0)),
        (7, False, SPIN, lambda height: 6.096, 9144.0, (0.0, 0.0)),
        (8, False, SPIN, lambda height: 0.003 * height - 6.096, 9144.0, (0.0, 0.0)),
        (9, False, SPIN, lambda height: 0.0, 0.0, (304.8, 304.8)),
    ],
    ids=range(4, 10),
)
def test_a_sphere_with_drag_is_that_of_scipy(
    flown: dict[int, dict[str, np.ndarray]],
    case: int,
    is_round: bool,
    spin: float,
    wind: Callable[[float], float],
    height: float,
    velocity: tuple[float, float],
) -> None:
    """A point with drag in the plane of the equator, where the height is what the distance exceeds the radius by. In inertial axes
    with other code; `velocity` over ground is upward and to the east."""
    radius, j2 = (ROUND, 0.0) if is_round else (EQUATOR, J2)
    drag = 0.5 * 0.1 * 0.1963495 * check_cases.FOOT**2 / check_cases.SLUG

    def equations(_: float, x: np.ndarray) -> np.ndarray:
        r = np.hypot(x[0], x[1])
        up = x[:2] / r
        east = np.array([-up[1], up[0]])
        through_air = x[2:] - (spin * r + wind(r - radius)) * east
        acceleration = -GM / r**2 * (1 + 1.5 * j2 * (radius / r) ** 2) * up
        acceleration -= drag * density_1976(r - radius) * np.linalg.norm(through_air) * through_air
        return np.concatenate([x[2:], acceleration])

    start = [radius + height, 0.0, velocity[0], velocity[1] + spin * (radius + height)]
    own = flown[case]
    x, y, vx, vy = solve_ivp(
        equations, (0.0, 30.0), start, "DOP853", own["time"], rtol=1e-13, atol=1e-9, max_step=0.1
    ).y
    r = np.hypot(x, y)
    expected = {
        "altitudeMsl_ft": r - radius,
        "feVelocity_ft_s_Z": -(x * vx + y * vy) / r,
        "feVelocity_ft_s_Y": (x * vy - y * vx) / r - spin * r,
    }
    for name, values in expected.items():
        assert own[name] == pytest.approx(values / check_cases.FOOT, abs=1e-6), name
    assert own["longitude_deg"] == pytest.approx(np.degrees(np.arctan2(y, x) - spin * own["time"]), abs=1e-12)


def test_a_falling_sphere_is_that_of_scipy(flown: dict[int, dict[str, np.ndarray]]) -> None:
    """Case 1: a point in J2 gravity, integrated in inertial axes with other code."""

    def equations(_: float, x: np.ndarray) -> np.ndarray:
        r = np.linalg.norm(x[:3])
        z = (x[2] / r) ** 2
        oblate = 1.5 * J2 * (EQUATOR / r) ** 2 * np.array([1 - 5 * z, 1 - 5 * z, 3 - 5 * z])
        return np.concatenate([x[3:], -GM / r**3 * (1 + oblate) * x[:3]])

    start = [EQUATOR + 9144.0, 0.0, 0.0, 0.0, SPIN * (EQUATOR + 9144.0), 0.0]
    last = solve_ivp(equations, (0.0, 30.0), start, method="DOP853", rtol=1e-13, atol=1e-9).y[:, -1] / check_cases.FOOT
    own = flown[1]
    assert [own[f"eiPosition_ft_{axis}"][-1] for axis in "XYZ"] == pytest.approx(last[:3], abs=1e-6)
    assert [own[f"eiVelocity_ft_s_{axis}"][-1] for axis in "XYZ"] == pytest.approx(last[3:], abs=1e-7)


def test_the_brick_tumbles_as_jacobi_says(flown: dict[int, dict[str, np.ndarray]]) -> None:
    """Case 2: a free body whose energy makes it turn about its largest axis. Source: L. D. Landau, E. M. Lifshitz, Mechanics,
    3rd ed. (1976), section 37, there with I1 < I2 < I3."""
    inertia = np.array([0.00189422, 0.006211019, 0.007194665])
    own = np.array([flown[2][f"bodyAngularRateWrtEi_deg_s_{axis}"] for axis in ("Roll", "Pitch", "Yaw")])
    rate = np.radians(own[:, 0])
    energy, momentum = inertia @ rate**2, np.sum((inertia * rate) ** 2)  # 2 E, M^2
    i1, i2, i3 = inertia
    assert momentum > energy * i2
    s = np.sqrt((i3 - i2) * (momentum - energy * i1) / (i1 * i2 * i3))
    m = (i2 - i1) * (energy * i3 - momentum) / ((i3 - i2) * (momentum - energy * i1))
    largest = np.sqrt((energy * i3 - momentum) / (i2 * (i3 - i2)))
    # The phase at which sn has the value of the beginning; its cosine has the sign of the roll rate.
    tau = np.linspace(0.0, 4 * ellipk(m), 200_001)
    sn, cn, dn, _ = ellipj(tau, m)
    first = tau[np.argmin(np.abs(largest * sn - rate[1]) + (np.sign(cn) != np.sign(rate[0])))]
    for _ in range(5):
        sn, cn, dn, _ = ellipj(first, m)
        first -= (largest * sn - rate[1]) / (largest * cn * dn)
    turns = first + s * flown[2]["time"] * (1 if spins_forward(inertia, rate) else -1)
    sn, cn, dn, _ = ellipj(turns, m)
    expected = [
        np.sqrt((energy * i3 - momentum) / (i1 * (i3 - i1))) * cn,
        largest * sn,
        np.sqrt((momentum - energy * i1) / (i3 * (i3 - i1))) * dn,
    ]
    assert own == pytest.approx(np.degrees(expected), abs=1e-6)


def spins_forward(inertia: np.ndarray, rate: np.ndarray) -> bool:
    """Whether sn grows: w2' = (I3 - I1) w3 w1 / I2 has the sign of cn dn."""
    return bool((inertia[2] - inertia[0]) * rate[2] * rate[0] > 0)


def test_the_program_writes_the_columns_of_the_report(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, PACKAGE / "check_cases.py", "-o", tmp_path / "own"],
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    names = sorted(path.name for path in (tmp_path / "own").iterdir())
    assert names == [f"Atmos_{case:02}_fcsl.csv" for case in check_cases.CASES]
    columns = check_cases.read(tmp_path / "own/Atmos_08_fcsl.csv")
    assert columns["time"].tolist() == [i / 10 for i in range(301)]
    assert {"eulerAngle_deg_Yaw", "bodyAngularRateWrtEi_deg_s_Pitch", "trueAirspeed_nmi_h"} < columns.keys()
    assert columns["altitudeMsl_ft"][0] == pytest.approx(30000.0)
    assert columns["trueAirspeed_nmi_h"][0] == pytest.approx(70 * check_cases.FOOT / check_cases.KNOT)


def test_it_compares_with_a_folder_of_histories(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Against its own histories, one of them moved by 2 ft: the mean is 1 ft away, and so is each of the two."""
    columns = check_cases.fly(6)
    check_cases.write(columns, tmp_path / "Atmos_06_sim_01.csv")
    columns["altitudeMsl_ft"] = columns["altitudeMsl_ft"] + 2.0
    check_cases.write(columns, tmp_path / "Atmos_06_sim_02.csv")
    own = check_cases.read(tmp_path / "Atmos_06_sim_01.csv")
    distances = {name: (distance, spread) for name, distance, spread in check_cases.compare(6, own, tmp_path)}
    assert distances.pop("altitudeMsl_ft") == pytest.approx((1.0, 1.0))
    assert set(distances.values()) == {(0.0, 0.0)}
    assert check_cases.main(["--against", str(tmp_path / "none"), "-o", str(tmp_path / "own")]) == 2
    assert "no Atmos_NN_sim_KK.csv in it" in capsys.readouterr().err
    assert not (tmp_path / "own").exists()

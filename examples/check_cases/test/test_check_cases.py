# SPDX-License-Identifier: Apache-2.0
"""NASA's atmospheric check-cases: JSBSim, SciPy, closed forms, and what the program writes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk

PACKAGE = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(PACKAGE))

import check_cases  # noqa: E402
import jsbsim_flight  # noqa: E402

#: How far from JSBSim a signal may be, in the report's units. Its gas constant differs in the sixth digit, which is 1e-5 of the
#: density, and so of drag; the rest is its steps of 1/400 s.
TOLERANCES = {
    "altitudeMsl_ft": 0.05,
    "longitude_deg": 3e-7,
    "latitude_deg": 3e-7,
    "feVelocity_ft_s": 3e-3,
    "airDensity_slug_ft3": 2e-8,
    "speedOfSound_ft_s": 3e-3,
    "eulerAngle_deg": 1e-3,
    "bodyAngularRateWrtEi_deg_s": 1e-4,
}


@pytest.fixture(scope="module")
def flown() -> dict[int, dict[str, np.ndarray]]:
    return {case: check_cases.fly(case) for case in check_cases.CASES}


@pytest.mark.parametrize("case", check_cases.CASES)
def test_it_flies_as_jsbsim_does(flown: dict[int, dict[str, np.ndarray]], case: int, tmp_path: Path) -> None:
    """JSBSim was one of the simulations of the report."""
    far = []
    for time_s, row in zip((10, 20, 30), jsbsim_flight.fly(case, tmp_path), strict=True):
        for name, value in row.items():
            distance = abs(flown[case][name][10 * time_s] - value)
            (tolerance,) = [limit for start, limit in TOLERANCES.items() if name.startswith(start)]
            turned = min(distance, abs(distance - 360.0)) if name.startswith("eulerAngle") else distance
            if turned > tolerance:
                far.append((time_s, name, value, turned))
    assert far == []


def test_a_falling_sphere_is_that_of_scipy(flown: dict[int, dict[str, np.ndarray]]) -> None:
    """Case 1: a point in J2 gravity, integrated in inertial axes with other code."""
    gm, radius, j2, spin = 3.986004418e14, 6378137.0, 1.08262982e-3, 7.292115e-5

    def equations(_: float, x: np.ndarray) -> np.ndarray:
        r = np.linalg.norm(x[:3])
        z = (x[2] / r) ** 2
        oblate = 1.5 * j2 * (radius / r) ** 2 * np.array([1 - 5 * z, 1 - 5 * z, 3 - 5 * z])
        return np.concatenate([x[3:], -gm / r**3 * (1 + oblate) * x[:3]])

    start = [radius + 9144.0, 0.0, 0.0, 0.0, spin * (radius + 9144.0), 0.0]
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

# SPDX-License-Identifier: Apache-2.0
"""MultirotorMixer against numpy's pseudoinverse within the limits, and beyond them against three linear programs of
scipy, one for each priority."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog

ODD = [0.0, -0.0, 1e300, -1e300, 1.7e308, 5e-324, 1e-308, 1.0, -3.0, float("inf"), float("-inf"), float("nan")]


def ring(n: int, arm: float = 0.25, first: float = 0.5) -> dict[str, Any]:
    angle = 2 * np.pi * (np.arange(n) + first) / n
    return {
        "position": (arm * np.column_stack([np.cos(angle), np.sin(angle)])).tolist(),
        "direction": [1.0 if i % 2 else -1.0 for i in range(n)],
        "torque_per_thrust": [0.016] * n,
        "low": [0.1] * n,
        "high": [6.0] * n,
    }


def skewed(n: int) -> dict[str, Any]:
    """Nothing is symmetric: every rotor has its place, its limits and its drag."""
    rng = np.random.default_rng(n)
    found = ring(n)
    found["position"] = (np.array(found["position"]) + rng.uniform(-0.03, 0.03, (n, 2))).tolist()
    found["torque_per_thrust"] = rng.uniform(0.012, 0.02, n).tolist()
    found["low"], found["high"] = rng.uniform(0.0, 0.3, n).tolist(), rng.uniform(5.0, 8.0, n).tolist()
    return found


VEHICLES = {"quad": ring(4), "hexa": ring(6), "octo": ring(8), "odd quad": skewed(4), "odd hexa": skewed(6)}


def effect(of: dict[str, Any], z_down: bool = False) -> np.ndarray[Any, Any]:
    """Columns r x F - direction torque_per_thrust F, and the thrust, from numpy."""
    up = np.array([0.0, 0.0, -1.0 if z_down else 1.0])
    places = np.column_stack([of["position"], np.zeros(len(of["position"]))])
    torques = np.cross(places, up) - np.outer(np.array(of["direction"]) * of["torque_per_thrust"], up)
    return np.vstack([torques.T, np.ones(len(places))])


def mixer(block: Callable[..., Any], of: dict[str, Any], **more: Any) -> Any:
    return block("multirotor_mixer.py", "MultirotorMixer", sizes={"n": len(of["position"])}, **{**of, **more})


def feed(m: Any, command: Any) -> dict[str, Any]:
    found = m.step(torque=list(map(float, command[:3])), thrust=float(command[3]))
    return {n: np.array(v) if isinstance(v, list) else v for n, v in found.items()}


def commands(of: dict[str, Any], count: int, spread: float) -> Any:
    """Around hover: those of random rotor thrusts, whose deviations from it are multiplied by `spread`."""
    rng = np.random.default_rng(7)
    a, n = effect(of), len(of["position"])
    hover = np.linalg.pinv(a) @ [0, 0, 0, 3.0 * n]
    return [a @ (hover + spread * rng.uniform(-1.5, 1.5, n)) for _ in range(count)]


@pytest.mark.parametrize("z_down", [False, True])
@pytest.mark.parametrize("name", VEHICLES)
def test_within_the_limits_it_is_the_pseudoinverse(block: Callable[..., Any], name: str, z_down: bool) -> None:
    of = VEHICLES[name]
    m, a = mixer(block, of, z_down=z_down), effect(of, z_down)
    seen = 0
    for c in commands(of, 20, 1.0):
        c = c * [1, 1, -1, 1] if z_down else c  # any command will do
        wanted = np.linalg.pinv(a) @ c
        if (wanted < of["low"]).any() or (wanted > of["high"]).any():
            continue
        seen += 1
        out = feed(m, c)
        np.testing.assert_allclose(out["rotor_thrust"], wanted, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose([*out["applied_torque"], out["applied_thrust"]], c, atol=1e-9)
        assert out["tilt_share"] == out["yaw_share"] == 1.0 and not out["saturated"] and out["health"] == "nominal"
    assert seen > 10


def programs(of: dict[str, Any], c: Any, may_raise: bool) -> tuple[float, float, float]:
    """a, f and b by linear programs, each with the results of those before it."""
    m = np.linalg.pinv(effect(of))
    tilt, lift, yaw = m[:, 0] * c[0] + m[:, 1] * c[1], m[:, 3], m[:, 2] * c[2]
    low, high = np.array(of["low"]), np.array(of["high"])
    most = 1e9 if may_raise else max(c[3], (low / lift).max())

    def best(cost: Any, columns: Any, of_rest: Any, bounds: Any) -> Any:
        matrix = np.column_stack(columns)
        found = linprog(
            cost, np.vstack([matrix, -matrix]), np.concatenate([high - of_rest, of_rest - low]), bounds=bounds
        )
        assert found.success, found.message
        return found.x

    a = best([-1, 0], [tilt, lift], 0 * low, [(0, 1), (None, most)])[0] * (1 - 1e-12)
    # |f - thrust| is least: f = thrust + over - under
    over, under = best([1, 1], [lift, -lift], a * tilt + c[3] * lift - 1e-12, [(0, None), (0, None)])
    f = c[3] + over - under
    b = best([-1], [yaw], a * tilt + f * lift - 1e-9, [(0, 1)])[0]
    return a, f, b


@pytest.mark.parametrize("may_raise", [True, False])
@pytest.mark.parametrize("name", VEHICLES)
def test_beyond_the_limits_it_is_the_optimum_of_each_priority(
    block: Callable[..., Any], name: str, may_raise: bool
) -> None:
    of = VEHICLES[name]
    m, matrix = mixer(block, of, may_raise=may_raise), np.linalg.pinv(effect(of))
    seen = {"tilt": 0, "thrust": 0, "yaw": 0}
    for c in [*commands(of, 12, 2.0), *commands(of, 12, 5.0)]:
        for share in (0.05, 1.0, 1.9):
            c = np.array([*c[:3], c[3] * share])
            out = feed(m, c)
            a, f, b = programs(of, c, may_raise)
            assert out["tilt_share"] == pytest.approx(a, abs=1e-6)
            wanted = matrix @ [a * c[0], a * c[1], b * c[2], f]
            np.testing.assert_allclose(out["rotor_thrust"], wanted, atol=1e-5)
            assert (out["rotor_thrust"] >= of["low"]).all() and (out["rotor_thrust"] <= of["high"]).all()
            applied = effect(of) @ out["rotor_thrust"]
            np.testing.assert_allclose([*out["applied_torque"], out["applied_thrust"]], applied, atol=1e-12)
            np.testing.assert_allclose(applied[:2], a * c[:2], atol=1e-5)
            seen["tilt"] += a < 0.999
            seen["thrust"] += abs(f - c[3]) > 1e-3
            seen["yaw"] += b < 0.999
            assert out["saturated"] or (a > 0.999 and b > 0.999)
    assert min(seen.values()) > 3, seen


def test_thrust_yields_to_roll_and_yaw_to_thrust(block: Callable[..., Any]) -> None:
    of = ring(4)
    m = mixer(block, of)
    full = feed(m, [0.5, 0.0, 0.0, 4 * 6.0])  # at full thrust there is no room for roll
    assert full["applied_torque"][0] == pytest.approx(0.5) and full["applied_thrust"] < 24.0
    idle = feed(m, [0.5, 0.0, 0.0, 0.0])  # nor without thrust
    assert idle["applied_torque"][0] == pytest.approx(0.5) and idle["applied_thrust"] > 0.4 + 1e-6
    turn = feed(m, [0.0, 0.0, 0.3, 4 * 5.9])
    assert turn["applied_thrust"] == pytest.approx(4 * 5.9) and 0.0 < turn["yaw_share"] < 0.5
    m.set(may_raise=False)
    assert feed(m, [0.5, 0.0, 0.0, 0.0])["rotor_thrust"].tolist() == pytest.approx([0.1] * 4)


def test_parameters_change_in_flight_and_breaks_make_no_difference(block: Callable[..., Any]) -> None:
    of = ring(6)
    m = mixer(block, of)
    before = feed(m, [0.1, 0.2, 0.01, 18.0])
    m.rest()
    assert (feed(m, [0.1, 0.2, 0.01, 18.0])["rotor_thrust"] == before["rotor_thrust"]).all()
    m.set(high=[3.0, 3.0, 3.0, 0.5, 3.0, 3.0])  # a weak rotor
    out = feed(m, [0.0, 0.0, 0.0, 18.0])
    assert out["rotor_thrust"].max() == pytest.approx(0.5) and out["applied_thrust"] == pytest.approx(3.0)
    assert np.abs(out["applied_torque"]).max() < 1e-12


def test_geometries_that_do_not_fly(block: Callable[..., Any]) -> None:
    of = ring(4)
    no_yaw = mixer(block, {**of, "torque_per_thrust": [0.0] * 4})
    assert feed(no_yaw, [0.0, 0.0, 0.0, 10.0])["health"] == "failed"
    away = mixer(block, {**of, "position": [[x + 1.0, y] for x, y in of["position"]]})
    assert feed(away, [0.0, 0.0, 0.0, 10.0])["health"] == "failed"
    crossed = mixer(block, {**of, "low": [0.1, 0.1, 0.1, 5.0], "high": [6.0, 4.0, 6.0, 6.0]})
    out = feed(crossed, [0.1, 0.0, 0.0, 10.0])
    assert (out["rotor_thrust"] >= [0.1, 0.1, 0.1, 5.0]).all() and (out["rotor_thrust"] <= [6.0, 4.0, 6.0, 6.0]).all()
    for m in (no_yaw, away, crossed):
        assert m.native.get_value("block.counters.faults") == 0


@pytest.mark.parametrize("may_raise", [True, False])
def test_extremes(block: Callable[..., Any], may_raise: bool) -> None:
    of = VEHICLES["odd hexa"]
    m = mixer(block, of, may_raise=may_raise)
    rng = np.random.default_rng(9)
    before = feed(m, [0.1, 0.0, 0.0, 10.0])
    for c in [*rng.choice(ODD, (150, 4)), *([v] * 4 for v in ODD)]:
        out = feed(m, c)
        if np.isfinite(c).all():
            assert (out["rotor_thrust"] >= of["low"]).all() and (out["rotor_thrust"] <= of["high"]).all(), c
            assert 0.0 <= out["tilt_share"] <= 1.0 and 0.0 <= out["yaw_share"] <= 1.0
        if np.isnan(c).any():
            assert out["health"] == "degraded" and (out["rotor_thrust"] == before["rotor_thrust"]).all()
        assert out["health"] in ("nominal", "degraded") and np.isfinite(out["rotor_thrust"]).all()
        before = out
    assert m.native.get_value("block.counters.faults") == 0

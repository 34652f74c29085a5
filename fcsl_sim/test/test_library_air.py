# SPDX-License-Identifier: Apache-2.0
"""Models of air and aerodynamic forces: against published tables, spectra of MIL-F-8785C, closed forms and SciPy."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad, solve_ivp
from scipy.signal import get_window, welch
from scipy.spatial.transform import Rotation

from fcsl_sim.model_instance import ModelInstance
from fcsl_sim.model_list import find_model
from simclient import SimTwin

MODELS = Path(__file__).resolve().parents[1] / "models"
FOOT = 0.3048
Vector = NDArray[np.float64]
Fly = Callable[[dict[str, Any]], SimTwin]


@cache
def library(name: str) -> Path:
    return find_model(str(MODELS / f"{name}.c")).table().library


def model(name: str, parameters: dict[str, Any], **noise: Any) -> ModelInstance:
    """With these parameters, after init. The last value of a table fills its rest."""
    instance = ModelInstance(library(name), name, **noise)
    for key, value in parameters.items():
        shape = instance.fields[f"parameters.{key}"].shape
        given = np.ravel(value).tolist() if shape else value
        instance.set(f"parameters.{key}", given + given[-1:] * (shape[0] - len(given)) if shape else given)
    if instance.has("init"):
        instance.init()
    return instance


def outputs(instance: ModelInstance, inputs: dict[str, Any], *names: str) -> list[Any]:
    """The named outputs for these inputs: floats and arrays."""
    for key, value in inputs.items():
        instance.set(f"inputs.{key}", np.ravel(value).tolist() if np.ndim(value) else value)
    instance.output()
    values = [instance.get(f"outputs.{name}") for name in names]
    return [np.array(value) if isinstance(value, list) else value for value in values]


@pytest.fixture
def fly(tmp_path: Path) -> Iterator[Fly]:
    """Opens a simulation of models of the library, which are compiled as files of a user."""
    opened: list[SimTwin] = []

    def start(simulation: dict[str, Any]) -> SimTwin:
        for file in MODELS.glob("*.[ch]"):
            shutil.copy(file, tmp_path)
        path = tmp_path / "air.sim.json"
        names = {instance["model"] for instance in simulation["instances"].values()}
        models = {name: {"source": f"{name}.c"} for name in names}
        integrator = {"method": "rk4", "hz": 1000}
        path.write_text(json.dumps({"seed": 1, "integrator": integrator, "models": models} | simulation))
        opened.append(SimTwin.from_config(path))
        return opened[-1]

    yield start
    for twin in opened:
        twin.close()


# ---- atmosphere ------------------------------------------------------------------------------------------------------

#: U.S. Standard Atmosphere, 1976, Table I, geometric altitude, metric units (pages 51 to 68): height m, then as printed
#: temperature K, pressure Pa, density kg/m^3. At 86 km the Standard prints the kinetic temperature, which we leave out.
TABLE_1 = [
    (-5_000, "320.676", "1.7776e5", "1.9311"),
    (0, "288.150", "1.01325e5", "1.2250"),
    (5_000, "255.676", "5.4048e4", "7.3643e-1"),
    (10_000, "223.252", "2.6499e4", "4.1351e-1"),
    (15_000, "216.650", "1.2111e4", "1.9476e-1"),
    (20_000, "216.650", "5.5293e3", "8.8910e-2"),
    (25_000, "221.552", "2.5492e3", "4.0084e-2"),
    (30_000, "226.509", "1.1970e3", "1.8410e-2"),
    (35_000, "236.513", "5.7459e2", "8.4634e-3"),
    (40_000, "250.350", "2.8714e2", "3.9957e-3"),
    (45_000, "264.164", "1.4910e2", "1.9663e-3"),
    (50_000, "270.650", "7.9779e1", "1.0269e-3"),
    (55_000, "260.771", "4.2525e1", "5.6810e-4"),
    (60_000, "247.021", "2.1958e1", "3.0968e-4"),
    (65_000, "233.292", "1.0929e1", "1.6321e-4"),
    (70_000, "219.585", "5.2209", "8.2829e-5"),
    (75_000, "208.399", "2.3881", "3.9921e-5"),
    (80_000, "198.639", "1.0524", "1.8458e-5"),
    (85_000, "188.893", "4.4568e-1", "8.2196e-6"),
    (86_000, None, "3.7338e-1", "6.958e-6"),
]
#: The same, Table III: height m, speed of sound m/s, dynamic viscosity Pa s.
TABLE_3 = [
    (-5_000, "358.99", "1.9422e-5"),
    (0, "340.29", "1.7894e-5"),
    (5_000, "320.55", "1.6282e-5"),
    (15_000, "295.07", "1.4216e-5"),
    (25_000, "298.39", "1.4484e-5"),
    (40_000, "317.19", "1.6009e-5"),
    (50_000, "329.80", "1.7037e-5"),
    (60_000, "315.07", "1.5837e-5"),
    (75_000, "289.40", "1.3759e-5"),
    (85_000, "275.52", "1.2647e-5"),
]
AIR = ("temperature", "pressure", "density", "speed_of_sound", "dynamic_viscosity")
#: Geopotential heights at which its layers meet, m.
LAYERS = [0.0, 11e3, 20e3, 32e3, 47e3, 51e3, 71e3]


def air_at(height: float, offset: float = 0.0) -> Vector:
    return np.array(outputs(model("atmosphere_1976", {"temperature_offset": offset}), {"height": height}, *AIR))


def last_digit(printed: str) -> float:
    mantissa, _, exponent = printed.partition("e")
    return 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))


def test_the_atmosphere_is_that_of_the_printed_tables() -> None:
    """The Standard rounds some figures and cuts others: within one unit of the last digit."""
    rows = [(z, dict(zip(AIR[:3], row, strict=True))) for z, *row in TABLE_1]
    rows += [(z, dict(zip(AIR[3:], row, strict=True))) for z, *row in TABLE_3]
    for z, row in rows:
        air = dict(zip(AIR, air_at(float(z)), strict=True))
        for name, printed in row.items():
            if printed is not None:
                assert abs(air[name] - float(printed)) < last_digit(printed), (z, name)


def test_layers_of_the_atmosphere_meet() -> None:
    for base in LAYERS[1:]:
        z = 6356766.0 * base / (6356766.0 - base)
        np.testing.assert_allclose(air_at(z * (1.0 + 1e-12)), air_at(z * (1.0 - 1e-12)), rtol=1e-10)


@pytest.mark.parametrize("height", [-3e3, 5e3, 15e3, 27e3, 40e3, 50e3, 60e3, 80e3])
def test_the_atmosphere_carries_its_own_weight(height: float) -> None:
    gravity = 9.80665 * (6356766.0 / (6356766.0 + height)) ** 2
    slope = (air_at(height + 10.0)[1] - air_at(height - 10.0)[1]) / 20.0
    assert slope == pytest.approx(-air_at(height)[2] * gravity, rel=1e-6)


@pytest.mark.parametrize("height", [0.0, 15e3, 70e3])
def test_an_offset_of_the_temperature_keeps_the_pressure(height: float) -> None:
    standard, hot = air_at(height), air_at(height, 15.0)
    assert hot[0] == standard[0] + 15.0 and hot[1] == standard[1]
    assert hot[2] == pytest.approx(standard[2] * standard[0] / hot[0], rel=1e-14)
    assert hot[3] == pytest.approx(standard[3] * np.sqrt(hot[0] / standard[0]), rel=1e-14)
    sutherland = (hot[0] / standard[0]) ** 1.5 * (standard[0] + 110.4) / (hot[0] + 110.4)
    assert hot[4] == pytest.approx(standard[4] * sutherland, rel=1e-14)


def test_outside_of_its_limits_the_atmosphere_is_that_of_the_limit() -> None:
    assert air_at(-1e6).tolist() == air_at(-5e3).tolist() and air_at(1e9).tolist() == air_at(86e3).tolist()


# ---- tables ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rows", [1, 2, 7, 16])
def test_a_wind_profile_is_interpolated_as_numpy_does(rows: int) -> None:
    random = np.random.default_rng(rows)
    height = np.sort(random.uniform(0.0, 1e4, rows))
    wind = random.normal(0.0, 10.0, (3, rows))
    columns = dict(zip(("wind_north", "wind_east", "wind_down"), wind, strict=True))
    profile = model("wind_profile", {"height": height, **columns})
    for at in [*height, *random.uniform(-1e3, 1.2e4, 50), -1e9, 1e9]:
        (got,) = outputs(profile, {"height": float(at)}, "wind_ned")
        np.testing.assert_allclose(got, [np.interp(at, height, column) for column in wind], rtol=1e-13, atol=1e-13)


def test_columns_of_a_table_may_be_shorter_than_others() -> None:
    values = {"height": [0.0, 100.0, 200.0], "wind_north": [1.0, 2.0], "wind_east": [0.0], "wind_down": [0.0]}
    profile = model("wind_profile", values)
    assert [outputs(profile, {"height": h}, "wind_ned")[0][0] for h in (50.0, 500.0)] == [1.5, 2.0]
    assert np.isnan(outputs(profile, {"height": np.nan}, "wind_ned")[0][0])


# ---- turbulence ------------------------------------------------------------------------------------------------------

STREAMS = [(stream, draw) for stream, draws in enumerate((1, 3, 3, 1)) for draw in range(draws)]
#: Height m, airspeed m/s, seconds between updates, wingspan m. In the sixth, the length of the vertical gusts is almost
#: that of the low-pass of their rate, so that two time constants are equal; in the fifth it is much shorter.
FLIGHTS = [
    (60.0, 25.0, 0.02, 3.0),
    (250.0, 60.0, 1.0, 11.0),
    (450.0, 60.0, 0.01, 11.0),
    (9000.0, 240.0, 0.004, 60.0),
    (1.0, 40.0, 0.05, 30.0),
    (3000.0, 100.0, 0.5, np.pi * 1750.0 * FOOT / 4.0 * (1.0 + 1e-6)),
    (30.0, 150.0, 2.0, 2.0),
]


def scale(height: float, wind_20ft: float, high: float) -> tuple[float, float, float, float]:
    """Lengths Lu = Lv and Lw, m, and deviations su = sv and sw, m/s, of MIL-F-8785C."""
    feet = max(height / FOOT, 10.0)
    low = min(feet, 1000.0)
    base = 0.177 + 0.000823 * low
    values = np.array([low * FOOT / base**1.2, low * FOOT, 0.1 * wind_20ft / base**0.4, 0.1 * wind_20ft])
    part = np.clip((feet - 1000.0) / 1000.0, 0.0, 1.0)
    lu, lw, su, sw = (1.0 - part) * values + part * np.array([1750.0 * FOOT, 1750.0 * FOOT, high, high])
    return lu, lw, su, sw


def spectrum(component: int, at: tuple[float, float, float, float], b: float) -> Callable[[float], float]:
    """The one-sided spectrum of u, v, w, p, q or r over the spatial frequency, rad/m."""
    lu, lw, su, sw = at

    def second_order(length: float, sigma: float, w: float) -> float:
        return sigma**2 * length / np.pi * (1.0 + 3.0 * (length * w) ** 2) / (1.0 + (length * w) ** 2) ** 2

    return [
        lambda w: su**2 * 2.0 * lu / np.pi / (1.0 + (lu * w) ** 2),
        lambda w: second_order(lu, su, w),
        lambda w: second_order(lw, sw, w),
        lambda w: sw**2 / lw * 0.8 * (np.pi * lw / (4.0 * b)) ** (1 / 3) / (1.0 + (4.0 * b * w / np.pi) ** 2),
        lambda w: w**2 / (1.0 + (4.0 * b * w / np.pi) ** 2) * second_order(lw, sw, w),
        lambda w: w**2 / (1.0 + (3.0 * b * w / np.pi) ** 2) * second_order(lu, su, w),
    ][component]


def covariance(component: int, at: tuple[float, float, float, float], b: float, path: float) -> float:
    """Of a component with itself, `path` metres further: the cosine transform of its spectrum."""
    lu, lw, su, sw = at
    if component == 0:
        return su**2 * np.exp(-path / lu)
    if component in (1, 2):
        length, sigma = ((lu, su), (lw, sw))[component - 1]
        return sigma**2 * np.exp(-path / length) * (1.0 - path / (2.0 * length))
    density = spectrum(component, at, b)
    unit = 4.0 * b / np.pi  # makes the frequency dimensionless
    if path == 0.0:
        return quad(lambda w: density(w / unit) / unit, 0.0, np.inf, epsabs=0.0, epsrel=1e-11, limit=500)[0]
    return quad(lambda w: density(w / unit) / unit, 0.0, np.inf, weight="cos", wvar=path / unit, epsabs=1e-13)[0]


def gusts(
    draws: Sequence[tuple[int, int, int]], flight: Sequence[tuple[float, float, float]], wingspan: float
) -> Vector:
    """The responses u, v, w, p, q, r of each update to noise that is one in one draw, else zero.

    A draw is the number of the update, the stream, and the number within the update. An update of `flight` has height,
    airspeed and the seconds since the update before.
    """
    drawn = [0] * 4
    update, draw = 0, (0, 0, 0)

    def gaussian(stream: int) -> float:
        drawn[stream] += 1
        return float(draw == (update, stream, drawn[stream] - 1))

    parameters = {"wind_speed_20ft": 15.0, "high_intensity": 2.5, "wingspan": wingspan}
    turbulence = model("dryden_turbulence", parameters, gaussian=gaussian)
    values = np.empty((len(draws), len(flight), 6))
    for i, chosen in enumerate(draws):
        draw = chosen
        turbulence.init()
        now_ns = 7_000_000_000
        for update, (height, airspeed, seconds) in enumerate(flight):
            turbulence.set("inputs.height", height)
            turbulence.set("inputs.airspeed", airspeed)
            now_ns += round(seconds * 1e9)
            drawn[:] = [0] * 4
            turbulence.update(now_ns)
            values[i, update] = np.hstack(
                [turbulence.get("outputs.gust_body"), turbulence.get("outputs.gust_rate_body")]
            )
    return values


@pytest.mark.parametrize("flight", FLIGHTS)
def test_turbulence_has_the_covariance_of_its_spectrum(flight: tuple[float, float, float, float]) -> None:
    """Without chance: the responses to single draws give the covariance of all updates with the first one."""
    height, airspeed, seconds, wingspan = flight
    flown = [(height, airspeed, seconds)] * 40
    responses = gusts([(0, *where) for where in STREAMS], flown, wingspan)
    got = np.einsum("nc,nkc->kc", responses[:, 0], responses)
    at = scale(height, 15.0, 2.5)
    for component in range(6):
        variance = covariance(component, at, wingspan, 0.0)
        for k in (0, 1, 2, 5, 12, 39):
            expected = covariance(component, at, wingspan, k * airspeed * seconds)
            assert abs(got[k, component] - expected) < 1e-8 * variance, (component, k)


def test_turbulence_keeps_its_variance_at_any_rate_airspeed_and_height() -> None:
    """Of gusts and roll rate. The rates q and r settle over their low-pass, so they do so where the height stays."""
    random = np.random.default_rng(5)
    for changes_height in (True, False):
        height = np.where(changes_height, random.uniform(3.0, 900.0, 12), 200.0)
        flown = [(h, random.uniform(0.0, 100.0), 10.0 ** random.uniform(-3, 0)) for h in height]
        flown[6] = (flown[6][0], 0.0, 0.1)
        every = [(update, *where) for update in range(len(flown)) for where in STREAMS]
        variance = (gusts(every, flown, 9.0) ** 2).sum(axis=0)
        for k, (h, _, _) in enumerate(flown):
            at = scale(h, 15.0, 2.5)
            for component in range(4 if changes_height else 6):
                expected = covariance(component, at, 9.0, 0.0)
                assert variance[k, component] == pytest.approx(expected, rel=1e-9), (component, k)


def test_air_turns_as_its_gusts_change_along_the_path() -> None:
    """A wing much shorter than the gusts: q = -dw/dx, r = dv/dx."""
    for where, gust, rate, sign in (((2, 0), 2, 4, -1.0), ((1, 0), 1, 5, 1.0)):
        (values,) = gusts([(0, *where)], [(200.0, 50.0, 0.01)] * 60, 0.05)
        slope = np.gradient(values[:, gust], 0.5)
        np.testing.assert_allclose(values[1:-1, rate], sign * slope[1:-1], rtol=2e-3, atol=1e-6)


def test_gusts_stand_still_with_the_aircraft() -> None:
    (values,) = gusts([(0, 2, 0)], [(200.0, 50.0, 0.01)] + [(200.0, 0.0, 1.0)] * 3, 9.0)
    assert (values == values[0]).all() and values[0, 2] != 0.0


def test_turbulence_of_a_run_has_the_deviation_and_spectrum_of_the_specification(fly: Fly) -> None:
    """100 km at 50 m/s, sampled every 2.5 m and 10 m.

    Bounds: 4.5 deviations of the estimate for the variance, from the covariances of the process; 5 deviations for a
    band of Welch's spectrum, sqrt(1.9 / (K bins)) with K segments in Hann windows that overlap by half. The expected
    spectrum has the leakage of that window.
    """
    flight = {"height": 30.0, "airspeed": 50.0}
    parameters = {"wind_speed_20ft": 12.0, "high_intensity": 0.0, "wingspan": 10.0}
    turbulence = {"model": "dryden_turbulence", "parameters": parameters, "inputs": flight}
    rates = {"fine": 20, "coarse": 5}
    simulation = {"tick_hz": 20, "duration": 2001.0, "instances": dict.fromkeys(rates, turbulence), "rates": rates}
    twin = fly(simulation)
    paths = [f"{name}.outputs.{path}" for name in rates for path in ("gust_body", "gust_rate_body")]
    with twin.trace(*paths) as trace:
        twin.tick(40_000)
    size, bins = 200, 14
    window = get_window("hann", size)
    overlap = np.correlate(window, window, "full")[size - 1 :] / (window**2).sum()
    turns = np.cos(2.0 * np.pi * np.outer(np.arange(size // 2 + 1) / size, np.arange(1, size)))
    at = scale(30.0, 12.0, 0.0)
    for name, hz in rates.items():
        values = np.hstack([trace[f"{name}.outputs.gust_body"], trace[f"{name}.outputs.gust_rate_body"]])[:: 20 // hz]
        segments = 2 * len(values) // size - 1
        for component in range(6):
            lags = np.array([covariance(component, at, 10.0, k * 50.0 / hz) for k in range(size)])
            deviation = np.sqrt(2.0 / len(values) * (2.0 * ((lags / lags[0]) ** 2).sum() - 1.0))
            assert abs((values[:, component] ** 2).mean() / lags[0] - 1.0) < 4.5 * deviation, (name, component)
            _, power = welch(values[:, component], 1.0, nperseg=size, detrend=False)
            expected = 2.0 * (lags[0] + 2.0 * turns @ (lags * overlap)[1:])
            ratios = (power / expected)[2 : 2 + 7 * bins].reshape(7, bins).mean(axis=1)
            assert (abs(ratios - 1.0) < 5.0 * np.sqrt(1.9 / (segments * bins))).all(), (name, component, ratios)
    assert not np.array_equal(trace["fine.outputs.gust_body"][:100], trace["coarse.outputs.gust_body"][:100])


# ---- air data --------------------------------------------------------------------------------------------------------

AIR_DATA = ("velocity_air_body", "airspeed", "angle_of_attack", "sideslip", "dynamic_pressure", "mach")
STILL = {
    "velocity_ned": [0.0] * 3,
    "attitude_body_to_ned": [1.0, 0.0, 0.0, 0.0],
    "density": 1.2,
    "speed_of_sound": 340.0,
}


def test_air_data_of_any_motion_is_that_of_scipy() -> None:
    random = np.random.default_rng(3)
    instance = model("air_data", {})
    for _ in range(100):
        ground, wind, gust = random.normal(0.0, 30.0, (3, 3))
        turn = Rotation.random(rng=random)
        inputs = {"velocity_ned": ground, "wind_ned": wind, "gust_body": gust, "density": 0.9, "speed_of_sound": 320.0}
        inputs["attitude_body_to_ned"] = np.roll(turn.as_quat(), 1)
        velocity, airspeed, attack, sideslip, pressure, mach = outputs(instance, inputs, *AIR_DATA)
        expected = turn.inv().apply(ground - wind) - gust
        speed = float(np.linalg.norm(expected))
        np.testing.assert_allclose(velocity, expected, atol=1e-12 * speed)
        np.testing.assert_allclose([airspeed, mach, pressure], [speed, speed / 320.0, 0.45 * speed**2], rtol=1e-13)
        # The direction of the velocity is forward, turned by the sideslip and then by the angle of attack.
        direction = Rotation.from_euler("zy", [sideslip, -attack]).apply([1.0, 0.0, 0.0])
        np.testing.assert_allclose(direction, expected / speed, atol=1e-14)
        assert -np.pi / 2 <= sideslip <= np.pi / 2


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"velocity_ned": [10.0, 0.0, 1.0]}, (np.arctan(0.1), 0.0)),  # it sinks
        ({"velocity_ned": [10.0, 0.0, 0.0], "wind_ned": [0.0, -10.0, 0.0]}, (0.0, np.pi / 4)),  # wind from the east
        ({"velocity_ned": [0.0, 0.0, 5.0]}, (np.pi / 2, 0.0)),
        ({"velocity_ned": [0.0, 5.0, 0.0]}, (0.0, np.pi / 2)),
        ({"velocity_ned": [10.0, 0.0, 0.0], "gust_body": [0.0, 0.0, -1.0]}, (np.arctan(0.1), 0.0)),  # updraught
    ],
)
def test_signs_of_the_air_angles(change: dict[str, Any], expected: tuple[float, float]) -> None:
    got = outputs(model("air_data", {}), STILL | change, "angle_of_attack", "sideslip")
    np.testing.assert_allclose(got, expected, atol=1e-15)


def test_air_data_in_the_moving_air_are_zero() -> None:
    drifting = {"velocity_ned": [-3.0, 4.0, -0.0], "wind_ned": [-3.0, 4.0, 0.0], "speed_of_sound": 0.0}
    velocity, *rest = outputs(model("air_data", {}), STILL | drifting, *AIR_DATA)
    assert not velocity.any() and rest == [0.0] * 5


# ---- drag and damping ------------------------------------------------------------------------------------------------


def test_drag_acts_against_the_air() -> None:
    drag = model("aerodynamic_drag", {"area": 0.8, "drag_coefficient": 1.4})
    random = np.random.default_rng(2)
    for velocity in random.normal(0.0, 20.0, (20, 3)):
        (force,) = outputs(drag, {"velocity_air_body": velocity, "density": 1.1}, "force_body")
        speed = np.linalg.norm(velocity)
        np.testing.assert_allclose(force, -0.5 * 1.1 * speed**2 * 0.8 * 1.4 * velocity / speed, rtol=1e-13)
    (force,) = outputs(drag, {"velocity_air_body": [0.0] * 3}, "force_body")
    assert not force.any()


def test_damping_is_that_of_the_reduced_rates() -> None:
    parameters = {"area": 0.02, "span": 0.1, "chord": 0.2, "clp": -1.0, "cmq": -2.0, "cnr": -0.5}
    damping = model("aerodynamic_damping", parameters)
    rate, gust = np.array([0.3, -0.4, 0.5]), np.array([0.1, 0.2, -0.1])
    inputs = {"density": 1.2, "airspeed": 30.0, "rate_body": rate, "gust_rate_body": gust}
    (torque,) = outputs(damping, inputs, "torque_body")
    length = np.array([0.1, 0.2, 0.1])
    reduced = (rate - gust) * length / (2.0 * 30.0)
    expected = 0.5 * 1.2 * 30.0**2 * 0.02 * length * np.array([-1.0, -2.0, -0.5]) * reduced
    np.testing.assert_allclose(torque, expected, rtol=1e-14)
    (torque,) = outputs(damping, {"airspeed": 0.0}, "torque_body")
    assert not torque.any()


def test_a_spinning_sphere_falls_and_slows_down_as_closed_forms_say(fly: Fly) -> None:
    """speed = limit tanh(g t / limit) through still air; a spin in a constant stream of air decays exponentially."""
    mass, inertia, gravity, density = 2.0, 0.01, 9.8, 1.2
    still = {"position_inertial": [0.0] * 3, "velocity_inertial": [0.0] * 3, "roll": 0.3, "pitch": -0.4, "yaw": 2.0}
    body = {"mass": mass, "inertia": (inertia * np.eye(3)).tolist(), "gravity_inertial": [0.0, 0.0, gravity]}
    damping = {"area": 0.05, "span": 0.4, "chord": 0.25, "clp": -1.5, "cmq": -1.0, "cnr": -1.0}
    table = {"height": [0.0], "wind_north": [3.0], "wind_east": [0.0], "wind_down": [0.0]}
    simulation: dict[str, Any] = {
        "tick_hz": 100,
        "duration": 20.0,
        "instances": {
            "body": {"model": "rigid_body", "parameters": still | {"rate_body": [8.0, 0.0, 0.0]}, "inputs": body},
            "air": {"model": "air_data", "inputs": {"density": density, "speed_of_sound": 340.0}},
            "drag": {
                "model": "aerodynamic_drag",
                "parameters": {"area": 0.05, "drag_coefficient": 0.47},
                "inputs": {"density": density},
            },
            "damping": {
                "model": "aerodynamic_damping",
                "parameters": damping,
                "inputs": {"density": density, "airspeed": 10.0},
            },
            "wind": {"model": "wind_profile", "parameters": table, "inputs": {"height": 0.0}},
        },
        "connections": [
            {"from": "body.velocity_inertial", "to": "air.velocity_ned"},
            {"from": "body.attitude_body_to_inertial", "to": "air.attitude_body_to_ned"},
            {"from": "air.velocity_air_body", "to": "drag.velocity_air_body"},
            {"from": "drag.force_body", "to": "body.force_body"},
            {"from": "body.rate_body", "to": "damping.rate_body"},
            {"from": "damping.torque_body", "to": "body.torque_body"},
        ],
    }
    twin = fly(simulation)
    with twin.trace("body.outputs.velocity_inertial", "body.outputs.rate_body") as trace:
        twin.tick(1000)
    t = np.arange(1000) / 100
    limit = np.sqrt(2.0 * mass * gravity / (density * 0.05 * 0.47))
    falls = np.outer(limit * np.tanh(gravity * t / limit), [0.0, 0.0, 1.0])
    np.testing.assert_allclose(trace["body.outputs.velocity_inertial"], falls, atol=1e-9)
    decay = 0.25 * density * 10.0 * 0.05 * 0.4**2 * 1.5 / inertia
    np.testing.assert_allclose(trace["body.outputs.rate_body"][:, 0], 8.0 * np.exp(-decay * t), atol=1e-9)

    simulation["connections"].append({"from": "wind.wind_ned", "to": "air.wind_ned"})
    simulation["instances"]["body"]["inputs"]["gravity_inertial"] = [0.0] * 3
    twin = fly(simulation)
    twin.tick(1001)
    slowness = 0.5 * density * 0.05 * 0.47 / mass  # speed in the air: 3 / (1 + 3 slowness t)
    north = 3.0 - 3.0 / (1.0 + 3.0 * slowness * 10.0)
    np.testing.assert_allclose(twin.get("body.outputs.velocity_inertial"), [north, 0.0, 0.0], atol=1e-9)


# ---- aircraft --------------------------------------------------------------------------------------------------------

ANGLES = np.radians([-20.0, -10.0, 0.0, 8.0, 14.0, 25.0])
AIRCRAFT: dict[str, Any] = {
    "angle_of_attack": ANGLES,
    "lift": np.array([-0.7, -0.6, 0.25, 0.95, 1.3, 0.8]),
    "drag": np.array([0.3, 0.06, 0.03, 0.06, 0.11, 0.4]),
    "pitching_moment": np.array([0.2, 0.1, 0.02, -0.06, -0.12, -0.3]),
    "lift_from_pitch_rate": 3.9,
    "lift_from_elevator": 0.43,
    "side_force_from_sideslip": -0.31,
    "side_force_from_rudder": 0.19,
    "roll_from_sideslip": -0.09,
    "roll_from_roll_rate": -0.47,
    "roll_from_yaw_rate": 0.1,
    "roll_from_aileron": -0.18,
    "roll_from_rudder": 0.015,
    "pitch_from_pitch_rate": -12.4,
    "pitch_from_elevator": -1.1,
    "yaw_from_sideslip": 0.065,
    "yaw_from_roll_rate": -0.03,
    "yaw_from_yaw_rate": -0.1,
    "yaw_from_aileron": 0.05,
    "yaw_from_rudder": -0.066,
    "area": 16.2,
    "span": 11.0,
    "chord": 1.5,
    "moment_reference_body": [0.1, 0.0, -0.2],
}
#: Mirrored at the plane of symmetry: what changes its sign.
MIRROR: dict[str, Any] = {
    "sideslip": -1,
    "rate_body": [-1, 1, -1],
    "gust_rate_body": [-1, 1, -1],
    "aileron": -1,
    "rudder": -1,
}


def flight_state(random: np.random.Generator) -> dict[str, Any]:
    airspeed = random.uniform(5.0, 90.0)
    return {
        "airspeed": airspeed,
        "dynamic_pressure": 0.5 * random.uniform(0.4, 1.2) * airspeed**2,
        "angle_of_attack": random.uniform(-0.6, 0.7),
        "sideslip": random.uniform(-0.3, 0.3),
        "rate_body": random.normal(0.0, 0.5, 3),
        "gust_rate_body": random.normal(0.0, 0.1, 3),
        "elevator": random.uniform(-0.4, 0.4),
        "aileron": random.uniform(-0.4, 0.4),
        "rudder": random.uniform(-0.4, 0.4),
    }


def aircraft_loads(p: dict[str, Any], u: dict[str, Any]) -> tuple[Vector, Vector]:
    """Force and torque by matrices of derivatives, and directions of lift and drag."""
    attack, slip = u["angle_of_attack"], u["sideslip"]
    length = np.array([p["span"], p["chord"], p["span"]])
    reduced = (u["rate_body"] - u["gust_rate_body"]) * length / (2.0 * u["airspeed"])
    controls = np.array([u["aileron"], u["elevator"], u["rudder"]])
    lift, drag, moment = (np.interp(attack, p["angle_of_attack"], p[k]) for k in ("lift", "drag", "pitching_moment"))
    lift += p["lift_from_pitch_rate"] * reduced[1] + p["lift_from_elevator"] * u["elevator"]
    side = p["side_force_from_sideslip"] * slip + p["side_force_from_rudder"] * u["rudder"]
    turn = np.array([p["roll_from_sideslip"] * slip, moment, p["yaw_from_sideslip"] * slip])
    by_rate = np.diag([p["roll_from_roll_rate"], p["pitch_from_pitch_rate"], p["yaw_from_yaw_rate"]])
    by_rate[0, 2], by_rate[2, 0] = p["roll_from_yaw_rate"], p["yaw_from_roll_rate"]
    by_control = np.diag([p["roll_from_aileron"], p["pitch_from_elevator"], p["yaw_from_rudder"]])
    by_control[0, 2], by_control[2, 0] = p["roll_from_rudder"], p["yaw_from_aileron"]
    turn += by_rate @ reduced + by_control @ controls
    ahead = Rotation.from_euler("y", -attack).apply([1.0, 0.0, 0.0])
    up = np.cross(ahead, [0.0, 1.0, 0.0]) * -1.0
    load = u["dynamic_pressure"] * p["area"]
    force = load * (lift * up - drag * ahead + np.array([0.0, side, 0.0]))
    return force, load * length * turn + np.cross(p["moment_reference_body"], force)


def test_loads_of_an_aircraft_are_those_of_numpy() -> None:
    aircraft = model("aerodynamic_tables", AIRCRAFT)
    random = np.random.default_rng(8)
    for _ in range(200):
        inputs = flight_state(random)
        force, torque = outputs(aircraft, inputs, "force_body", "torque_body")
        expected_force, expected_torque = aircraft_loads(AIRCRAFT, inputs)
        np.testing.assert_allclose(force, expected_force, rtol=1e-11, atol=1e-9)
        np.testing.assert_allclose(torque, expected_torque, rtol=1e-11, atol=1e-8)


def test_coefficients_are_interpolated_as_numpy_does_and_held_at_the_ends() -> None:
    aircraft = model("aerodynamic_tables", AIRCRAFT)
    for attack in [*ANGLES, *np.linspace(-3.1, 3.1, 200)]:
        got = outputs(aircraft, {"angle_of_attack": float(attack)}, "lift_coefficient", "drag_coefficient")
        expected = [np.interp(attack, ANGLES, AIRCRAFT[name]) for name in ("lift", "drag")]
        np.testing.assert_allclose(got, expected, rtol=1e-13, atol=1e-15)
    (lift,) = outputs(aircraft, {"angle_of_attack": 0.0, "elevator": 0.1}, "lift_coefficient")
    assert lift == pytest.approx(0.25 + 0.043, rel=1e-14)


def test_a_mirrored_flight_has_mirrored_loads() -> None:
    aircraft = model("aerodynamic_tables", AIRCRAFT)
    random = np.random.default_rng(9)
    for _ in range(20):
        inputs = flight_state(random)
        force, torque = outputs(aircraft, inputs, "force_body", "torque_body")
        mirrored = inputs | {name: np.multiply(inputs[name], sign) for name, sign in MIRROR.items()}
        mirrored_force, mirrored_torque = outputs(aircraft, mirrored, "force_body", "torque_body")
        assert (mirrored_force == force * [1, -1, 1]).all() and (mirrored_torque == torque * [-1, 1, -1]).all()
        assert force[1] != 0.0 and torque[0] != 0.0 and torque[2] != 0.0


def test_an_aircraft_turns_into_the_wind_and_away_from_it_in_roll() -> None:
    calm = flight_state(np.random.default_rng(1)) | {"rate_body": [0.0] * 3, "gust_rate_body": [0.0] * 3}
    calm |= {"elevator": 0.0, "aileron": 0.0, "rudder": 0.0, "angle_of_attack": 0.05, "sideslip": 0.1}
    aircraft = model("aerodynamic_tables", AIRCRAFT | {"moment_reference_body": [0.0] * 3})
    force, torque = outputs(aircraft, calm, "force_body", "torque_body")
    assert force[0] < 0.0 and force[1] < 0.0 and force[2] < 0.0  # back, to the left, up
    assert torque[0] < 0.0 and torque[2] > 0.0


def test_an_aircraft_that_stands_feels_nothing() -> None:
    aircraft = model("aerodynamic_tables", AIRCRAFT)
    inputs = flight_state(np.random.default_rng(4))
    for airspeed in (0.0, 1e-300):
        still = inputs | {"airspeed": airspeed, "dynamic_pressure": 0.5 * airspeed**2}
        assert not np.hstack(outputs(aircraft, still, "force_body", "torque_body")).any()


def test_an_aircraft_flies_as_scipy_integrates_it(fly: Fly) -> None:
    """Five seconds in a wind with deflected controls; the reference takes the density of the air, and nothing else."""
    mass, inertia = 1000.0, np.array([[1285.0, 0.0, -80.0], [0.0, 1825.0, 0.0], [-80.0, 0.0, 2667.0]])
    wind, controls = np.array([-4.0, 3.0, 0.5]), {"elevator": -0.03, "aileron": 0.02, "rudder": -0.04}
    begin: dict[str, Any] = {
        "velocity_inertial": [50.0, 2.0, 1.0],
        "roll": 0.1,
        "pitch": 0.05,
        "yaw": -0.2,
        "rate_body": [0.1, 0.05, 0.0],
    }
    tables = {name: np.ravel(v).tolist() if np.ndim(v) else v for name, v in AIRCRAFT.items()}
    profile = {name: [wind[i]] for i, name in enumerate(("wind_north", "wind_east", "wind_down"))}
    wires = """
        body.velocity_inertial air.velocity_ned; body.attitude_body_to_inertial air.attitude_body_to_ned;
        atmosphere.density air.density; atmosphere.speed_of_sound air.speed_of_sound; wind.wind_ned air.wind_ned;
        air.airspeed wings.airspeed; air.angle_of_attack wings.angle_of_attack; air.sideslip wings.sideslip;
        air.dynamic_pressure wings.dynamic_pressure; body.rate_body wings.rate_body;
        wings.force_body body.force_body; wings.torque_body body.torque_body"""
    simulation: dict[str, Any] = {
        "tick_hz": 100,
        "duration": 6.0,
        "instances": {
            "body": {
                "model": "rigid_body",
                "parameters": {"position_inertial": [0.0] * 3} | begin,
                "inputs": {"mass": mass, "inertia": inertia.tolist(), "gravity_inertial": [0.0, 0.0, 9.81]},
            },
            "atmosphere": {
                "model": "atmosphere_1976",
                "parameters": {"temperature_offset": 0.0},
                "inputs": {"height": 2000.0},
            },
            "wind": {
                "model": "wind_profile",
                "parameters": {"height": [0.0]} | profile,
                "inputs": {"height": 0.0},
            },
            "air": {"model": "air_data"},
            "wings": {"model": "aerodynamic_tables", "parameters": tables, "inputs": controls},
        },
        "connections": [dict(zip(("from", "to"), wire.split(), strict=True)) for wire in wires.split(";")],
    }
    twin = fly(simulation)
    twin.tick(501)
    density = twin.get("atmosphere.outputs.density")

    def rates(_: float, x: Vector) -> Vector:
        attitude, velocity, rate = Rotation.from_quat(x[3:7]), x[:3], x[7:]
        u, v, w = attitude.inv().apply(velocity - wind)
        airspeed = np.sqrt(u**2 + v**2 + w**2)
        air = {"airspeed": airspeed, "angle_of_attack": np.arctan(w / u), "sideslip": np.arcsin(v / airspeed)}
        air |= {"dynamic_pressure": 0.5 * density * airspeed**2, "rate_body": rate, "gust_rate_body": np.zeros(3)}
        force, torque = aircraft_loads(AIRCRAFT, air | controls)
        turn = 0.5 * np.array([x[6] * rate + np.cross(x[3:6], rate)]).ravel()
        spin = np.linalg.solve(inertia, torque - np.cross(rate, inertia @ rate))
        acceleration = attitude.apply(force) / mass + [0.0, 0.0, 9.81]
        return np.hstack([acceleration, turn, -0.5 * x[3:6] @ rate, spin])

    start = Rotation.from_euler("ZYX", [-0.2, 0.05, 0.1]).as_quat()
    x0 = np.hstack([begin["velocity_inertial"], start, begin["rate_body"]])
    flown = solve_ivp(rates, (0.0, 5.0), x0, rtol=1e-10, atol=1e-10).y[:, -1]
    np.testing.assert_allclose(twin.get("body.outputs.velocity_inertial"), flown[:3], atol=1e-6)
    np.testing.assert_allclose(twin.get("body.outputs.rate_body"), flown[7:], atol=1e-8)
    attitude = Rotation.from_quat(np.roll(twin.get("body.outputs.attitude_body_to_inertial"), -1))
    assert (attitude.inv() * Rotation.from_quat(flown[3:7])).magnitude() < 1e-8


# ---- parameters ------------------------------------------------------------------------------------------------------

WIND = {"height": [0.0, 10.0], "wind_north": [0.0], "wind_east": [0.0], "wind_down": [0.0]}
TURBULENCE = {"wind_speed_20ft": 1.0, "high_intensity": 1.0, "wingspan": 1.0}
DRAG = {"area": 1.0, "drag_coefficient": 1.0}
DAMPING = {"area": 1.0, "span": 1.0, "chord": 1.0, "clp": -1.0, "cmq": -1.0, "cnr": -1.0}
NAN = float("nan")


@pytest.mark.parametrize(
    ("name", "parameters", "change", "reason"),
    [
        ("atmosphere_1976", {}, {"temperature_offset": -187.0}, "temperature_offset must be more than -186.946 K"),
        ("atmosphere_1976", {}, {"temperature_offset": NAN}, "temperature_offset must be more than"),
        ("wind_profile", WIND, {"height": [10.0, 10.0, 20.0]}, "height must increase"),
        ("wind_profile", WIND, {"height": [10.0, 5.0]}, "height must increase"),
        ("wind_profile", WIND, {"height": [0.0, 20.0, 10.0]}, "height must increase"),
        ("wind_profile", WIND, {"height": [NAN]}, "height must increase"),
        ("wind_profile", WIND, {"height": [0.0, NAN]}, "height must increase"),
        ("dryden_turbulence", TURBULENCE, {"wind_speed_20ft": -1.0}, "wind_speed_20ft must not be negative"),
        ("dryden_turbulence", TURBULENCE, {"high_intensity": NAN}, "high_intensity must not be negative"),
        ("dryden_turbulence", TURBULENCE, {"wingspan": 0.0}, "wingspan must be positive"),
        ("aerodynamic_drag", DRAG, {"area": -1.0}, "area must not be negative"),
        ("aerodynamic_drag", DRAG, {"drag_coefficient": NAN}, "drag_coefficient must not be negative"),
        ("aerodynamic_damping", DAMPING, {"area": -1.0}, "area must not be negative"),
        ("aerodynamic_damping", DAMPING, {"span": -1.0}, "span must not be negative"),
        ("aerodynamic_damping", DAMPING, {"chord": NAN}, "chord must not be negative"),
        ("aerodynamic_tables", AIRCRAFT, {"angle_of_attack": [0.0, -0.1]}, "angle_of_attack must increase"),
        ("aerodynamic_tables", AIRCRAFT, {"area": 0.0}, "area must be positive"),
        ("aerodynamic_tables", AIRCRAFT, {"span": 0.0}, "span must be positive"),
        ("aerodynamic_tables", AIRCRAFT, {"chord": 0.0}, "chord must be positive"),
    ],
)
def test_wrong_parameters_are_refused(
    name: str, parameters: dict[str, Any], change: dict[str, Any], reason: str
) -> None:
    if parameters:
        model(name, parameters)
    with pytest.raises(ValueError, match=f"^parameters.{reason}"):
        model(name, parameters | change)

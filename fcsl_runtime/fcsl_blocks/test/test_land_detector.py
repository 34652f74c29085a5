# SPDX-License-Identifier: Apache-2.0
"""LandDetector against running minima of scipy (a condition that has held for a time) on random signals, a landing with
closed forms, and single conditions, breaks, and inputs that are not finite."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.ndimage import minimum_filter1d

ODD = [0.0, -0.0, 1e300, -1e300, 1.7e308, 5e-324, -1e-308, 1.0, -3.0, float("inf"), float("-inf"), float("nan")]
STAGES = ("ground_contact", "maybe_landed", "landed")
#: On the ground, with motors that idle.
DOWN: dict[str, Any] = {
    "armed": True,
    "descending": True,
    "thrust": 0.0,
    "hover_thrust": 10.0,
    "velocity": [0.0, 0.0, 0.0],
    "velocity_valid": True,
    "rates": [0.0, 0.0, 0.0],
    "specific_force": [0.0, 0.0, -9.81],
    "height": 0.1,
    "height_valid": True,
}
#: What makes each condition fail, and the first stage that wants it.
FAILING: list[tuple[dict[str, Any], int]] = [
    ({"thrust": 3.5}, 0),
    ({"velocity": [0.0, 0.0, 0.3]}, 0),
    ({"velocity": [0.0, 0.0, -0.3]}, 0),
    ({"velocity": [1.2, -1.2, 0.0]}, 0),
    ({"height": 1.1}, 0),
    ({"thrust": 2.5}, 1),
    ({"rates": [0.3, 0.3, 0.0]}, 1),
    ({"rates": [-0.4, 0.0, 0.0]}, 1),
]


class Detector:
    def __init__(self, block: Callable[..., Any], rate: int = 100, **more: Any):
        given = {"min_thrust": 0.0, "contact_time": 0.3, "maybe_time": 0.2, "landed_time": 0.1, "freefall_time": 0.1}
        self.block = block("land_detector.py", "LandDetector", rate=rate, **{**given, **more})

    def step(self, **more: Any) -> dict[str, Any]:
        return dict(self.block.step(**{**DOWN, **more}))

    def stage(self, **more: Any) -> int:
        """How many stages hold; each wants the one before."""
        out = self.step(**more)
        found = [bool(out[n]) for n in STAGES]
        assert found == sorted(found, reverse=True)
        return sum(found)

    def run(self, runs: int, **more: Any) -> int:
        return [self.stage(**more) for _ in range(runs)][-1]


def held(condition: Any, time: float, rate: int) -> np.ndarray[Any, Any]:
    """Where the condition has held for the time: a running minimum of scipy, of this run and those before."""
    size = 1 + int(np.ceil(time * rate - 0.01))
    return minimum_filter1d(np.asarray(condition, int), size, origin=(size - 1) // 2, mode="constant", cval=0) > 0


def spells(rng: np.random.Generator, runs: int, good: float, bad: float) -> np.ndarray[Any, Any]:
    """A bool that stays for random times."""
    value, found = False, list[bool]()
    while len(found) < runs:
        value = not value
        found += [value] * int(1 + rng.exponential(good if value else bad))
    return np.array(found[:runs])


@pytest.mark.parametrize("rate", [100, 500])
@pytest.mark.parametrize("times", [(0.3, 0.2, 0.1, 0.1), (0.0, 0.25, 0.0, 0.35)])
def test_the_stages_are_running_minima(block: Callable[..., Any], rate: int, times: tuple[float, ...]) -> None:
    """Without widening and with a descent all the time, nothing is fed back."""
    names = ("contact_time", "maybe_time", "landed_time", "freefall_time")
    d = Detector(block, rate=rate, widening=1.0, min_thrust=2.0, **dict(zip(names, times, strict=True)))
    rng, runs = np.random.default_rng(rate), 600 + 4 * rate
    fine = {n: spells(rng, runs, 1.6 * rate, 0.05 * rate) for n in ("low", "minimal", "slow", "calm", "near", "steady")}
    held_up = spells(rng, runs, 2.0 * rate, 0.3 * rate)
    armed = spells(rng, runs, 5.0 * rate, 0.5 * rate)
    turn = rng.uniform(0.0, 2.0 * np.pi, (runs, 2))
    trace = []
    for k in range(runs):
        minimal = 2.0 + 0.1 * 8.0 + (0.0 if fine["minimal"][k] else 1e-9)
        out = d.step(
            thrust=minimal if fine["low"][k] else 2.0 + 0.3 * 8.0 + 1e-9,
            velocity=[*np.array([np.cos(turn[k, 0]), np.sin(turn[k, 0])]) * (1.49 if fine["calm"][k] else 1.51)]
            + [0.24 if fine["slow"][k] else -0.26],
            height=0.9 if fine["near"][k] else 1.1,
            rates=[*np.array([np.cos(turn[k, 1]), np.sin(turn[k, 1])]) * (0.34 if fine["steady"][k] else 0.36), 9.0],
            specific_force=[1.0, 1.0, 2.0] if held_up[k] else [1.0, 1.0, 1.0],
            armed=bool(armed[k]),
        )
        trace.append([out[n] for n in ("freefall", *STAGES)])
    found = np.array(trace).T
    freefall = held(~held_up, times[3], rate)
    contact = held(fine["low"] & fine["slow"] & fine["calm"] & fine["near"] | ~armed, times[0], rate)
    free = fine["low"] & fine["minimal"] & fine["steady"] & ~freefall
    maybe = held(contact & (free | ~armed), times[1], rate)
    landed = held(maybe, times[2], rate)
    assert 0.05 < landed.mean() <= maybe.mean() < contact.mean() < 0.95 and 0.01 < freefall.mean() < 0.5
    for row, wanted in zip(found, (freefall, contact, maybe, landed), strict=True):
        assert np.flatnonzero(row != wanted).tolist() == []


@pytest.mark.parametrize("rate", [100, 500])
def test_a_landing(block: Callable[..., Any], rate: int) -> None:
    """Hover, descent at 0.7 m/s, touch-down, a controller that winds the thrust down by 20 N/s from 10 N, take-off."""
    d = Detector(block, rate=rate)
    assert d.run(2 * rate, thrust=10.0, descending=False, height=5.0) == 0
    assert d.run(2 * rate, thrust=9.9, velocity=[0.1, 0.0, 0.7], height=3.0) == 0
    came: dict[int, float] = {}
    for k in range(2 * rate):
        t = k / rate
        came.setdefault(d.stage(thrust=max(10.0 - 20.0 * t, 0.0)), t)
    contact = 0.35 + 0.3  # 3 N after 0.35 s
    assert [came[i] for i in (1, 2, 3)] == pytest.approx([contact, contact + 0.2, contact + 0.3], abs=1.5 / rate)
    assert d.stage(thrust=0.9, descending=False) == 3  # below 0.1 of hovering
    assert d.stage(thrust=3.1, descending=False) == 0


@pytest.mark.parametrize("failing", range(len(FAILING)))
def test_each_condition_ends_its_stage_at_once(block: Callable[..., Any], failing: int) -> None:
    change, first = FAILING[failing]
    d = Detector(block, widening=1.0)
    assert d.run(80) == 3
    assert d.stage(**change) == first
    assert d.run(200, **change) == first
    assert d.run(31 + 20 + 10) == 3


def test_once_maybe_landed_the_limits_are_wider(block: Callable[..., Any]) -> None:
    d = Detector(block)
    moving = {"velocity": [0.0, 0.0, 0.6], "rates": [0.8, 0.0, 0.0], "descending": False}
    assert d.run(100, **moving) == 0
    assert d.run(80) == 3
    assert d.run(100, **moving) == 3
    assert d.stage(**{**moving, "velocity": [0.0, 0.0, 0.63]}) == 0
    assert d.run(80) == 3
    assert d.stage(rates=[0.0, 0.9, 0.0]) == 1


def test_contact_wants_a_commanded_descent(block: Callable[..., Any]) -> None:
    d = Detector(block)
    assert d.run(100, descending=False) == 0
    assert d.run(31) == 1
    assert d.stage(descending=False) == 0


def test_without_velocity_and_height(block: Callable[..., Any]) -> None:
    d = Detector(block, blind_time=2.0)
    unknown = {"velocity_valid": False, "velocity": [np.nan] * 3, "height_valid": False, "height": np.nan}
    assert d.run(400, **{**unknown, "thrust": 1.1}) == 0
    assert d.run(200, **unknown) == 0
    assert d.stage(**unknown) == 1
    assert d.run(30, **unknown) == 3
    assert d.stage(**{**unknown, "thrust": 1.1}) == 0


def test_freefall(block: Callable[..., Any]) -> None:
    d = Detector(block)
    falling = {"specific_force": [0.0, 1.0, -1.0]}
    assert [d.step(**falling)["freefall"] for _ in range(12)] == [False] * 10 + [True] * 2
    assert d.run(100, **falling) == 1  # like ground, but for the specific force
    assert not d.step()["freefall"]
    assert d.run(60) == 3


def test_not_armed_it_has_landed_after_the_times(block: Callable[..., Any]) -> None:
    d = Detector(block)
    away = {"armed": False, "descending": False, "velocity": [9.0, 9.0, 9.0], "rates": [9.0, 9.0, 9.0], "height": 9.0}
    assert [d.stage(**away) for _ in range(62)] == [0] * 30 + [1] * 20 + [2] * 10 + [3] * 2
    assert d.stage(**{**away, "armed": True}) == 0


@pytest.mark.parametrize("initial", [False, True])
def test_after_a_break(block: Callable[..., Any], initial: bool) -> None:
    d = Detector(block, initial=initial)
    assert d.stage() == (3 if initial else 0)
    assert d.run(80) == 3
    d.block.rest()
    assert d.step(thrust=float("nan"))["health"] == "degraded"  # waits
    assert d.stage() == (3 if initial else 0)
    assert d.stage(thrust=4.0) == 0
    assert d.run(25) == 0
    d.block.rest()
    assert d.run(30) == (3 if initial else 0)
    for _ in range(12):
        d.step(specific_force=[0.0, 0.0, 0.0])
    d.block.rest()
    assert not d.step(specific_force=[0.0, 0.0, 0.0])["freefall"]


@pytest.mark.parametrize("waiting", [0, 1, 2])
def test_after_a_break_the_times_begin_anew(block: Callable[..., Any], waiting: int) -> None:
    names = ("contact_time", "maybe_time", "landed_time")
    times: dict[str, Any] = {n: 0.1 if i == waiting else 0.0 for i, n in enumerate(names)}
    d = Detector(block, **times)
    assert d.run(8) == waiting
    d.block.rest()
    assert d.run(10) == waiting and d.stage() == 3
    assert [d.step(specific_force=[0.0, 0.0, 0.0])["freefall"] for _ in range(8)][-1] is False
    d.block.rest()
    assert [d.step(specific_force=[0.0, 0.0, 0.0])["freefall"] for _ in range(11)] == [False] * 10 + [True]


def test_parameters_change_in_flight(block: Callable[..., Any]) -> None:
    d = Detector(block)
    assert d.run(11) == 0
    d.block.set(contact_time=0.1)
    assert d.stage() == 1
    assert d.run(100, rates=[0.4, 0.0, 0.0]) == 1
    d.block.set(max_rate=0.5, maybe_time=0.0)
    assert d.stage(rates=[0.4, 0.0, 0.0]) == 2
    d.block.set(min_thrust=5.0)
    assert d.run(20, thrust=5.4) == 3
    assert d.stage(thrust=5.6) == 1


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_what_is_not_finite_is_passed_over(block: Callable[..., Any], value: float) -> None:
    d = Detector(block)
    assert d.run(20) == 0
    bad: list[dict[str, Any]] = [{n: value} for n in ("thrust", "hover_thrust", "height")]
    for name in ("velocity", "rates", "specific_force"):
        bad += [{name: [value if i == k else 0.0 for i in range(3)]} for k in range(3)]
    for change in bad:
        out = d.step(**change)
        assert out["health"] == "degraded" and not out["ground_contact"], change
    assert d.run(10) == 0 and d.stage() == 1  # the time has stood still
    assert d.run(30) == 3
    assert d.stage(thrust=value) == 3


def test_extremes(block: Callable[..., Any]) -> None:
    d = Detector(block)
    rng = np.random.default_rng(4)
    for _ in range(400):
        change: dict[str, Any] = {n: rng.choice(ODD, 3).tolist() for n in ("velocity", "rates", "specific_force")}
        change |= {n: float(rng.choice(ODD)) for n in ("thrust", "hover_thrust", "height")}
        change |= {n: bool(rng.integers(2)) for n in ("armed", "descending", "velocity_valid", "height_valid")}
        d.stage(**{n: change[n] for n in rng.choice(list(change), 4, replace=False)})
    assert d.block.native.get_value("block.counters.faults") == 0
    assert d.run(80) == 3

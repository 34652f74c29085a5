# SPDX-License-Identifier: Apache-2.0
"""LowPass, SecondOrderLowPass and HighPass against SciPy's discretisation of the continuous filters."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import signal

from simclient import AlgTwin

SOURCE = "low_pass.py"
CLASSES = ["LowPass", "SecondOrderLowPass", "HighPass"]
NAN, INF = float("nan"), float("inf")


def run(block: Any, values: Any, name: str = "output") -> list[float]:
    return [block.step(input=float(v))[name] for v in values]


def noise(count: int = 120) -> np.ndarray[Any, Any]:
    """Begins at 0, where SciPy's filters begin."""
    return np.concatenate([[0.0], np.random.default_rng(3).normal(size=count)])


@pytest.mark.parametrize("rate", [100, 500])
@pytest.mark.parametrize("cutoff", [0.01, 3.0, 40.0])
def test_first_order_is_that_of_scipy(block: Callable[..., Any], rate: int, cutoff: float) -> None:
    """SciPy holds an input until the next sample, we from the one before: b[1:] takes its delay away."""
    w, u = 2.0 * np.pi * cutoff, noise()
    b, a, _ = signal.cont2discrete(([w], [1.0, w]), 1.0 / rate, method="zoh")
    low = signal.lfilter(b[0][1:], a, u)
    found = run(block(SOURCE, "LowPass", rate=rate, cutoff=cutoff), u)
    np.testing.assert_allclose(found, low, rtol=1e-9, atol=1e-12)
    found = run(block(SOURCE, "HighPass", rate=rate, cutoff=cutoff), u)
    np.testing.assert_allclose(found, u - low, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(
    "rate, damping", [(100, 0.0), (500, 0.3), (100, 0.7), (100, 1 - 1e-12), (500, 1.0), (100, 1 + 1e-12), (500, 4.0)]
)
def test_second_order_is_that_of_scipy(block: Callable[..., Any], rate: int, damping: float) -> None:
    w, u = 2.0 * np.pi * 5.0, noise()
    system = (
        np.array([[0.0, 1.0], [-w * w, -2.0 * damping * w]]),
        np.array([[0.0], [w * w]]),
        np.eye(2),
        np.zeros((2, 1)),
    )
    a, b, *_ = signal.cont2discrete(system, 1.0 / rate, method="zoh")
    x, expected = np.zeros(2), []
    for v in u:
        x = a @ x + b[:, 0] * v
        expected.append(x)
    filter_ = block(SOURCE, "SecondOrderLowPass", rate=rate, cutoff=5.0, damping=damping)
    found = [(o["output"], o["derivative"]) for o in (filter_.step(input=float(v)) for v in u)]
    np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-9)


def test_a_large_damping_keeps_the_slow_pole(block: Callable[..., Any]) -> None:
    """Near 1 / (2 damping w) s of one pole: the other is 4 damping^2 times as fast."""
    filter_ = block(SOURCE, "SecondOrderLowPass", cutoff=1000.0, damping=1000.0)
    run(filter_, [0.0])
    slow = 2.0 * np.pi * 1000.0 / 2000.0
    found = run(filter_, np.ones(50))
    np.testing.assert_allclose(found, 1.0 - np.exp(-slow * 0.01 * np.arange(1, 51)), rtol=1e-5)


def test_the_cutoff_is_that_of_half_the_power(block: Callable[..., Any]) -> None:
    """A sine of the cutoff, well below the rate of runs: gain sqrt(1/2)."""
    u = np.sin(2.0 * np.pi * 2.0 * np.arange(2000) / 500)
    for class_ in CLASSES:
        found = run(block(SOURCE, class_, rate=500, cutoff=2.0), u)
        assert np.max(found[1500:]) == pytest.approx(np.sqrt(0.5), rel=0.02), class_


@pytest.mark.parametrize("class_", CLASSES)
def test_the_first_run_is_at_rest(block: Callable[..., Any], class_: str) -> None:
    """Also after a break: nothing of before is left."""
    filter_ = block(SOURCE, class_, cutoff=1.0)
    for level in (7.0, -3.0):
        assert run(filter_, [level] * 20) == [0.0 if class_ == "HighPass" else level] * 20
        run(filter_, [0.0, 5.0, 100.0])
        filter_.rest()


@pytest.mark.parametrize("class_", CLASSES)
def test_the_first_finite_input_begins(block: Callable[..., Any], class_: str) -> None:
    filter_ = block(SOURCE, class_, cutoff=1.0)
    assert run(filter_, [4.0, 6.0])[1] != 0.0
    filter_.rest()
    before = filter_.step(input=NAN)
    assert before["health"] == "degraded" and before["output"] != 0.0
    assert run(filter_, [-9.0] * 2) == [0.0 if class_ == "HighPass" else -9.0] * 2


@pytest.mark.parametrize("class_", CLASSES)
def test_what_is_not_finite_is_passed_over(block: Callable[..., Any], class_: str) -> None:
    """It leaves no trace: with and without it, the next outputs are the same."""
    filter_, other = block(SOURCE, class_, cutoff=1.0), block(SOURCE, class_, cutoff=1.0)
    before = [f.step(input=v) for f in (filter_, other) for v in (1.0, 2.0)][-1]
    for value in (NAN, INF, -INF):
        assert filter_.step(input=value) == before | {"health": "degraded"}
        before = filter_.step(input=3.0)
        assert before == other.step(input=3.0) and before["health"] == "nominal"


@pytest.mark.parametrize("class_", CLASSES)
def test_a_new_cutoff_makes_no_jump(block: Callable[..., Any], class_: str) -> None:
    """The step after the change is that of the new filter from the values that the old one had."""
    filter_ = block(SOURCE, class_, rate=500, cutoff=2.0)
    moving = [filter_.step(input=v) for v in np.sin(np.arange(40) / 20.0)][-1]
    filter_.set(cutoff=1e-6)
    after = filter_.step(input=float(np.sin(39 / 20.0)))
    # the input holds, and so small a cutoff moves y on only by its derivative
    expected = moving["output"] + moving.get("derivative", 0.0) / 500
    assert after["output"] == pytest.approx(expected, abs=1e-6)
    filter_.set(cutoff=100.0)
    run(filter_, [5.0] * 100)
    filter_.set(cutoff=0.1)
    assert run(filter_, [5.0] * 3) == pytest.approx([0.0 if class_ == "HighPass" else 5.0] * 3, abs=1e-9)


def test_the_rate_may_change_in_flight(block: Callable[..., Any], tmp_path: Path) -> None:
    """Steps of any length are exact: the response to a step is that of the time, whatever the rates were."""
    w = 2.0 * np.pi * 3.0
    expected = {
        "LowPass": lambda t: 1.0 - np.exp(-w * t),
        "SecondOrderLowPass": lambda t: 1.0 - np.exp(-w * t) * (1.0 + w * t),
        "HighPass": lambda t: np.exp(-w * t),
    }
    for class_, response in expected.items():
        block(SOURCE, class_, cutoff=3.0, **({"damping": 1.0} if class_ == "SecondOrderLowPass" else {}))
        path = tmp_path / "one_block.json"
        config = json.loads(path.read_text())
        config["states"] |= {f"AT_{rate}": {"schedule": {"block": rate}} for rate in (500, 50)}
        path.write_text(json.dumps(config))
        twin, ticks, found = AlgTwin.from_config(path), 0, []
        twin.set("block.inputs.input", 0.0)
        twin.tick(20)
        twin.set("block.inputs.input", 1.0)
        for state, step in (("RUN", 10), ("AT_500", 2), ("AT_50", 20)):
            twin.set_state(state)
            for _ in range(20 // step):
                twin.tick(step)
                ticks += step
                found.append((ticks, twin.get_value("block.outputs.output")))
        # a run takes its input as held since the one before
        assert [v for _, v in found] == pytest.approx([response(t / 1000) for t, _ in found], abs=1e-9), class_


def test_a_cutoff_of_zero(block: Callable[..., Any]) -> None:
    """Held, and run on with its derivative, and the change since the first run."""
    found = {c: run(block(SOURCE, c, cutoff=0.0), [2.0, 5.0, -1.0]) for c in CLASSES}
    assert found == {"LowPass": [2.0] * 3, "SecondOrderLowPass": [2.0] * 3, "HighPass": [0.0, 3.0, -3.0]}


@pytest.mark.parametrize("class_", CLASSES)
def test_no_input_faults(block: Callable[..., Any], class_: str) -> None:
    extremes = [1e300, -1e300, 1.7e308, -1.7e308, 5e-324, -5e-324, -0.0, 0.0, NAN, INF, -INF]
    rng = np.random.default_rng(5)
    filter_ = block(SOURCE, class_, cutoff=1.0)
    for cutoff in (0.0, 1e-300, 1.0, 1e9):
        filter_.rest()
        filter_.set(cutoff=cutoff)
        for v in rng.permutation([*extremes, *rng.normal(size=10)]):
            assert np.isfinite(filter_.step(input=float(v))["output"])
        assert filter_.native.get_value("block.counters.faults") == 0

# SPDX-License-Identifier: Apache-2.0
"""The two models of this package, encoder.c and cart_drive.c, against closed forms."""

from __future__ import annotations

import json

import numpy as np
import pytest
from conftest import EXAMPLE, HZ, SIM, flown

from fcsl_sim.model_instance import ModelInstance

PLANT = json.loads(SIM.read_text())["instances"]


@pytest.mark.parametrize("encoder, truth", [("cart_encoder", "position"), ("pole_encoder", "angle")])
def test_an_encoder_counts_and_loses_samples_as_it_says(encoder: str, truth: str) -> None:
    """Over a flight: whole counts, an even error of variance quantum^2 / 12, and that of the jitter."""
    given = PLANT[encoder]["parameters"]
    trace = flown(25 * HZ - 1, f"{encoder}.outputs", f"pendulum.outputs.{truth}", seed=2)
    sampled = trace[f"{encoder}.outputs.sampled"].astype(bool)
    value, true = trace[f"{encoder}.outputs.value"], trace[f"pendulum.outputs.{truth}"]
    counts = value / given["quantum"]
    assert np.abs(counts - np.round(counts)).max() < 1e-6
    error = (value - true)[sampled]
    moving = np.abs(np.diff(true, prepend=0.0))[sampled] > given["quantum"]
    assert error[moving].var() == pytest.approx(given["quantum"] ** 2 / 12.0 + given["sigma"] ** 2, rel=0.1)
    assert np.abs(error).max() < 0.5 * given["quantum"] + 5.0 * given["sigma"]
    assert 1.0 - sampled.mean() == pytest.approx(given["dropout_probability"], abs=0.002)


def test_the_faults_of_an_encoder() -> None:
    encoder = ModelInstance.load(str(EXAMPLE / "sim" / "encoder.c"), uniform=lambda _: 0.5)
    encoder.set("parameters.quantum", 0.1)
    encoder.set("parameters.bias", 0.02)
    encoder.init()
    told = []
    for fault, truth in ((0, 1.04), (1, 2.0), (2, 3.0), (3, 4.0), (0, -1.04)):
        encoder.set("parameters.fault", fault)
        encoder.set("inputs.truth", truth)
        encoder.update(0)
        told.append((encoder.get("outputs.sampled"), encoder.get("outputs.value")))
    assert [sampled for sampled, _ in told] == [True, False, True, True, True]
    assert [value for _, value in told] == pytest.approx([1.1, 1.1, 1.1, 0.0, -1.0])
    encoder.set("parameters.fault", 4)
    with pytest.raises(ValueError, match="fault"):
        encoder.init()


@pytest.fixture
def drive() -> ModelInstance:
    instance = ModelInstance.load(str(EXAMPLE / "sim" / "cart_drive.c"))
    for name, value in PLANT["drive"]["parameters"].items():
        instance.set(f"parameters.{name}", value)
    instance.init()
    return instance


@pytest.mark.parametrize("command, slope", [(4.0, 1500.0), (-10.0, -5500.0), (25.0, 4500.0), (-25.0, -5500.0)])
def test_the_motor_lags_and_is_limited(drive: ModelInstance, command: float, slope: float) -> None:
    """(sat(command) - force) / 2 ms, from 1 N; the limit is 10 N."""
    drive.set("inputs.command", command)
    assert drive.derivative(0.0, [1.0]) == pytest.approx([slope])


@pytest.mark.parametrize(
    "position, speed, buffer",
    [
        (0.49, 2.0, 0.0),
        (0.51, 0.5, -40.0),  # 2000 N/m 0.01 m and 40 N s/m 0.5 m/s
        (-0.51, -0.5, 40.0),
        (0.51, -0.25, -10.0),
        (0.51, -2.0, 0.0),  # it does not pull
        (-0.51, 2.0, 0.0),
    ],
)
def test_the_buffers_push_and_do_not_pull(drive: ModelInstance, position: float, speed: float, buffer: float) -> None:
    for name, value in (("position", position), ("speed", speed), ("push", 3.0)):
        drive.set(f"inputs.{name}", value)
    drive.output(0.0, [1.5])
    assert drive.get("outputs.buffer_force") == pytest.approx(buffer, abs=1e-9)
    assert drive.get("outputs.force") == pytest.approx(1.5 + 3.0 + buffer)
    assert drive.get("outputs.motor_force") == 1.5

# SPDX-License-Identifier: Apache-2.0
"""What happens when an encoder fails, the cart comes near its end, the operator lets go or falls silent."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from conftest import HZ, SIM, changes, flown

from simclient import SimTwin

SILENT, STUCK, DEAD = 1, 2, 3
WITHIN = {SILENT: 0.025, STUCK: 0.52, DEAD: 0.52}  # s, until SAFE
ENCODERS = ("cart_encoder", "pole_encoder")
MOMENTS = (2.0, 3.0, 4.2, 8.0, 10.3, 15.3)  # s
Moments = tuple[SimTwin, dict[float, bytes]]
PATHS = (
    "machine.state",
    "motor.outputs",
    "drive.inputs.command",
    "drive.outputs",
    "pendulum.outputs",
    "operator.outputs.run",
)


@pytest.fixture(scope="module")
def moments() -> Iterator[Moments]:
    """A twin, and its checkpoints in swing-up, at rest, and in the middle of two steps."""
    with SimTwin.from_config(SIM) as twin:
        saved = {}
        for at_s in MOMENTS:
            twin.tick(round(at_s * HZ) - twin.get("machine.tick"))
            saved[at_s] = twin.save()
        yield twin, saved


@pytest.mark.parametrize("encoder", ENCODERS)
@pytest.mark.parametrize("fault", [SILENT, STUCK, DEAD])
@pytest.mark.parametrize("at_s", MOMENTS)
def test_without_an_encoder_the_motor_lets_go(moments: Moments, encoder: str, fault: int, at_s: float) -> None:
    """The cart comes to a buffer slowly, if it does."""
    twin, saved = moments
    twin.restore(saved[at_s])
    twin.set(f"{encoder}.parameters.fault", fault)
    with twin.trace(*PATHS) as trace:
        twin.tick(3 * HZ)
    lost = next(tick for tick, state in changes(trace["machine.state"]) if state == "SAFE")
    assert 0.0 < lost / HZ <= WITHIN[fault] + 1e-9
    assert set(trace["machine.state"][lost:]) == {"SAFE"}
    # The force ends one tick before: in the one that sees the failure.
    assert (trace["motor.outputs.force"][lost - 1 :] == 0.0).all()
    assert not trace["motor.outputs.armed"][lost - 1 :].any()
    assert (trace["drive.inputs.command"][lost:] == 0.0).all()
    assert np.abs(trace["drive.outputs.motor_force"][lost + HZ // 10 :]).max() < 1e-9
    assert np.abs(trace["pendulum.outputs.position"]).max() < 0.505
    assert np.abs(trace["drive.outputs.buffer_force"]).max() < 15.0  # N


def test_safe_holds_until_the_operator_lets_go(balancing: SimTwin) -> None:
    balancing.set("pole_encoder.parameters.fault", SILENT)
    balancing.run_until("machine.state == 'SAFE'", timeout_ticks=10)
    balancing.set("pole_encoder.parameters.fault", 0)  # it is back, and the switch is still on
    balancing.tick(10 * HZ)
    assert balancing.state() == "SAFE"
    balancing.set("desk.parameters.stop_s", 0.0)
    assert balancing.run_until("machine.state == 'STANDBY'", timeout_ticks=2 * HZ) >= HZ
    balancing.set("desk.parameters.stop_s", -1.0)
    balancing.run_until("machine.state == 'SWING_UP'", timeout_ticks=HZ)
    balancing.run_until("machine.state == 'BALANCE'", timeout_ticks=8 * HZ)
    balancing.tick(HZ)
    assert abs(np.sin(balancing.get("pendulum.outputs.angle"))) < 0.02


def test_an_encoder_that_is_not_back_keeps_it_in_safe(balancing: SimTwin) -> None:
    balancing.set("cart_encoder.parameters.fault", SILENT)
    balancing.run_until("machine.state == 'SAFE'", timeout_ticks=10)
    balancing.set("desk.parameters.stop_s", 0.0)
    balancing.tick(5 * HZ)
    assert balancing.state() == "SAFE"


def test_lost_counts_are_not_forgiven(balancing: SimTwin) -> None:
    """The zero of the encoder is lost with them, and hanging is no longer at pi."""
    balancing.set("cart_encoder.parameters.bias", 0.1)
    balancing.run_until("machine.state == 'SAFE'", timeout_ticks=2)
    balancing.set("desk.parameters.stop_s", 0.0)
    balancing.tick(5 * HZ)
    assert balancing.state() == "SAFE" and not balancing.get("cart_check.outputs.valid")
    assert balancing.get("pole_check.outputs.valid")


def test_single_lost_samples_are_borne() -> None:
    sets = [f"{encoder}.parameters.dropout_probability=0.05" for encoder in ENCODERS]
    trace = flown(12 * HZ, "machine.state", sets=sets)
    assert [state for _, state in changes(trace["machine.state"])][:2] == ["SWING_UP", "BALANCE"]


@pytest.mark.parametrize("force", [12.0, -12.0])
def test_near_the_end_of_the_rail_the_motor_lets_go(balancing: SimTwin, force: float) -> None:
    """A push that the motor cannot bear. The buffer takes the cart, which has no more force behind it."""
    balancing.set("push.parameters.bias", force)
    with balancing.trace(*PATHS) as trace:
        balancing.run_until("machine.state == 'SAFE'", timeout_ticks=2 * HZ)
        balancing.set("push.parameters.bias", 0.0)
        balancing.tick(2 * HZ)
    safe = changes(trace["machine.state"])[-1][0]
    position, speed = trace["pendulum.outputs.position"], trace["pendulum.outputs.speed"]
    assert abs(position[safe - 1] + 0.1 * speed[safe - 1]) == pytest.approx(0.42, abs=0.03)
    assert 0.2 < abs(position[safe - 1]) < 0.43
    assert (trace["motor.outputs.force"][safe - 1 :] == 0.0).all()
    assert np.abs(position).max() < 0.55
    assert set(trace["machine.state"][safe:]) == {"SAFE"}


def test_the_operator_stops_it_at_any_time() -> None:
    for stop_s in (3.0, 9.0):
        trace = flown(12 * HZ, *PATHS, sets=[f"desk.parameters.stop_s={stop_s}"])
        tick, state = changes(trace["machine.state"])[-1]
        assert state == "STANDBY" and tick == round(stop_s * HZ) + 1
        assert (trace["motor.outputs.force"][tick:] == 0.0).all()


def test_half_a_second_without_the_operator_stops_it(fcsl: object) -> None:
    """In the monitor alone: the plant always brings orders."""
    twin = fcsl("../fc/inverted_pendulum.json", instances=["operator", "monitor"])  # type: ignore[operator]
    twin.set_many({"monitor.inputs.cart_valid": True, "monitor.inputs.pole_valid": True})
    twin.attach("operator.run")
    twin.sample("operator.run", True)
    twin.tick()
    assert twin.get_value("monitor.outputs.transition_request") == ""
    stopped = twin.run_until("monitor.outputs.transition_request == 'tr_STOP'", timeout_ticks=2 * HZ)
    assert stopped == HZ // 2 + 1


@pytest.mark.parametrize("position, starts", [(0.27, True), (0.33, False), (-0.33, False)])
def test_it_starts_only_from_the_middle_of_the_rail(position: float, starts: bool) -> None:
    trace = flown(300, "machine.state", sets=[f"pendulum.parameters.position={position}"])
    assert bool(changes(trace["machine.state"])) is starts


def test_it_starts_only_with_known_rates() -> None:
    with SimTwin.from_config(SIM, sets=["pole_encoder.parameters.fault=1"]) as twin:
        twin.tick(3 * HZ)
        assert twin.state() == "SAFE" and not twin.get("estimator.outputs.ready")


def test_a_push_on_the_cart_is_no_fault_of_an_encoder(balancing: SimTwin) -> None:
    """5 N for 0.15 s: the trend of the angle stays small, since the filter knows how the pole answers."""
    with balancing.trace("machine.state", "estimator.outputs.trend") as trace:
        balancing.set("push.parameters.bias", 5.0)
        balancing.tick(30)
        balancing.set("push.parameters.bias", 0.0)
        balancing.tick(HZ // 2)
    assert not changes(trace["machine.state"])
    assert np.abs(trace["estimator.outputs.trend"]).max() < 0.75  # half of the limit

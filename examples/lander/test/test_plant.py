# SPDX-License-Identifier: Apache-2.0
"""The plant with and without its controller, in twins of the simulation."""

import math

import pytest


@pytest.fixture
def plant(fcsl_sim):
    """The plant alone, on the ground."""
    return fcsl_sim("../sim/plant.sim.json")


def test_the_altimeter_has_the_noise_that_it_says(plant):
    with plant.trace("altimeter.outputs.value") as trace:
        plant.tick(10_000)
    error = trace["altimeter.outputs.value"]
    assert error.mean() == pytest.approx(0.0, abs=0.02)  # 4 deviations of the mean
    assert error.std() == pytest.approx(0.5, rel=0.03)


def test_it_falls_as_far_as_gravity_says(plant):
    plant.set_many({"lander.state.pos_z": 20.0, "lander.state.on_ground": False, "lander.state.flown": True})
    plant.set("lander.parameters.gravity", 3.7)
    plant.run_until("lander.outputs.landed", timeout_ticks=1000)
    plant.assert_close("lander.outputs.touchdown_speed", math.sqrt(2.0 * 3.7 * 20.0), rtol=1e-6)


def test_it_climbs_once_its_thrust_exceeds_its_weight(plant):
    throttle = [0.0] * 100 + [1.0] * 100
    with plant.trace("lander.outputs") as trace:
        plant.inject({"lander.inputs.throttle": throttle})
    assert (trace["lander.outputs.pos_z"][:100] == 0.0).all()
    thrust, mass = 2000.0, plant.get("lander.outputs.mass")
    assert trace["lander.outputs.vel_z"][-1] == pytest.approx(0.99 * (thrust / mass - 1.62), rel=0.01)


@pytest.mark.parametrize("sensor", ["altimeter", "velocimeter"])
def test_it_lands_without_a_sensor_from_wherever_that_fails(fcsl_sim, sensor):
    twin = fcsl_sim("../sim/lander.sim.json", seed=3)
    for state in ("COAST", "DESCENT"):
        twin.run_until(f"machine.state == '{state}'", timeout_ticks=3000)
        saved = twin.save()
        twin.set(f"{sensor}.parameters.dropout", True)
        twin.run_until("machine.state == 'SAFE'", timeout_ticks=10)
        twin.run_until("lander.outputs.landed", timeout_ticks=5000)
        assert twin.get("lander.outputs.touchdown_speed") < 5.0
        twin.restore(saved)  # the flight goes on as if nothing had failed

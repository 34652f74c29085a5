# SPDX-License-Identifier: Apache-2.0
"""The same simulation gives the same bits; irrelevant differences of the file do not matter."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fcsl_sim import Simulation
from simclient.bag import Bag, rows_of
from simclient.bag.digest import digest as bag_digest

Open = Callable[..., Simulation]


def noisy(config: dict[str, Any]) -> None:
    for name in ("altimeter", "velocimeter"):
        config["instances"][name]["parameters"]["sigma"] = 0.5


def shuffled(config: dict[str, Any]) -> None:
    """The configuration with every irrelevant order reversed."""
    noisy(config)
    config["connections"].reverse()
    for key in ("models", "instances", "rates"):
        config[key] = dict(reversed(config[key].items()))


def digest(sim: Simulation) -> str:
    """Hash of the truth and the command of every tick."""
    total = hashlib.sha256()
    with sim:
        while sim.status == "running":
            sim.run(1)
            for name in sorted(sim.instances):
                total.update(sim.model_message(name))
            total.update(sim.machine_value("pilot.outputs.pos_z").hex().encode())
    return total.hexdigest()


def test_repeated_runs_are_identical(open_sim: Open) -> None:
    assert digest(open_sim(noisy)) == digest(open_sim(noisy))


def test_the_order_of_the_file_means_nothing(open_sim: Open) -> None:
    assert digest(open_sim(noisy)) == digest(open_sim(shuffled))


def test_the_seed_matters(open_sim: Open) -> None:
    assert digest(open_sim(noisy)) != digest(open_sim(noisy, seed=2))


def test_the_size_of_the_chunks_means_nothing(open_sim: Open) -> None:
    with open_sim(noisy) as one, open_sim(noisy) as other:
        while one.status == "running":
            one.run(1)
        while other.status == "running":
            other.run(7)
        paths = ("ramp.state.x", "altimeter.outputs.value", "velocimeter.outputs.value")
        assert [one.get(path) for path in paths] == [other.get(path) for path in paths]


def test_another_instance_changes_nobody_elses_noise(open_sim: Open) -> None:
    def added(config: dict[str, Any]) -> None:
        noisy(config)
        config["instances"]["a_third"] = {
            "model": "sensor",
            "parameters": {"bias": 0.0, "sigma": 1.0, "dropout": False},
        }
        config["connections"].append({"from": "ramp.x", "to": "a_third.truth"})
        config["rates"]["a_third"] = 1000

    with open_sim(noisy) as two, open_sim(added) as three:
        while two.status == "running":
            assert two.run(1) == three.run(1) == 1
            for name in ("altimeter", "velocimeter"):
                assert two.get(f"{name}.outputs.value") == three.get(f"{name}.outputs.value")
        assert three.get("a_third.outputs.value") != 0.0


def test_a_dropout_changes_no_later_sample(open_sim: Open) -> None:
    def dropout(config: dict[str, Any]) -> None:
        noisy(config)
        set_dropout = {"set": "altimeter.parameters.dropout"}
        config["events"] = [{"at_s": 0.2, "value": True} | set_dropout, {"at_s": 0.4, "value": False} | set_dropout]

    with open_sim(noisy) as good, open_sim(dropout) as bad:
        good.run(100)
        bad.run(100)
        assert good.get("altimeter.outputs.value") == bad.get("altimeter.outputs.value")


def test_golden_bits(open_sim: Open) -> None:
    """Guards the meaning of seeds: a recorded run can be flown again with a later version."""
    with open_sim(noisy) as sim:
        sim.run(100)
        values = [sim.get(path) for path in ("ramp.state.x", "altimeter.outputs.value", "velocimeter.outputs.value")]
    assert [value.hex() for value in values if isinstance(value, float)] == GOLDEN


GOLDEN = ["0x1.fae147ae147b5p-1", "0x1.2420c9ab6226cp-2", "0x1.6757a838d9083p+0"]


def test_two_bags_of_one_run_agree(open_sim: Open, tmp_path: Path) -> None:
    bags = []
    for name in ("one", "two"):
        with open_sim(noisy) as sim:
            sim.record(tmp_path / name, "ns")
            sim.run(1000)
            sim.record_stop()
        bags.append(Bag(tmp_path / name))
    assert bag_digest(bags[0]) == bag_digest(bags[1])
    for instance in ("ramp", "altimeter", "velocimeter"):
        rows = [rows_of(bag, f"/ns/sim/{instance}").tobytes() for bag in bags]
        assert rows[0] == rows[1] and len(rows[0]) >= 100 * 17

# SPDX-License-Identifier: Apache-2.0
"""inject() of every kind of twin: arrays and bags as profiles of what comes in."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from twin_craft import CONFIG

from simclient import AlgTwin, BagError, OverwrittenWarning, Twin, TwinError

ROOT = Path(__file__).resolve().parents[3]
Open = Callable[..., Twin]


def test_a_profile_is_sets_and_samples_before_every_tick(twin: Twin) -> None:
    rng = np.random.default_rng(3)
    altitude = np.ma.masked_array(rng.normal(10, 3, 400), mask=rng.random(400) < 0.6)
    wish, limit = rng.normal(size=400), rng.uniform(1, 1000, 400)
    gyro = rng.normal(size=(400, 3))
    checkpoint = twin.save()
    profile = {"alt": altitude, "watch.inputs.wish": wish, "watch.parameters.limit": limit, "gyro": gyro}
    with twin.trace() as given:
        assert twin.inject(profile) == 400
    twin.restore(checkpoint)
    twin.attach("alt", "gyro")
    with twin.trace() as by_hand:
        for k in range(400):
            if not altitude.mask[k]:
                twin.sample("alt", float(altitude[k]))
            twin.set_many({"watch.inputs.wish": wish[k], "watch.parameters.limit": limit[k]})
            twin.sample("gyro", gyro[k])
            twin.tick()
    for field in twin.fields():
        np.testing.assert_array_equal(given[field.path], by_hand[field.path], err_msg=field.path)
    assert not given["channels.alt.valid"].all() and (given["watch.outputs.health"] == "degraded").any()


@pytest.mark.parametrize(
    ("profile", "reason"),
    [
        ({}, "no array"),
        ({"alt": [1.0], "watch.inputs.wish": [1.0, 2.0]}, "different lengths, in ticks: alt 1, watch.inputs.wish 2"),
        ({"watch.inputs.wish": [[1.0]]}, "an array of ticks wanted, got one of 1 × 1"),
        ({"gyro": np.zeros((5, 2))}, "an array of ticks × 3 wanted, got one of 5 × 2"),
        ({"watch.inputs.wish": [True]}, "f64 wanted, got an array of bool"),
        ({"watch.outputs.health": ["failed"]}, "health: read-only: instance `watch` computes it"),
        ({"watch.outputs.best": [1.0]}, "did you mean"),
        ({"watch.parameters.limit": [1.0, 1001.0]}, "lies in"),
        ({"alt": 3.0}, "alt: an array with a row for every tick wanted, got 3.0"),
        ({"gyro": [[1, 2, 3], [1, 2]]}, "gyro: the rows of the array are of different lengths"),
        ({"gyr": np.zeros((3, 3))}, "`gyr` is neither a sensor channel nor a path; did you mean `gyro`"),
        ({"watch.inputs.wsh": np.zeros(3)}, "did you mean `watch.inputs.wish`"),
        ({"sum": np.zeros(3)}, "`sum` is an actuator channel; there are sensor channels alt, gyro"),
        (None, r"inject\(None\): a dict of paths and arrays, or a bag or its path, wanted"),
    ],
)
def test_what_cannot_be_injected(twin: Twin, profile: Any, reason: str) -> None:
    if profile and "watch.outputs.best" in profile:
        reason = "a struct; give an array for each of its fields"
    with pytest.raises(TwinError, match=reason):
        twin.inject(profile)
    assert twin.get_value("machine.tick") == 0  # nothing of it was applied


def test_a_masked_element_may_be_anything(twin: Twin) -> None:
    limit = np.ma.MaskedArray([5.0, 5000.0], mask=[False, True])
    assert twin.inject({"watch.parameters.limit": limit}) == 2
    assert twin.get_value("watch.parameters.limit") == 5.0


def test_a_bag_is_injected(twin: Twin, open_twin: Open, craft: Path, tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    twin.tick(3)
    twin.record(tmp_path / "bag")
    with twin.trace() as original:
        altitude = np.ma.masked_array(rng.normal(10, 3, 100), mask=rng.random(100) < 0.5)
        twin.inject({"alt": altitude, "watch.inputs.wish": rng.normal(size=100)})
        twin.set("watch.parameters.limit", 500.0)
        twin.tick(10)
    twin.stop_recording()
    other = open_twin(craft)
    other.tick(17)
    other.set("watch.parameters.limit", 1.0)  # the twin's own parameters count, not the bag's
    with other.trace() as again:
        assert other.inject(tmp_path / "bag") == 110
    for path in ("sensors", "channels", "watch.inputs.wish"):
        for field in twin.fields(path):
            np.testing.assert_array_equal(original[field.path], again[field.path], err_msg=field.path)
    assert (again["machine.state"] == "SAFE").any() and (original["machine.state"] == "RUN").all()
    with pytest.raises(BagError):
        other.inject(tmp_path / "nothing")


def changed(craft: Path, folder: Path, **keys: Any) -> Path:
    """The machine with other values of these keys, in a folder of its own."""
    folder.mkdir()
    for name in ("sensors.py", "watch.py"):
        (folder / name).write_bytes((craft.parent / name).read_bytes())
    (folder / "craft.json").write_text(json.dumps({**CONFIG, **keys}))
    return folder / "craft.json"


def test_a_bag_of_what_a_machine_does_not_have_is_refused(open_twin: Open, craft: Path, tmp_path: Path) -> None:
    """Nothing that it says is left out without a word, but for what another part of the same machine is told."""
    with AlgTwin.from_config(craft) as twin:
        twin.record(tmp_path / "bag")
        twin.inject({"alt": np.full(20, 3.0), "watch.inputs.wish": np.ones(20)})
        twin.stop_recording()
    other_name = [{**CONFIG["channels"][0], "name": "altitude"}, CONFIG["channels"][1]]
    renamed = open_twin(changed(craft, tmp_path / "renamed", channels=other_name))
    with pytest.raises(
        BagError, match="feeds sensor channel `alt`, which machine `craft` does not have; did you mean `al"
    ):
        renamed.inject(tmp_path / "bag")
    wired = open_twin(
        changed(
            craft,
            tmp_path / "wired",
            connections=[*CONFIG["connections"], {"from": "sensors.altitude", "to": "watch.wish"}],
        )
    )
    with pytest.warns(OverwrittenWarning, match="watch.inputs.wish is connected from sensors.outputs.altitude, "):
        assert wired.inject(tmp_path / "bag") == 20
    assert wired.get_value("watch.inputs.wish") == 3.0
    stranger = changed(craft, tmp_path / "other", channels=[]).rename(tmp_path / "other" / "other.json")
    with pytest.raises(BagError, match="feeds sensor channel `alt`, which machine `other` does not have"):
        open_twin(stranger).inject(tmp_path / "bag")
    with AlgTwin.from_instances(craft, ["sensors"]) as part:
        assert part.inject(tmp_path / "bag") == 20 and part.get_value("sensors.outputs.altitude") == 3.0
    with AlgTwin.from_instances(changed(craft, tmp_path / "part", channels=other_name), ["sensors"]) as part:
        with pytest.raises(BagError, match=r"its host wrote nothing to this part of `craft`; call tick\(20\)"):
            part.inject(tmp_path / "bag")
        assert part.get_value("machine.tick") == renamed.get_value("machine.tick") == 0


def test_an_incomplete_bag_is_injected_with_a_word(twin: Twin, craft: Path, tmp_path: Path) -> None:
    twin.record(tmp_path / "bag")
    twin.inject({"alt": np.full(2000, 3.0)})
    twin.stop_recording()
    file = tmp_path / "bag" / "bag_0.mcap"
    whole = file.read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: len(whole) // 2])
    with warnings.catch_warnings(action="error"):
        assert twin.inject(tmp_path / "bag") == 2000
    with pytest.warns(UserWarning, match=r"inject\(\): \d+ ticks; the bag is incomplete: ") as told:
        ticks = twin.inject(tmp_path / "cut.mcap")
    assert 0 < ticks < 2000 and f" {ticks} ticks;" in str(told[0].message) and told[0].filename == __file__

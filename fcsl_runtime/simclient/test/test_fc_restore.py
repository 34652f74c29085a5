# SPDX-License-Identifier: Apache-2.0
"""fcsl-fc begins from a checkpoint file, and goes on there as the twin that saved it does."""

from __future__ import annotations

from pathlib import Path

import pytest
from native import FIXTURE, FIXTURE_TWIN, flying

from simclient import AlgTwin
from simclient.bag import Bag


@pytest.fixture
def saved(tmp_path: Path) -> tuple[Path, float]:
    """A checkpoint of tick 7, and what the pilot's integral is ten ticks later."""
    with AlgTwin.from_library(FIXTURE) as twin:
        twin.set("sensors.outputs.gyro", [1.5, -2.0, 0.1])
        twin.tick(7)
        twin.save_file(tmp_path / "checkpoint")
        twin.tick(10)
        return tmp_path / "checkpoint", twin.get_value("pilot.state.integral")  # type: ignore[return-value]


def test_it_goes_on_from_the_file(saved: tuple[Path, float], tmp_path: Path) -> None:
    file, later = saved
    with flying("--restore", file, "--socket", tmp_path / "s", "--paused", "--record", tmp_path / "bag") as fc:
        client = fc.client(tmp_path / "s")
        assert client.ok("state")["tick"] == 7
        assert client.ok("tick", count=10)["tick"] == 17
        assert client.get("pilot.state.integral") == later
        client.close()
        code, out, err = fc.stop()
    assert (code, err) == (0, "") and f"begins at tick 7, from {file}" in out
    bag = Bag(tmp_path / "bag")
    assert [topic for topic in bag.topics if topic.endswith("record/checkpoint")]


def refused(*arguments: str | Path, library: str = FIXTURE) -> tuple[int, str]:
    with flying(*arguments, "--ticks", "1", library=library) as fc:
        code, _, err = fc.wait()
    return code, err


def test_what_it_refuses(saved: tuple[Path, float], tmp_path: Path) -> None:
    file, _ = saved
    content = file.read_bytes()
    (tmp_path / "damaged").write_bytes(content[:300] + bytes([content[300] ^ 1]) + content[301:])
    (tmp_path / "short").write_bytes(content[:300])
    reasons = (("damaged", 1, "its CRC-32 does not match"), ("short", 1, "cut short"), ("none", 2, "No such file"))
    for name, status, reason in reasons:
        code, err = refused("--restore", tmp_path / name)
        assert code == status and reason in err and str(tmp_path / name) in err
    # Of larger machines only the beginning is read, which says whose they are.
    sizes = content[:16] + (len(content) + 10**6).to_bytes(8, "little") + content[24:40]
    larger = sizes + (10**6).to_bytes(4, "little") + content[44:] + bytes(10**6)
    (tmp_path / "larger").write_bytes(larger)
    (tmp_path / "other").write_bytes(larger.replace(b"fixture", b"factory", 1))
    for name, reason in (("larger", "of another layout of machine 'fixture'"), ("other", "of machine 'factory'")):
        code, err = refused("--restore", tmp_path / name)
        assert code == 1 and reason in err
    code, err = refused("--restore", file, "--machine", "fixture_twin", library=FIXTURE_TWIN)
    assert code == 1 and "machine 'fixture', not of 'fixture_twin'" in err
    assert refused("--ignore-source-hash") == (
        2,
        "fcsl-fc: --ignore-source-hash needs --restore\nTry `fcsl-fc --help`.\n",
    )
    code, err = refused("--restore", file, "--hal", f"wire:unix:{tmp_path / 'w'}")
    assert code == 2 and "--restore goes without a simulator" in err

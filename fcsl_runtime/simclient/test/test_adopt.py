# SPDX-License-Identifier: Apache-2.0
"""fcsl adopt: the values of a parameter file in the machine JSON, whose other bytes stay."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest
import tuned_craft as craft

from simclient import AlgTwin

HEAD = "/**:\n  ros__parameters:\n"


def adopt(*words: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["fcsl", "adopt", *map(str, words)], capture_output=True, text=True, timeout=120)


def test_the_rebuilt_machine_begins_as_the_old_one_with_the_file(tmp_path: Path) -> None:
    machine, params = craft.write(tmp_path), craft.file(tmp_path)
    with AlgTwin.from_config(machine, parameters=params) as twin:
        bound = twin._save()
    before = machine.read_text()
    done = adopt(params, machine)
    assert done.returncode == 0, done.stderr
    assert "law.gain: 1.0 -> 3.0 N/rad\n" in done.stdout and done.stdout.endswith("18 values changed\n")
    with AlgTwin.from_config(machine) as twin:
        assert twin._save() == bound
    assert json.loads(machine.read_text()) == craft.config(**craft.CHANGED)
    old, new = before.splitlines(), machine.read_text().splitlines()
    assert len(old) == len(new) and sum(a != b for a, b in zip(old, new, strict=True)) == 18
    assert adopt(params, machine).stdout == f"{machine}: 0 values changed\n"


def test_every_other_byte_stays(tmp_path: Path) -> None:
    """Whatever the style of the file: line ends, order, white space, and numbers whose value is the same."""
    machine = craft.write(tmp_path)
    text = (
        machine.read_text()
        .replace("\n", "\r\n")
        .replace('"gain": 1.0', '"gain"\t:   1e0')
        .replace('"kp": 0.25', '"kp":25E-2')
    )
    machine.write_bytes(b"\xef\xbb\xbf" + text.encode())
    before = machine.read_bytes()
    done = adopt(craft.file(tmp_path, HEAD + "    law.gain: 2.5\n    law.loop.kp: 0.25\n    law.steps: 2\n"), machine)
    assert done.returncode == 0 and "law.gain: 1e0 -> 2.5 N/rad" in done.stdout, done.stderr
    assert machine.read_bytes() == before.replace(b"   1e0", b"   2.5")


def test_defaults_of_algorithms_are_written(tmp_path: Path) -> None:
    machine = craft.write(tmp_path)
    law = tmp_path / "law.py"
    defaults = {"gain": '"f64 N/rad in 0..10 = 1.0"', "steps": '"i32 in -5..5 = 2"', "narrow": '"f32 = 0.5"'}
    text = law.read_text()
    for name, spelt in defaults.items():
        text = text.replace(f'"{name}": {spelt.partition(" =")[0]}"', f'"{name}": {spelt}')
    law.write_text(text)
    config = craft.config()
    for name in defaults:
        del config["instances"]["law"]["parameters"][name]
    machine.write_text(json.dumps(config, indent=2))
    params = craft.file(tmp_path, HEAD + "    law.gain: 2.5\n    law.narrow: 0.1\n")
    with AlgTwin.from_config(machine, parameters=params) as twin:
        bound = twin._save()
    done = adopt(params, machine)
    assert done.returncode == 0 and "law.gain: default -> 2.5" in done.stdout, done.stderr
    with AlgTwin.from_config(machine) as twin:
        assert twin._save() == bound
    added = {"gain": 2.5, "narrow": 0.1}
    assert (
        json.loads(machine.read_text())["instances"]["law"]["parameters"]
        == config["instances"]["law"]["parameters"] | added
    )
    assert '      "shape": 0.25,\n        "' in machine.read_text() or '"shape": 0.25,\n' in machine.read_text()


@pytest.mark.parametrize(
    ("change", "file", "said"),
    [
        (None, "    law.gian: 1.0\n", "did you mean `law.gain`?"),
        (None, "    law.shape: 1.0\n", "`law.shape` is frozen"),
        ("expression", "    law.gain: 2.0\n", '`law.gain` comes from "G"'),
    ],
)
def test_what_is_refused(change: str | None, file: str, said: str, tmp_path: Path) -> None:
    machine = craft.write(tmp_path)
    if change is not None:
        config = craft.config(gain="G")
        machine.write_text(json.dumps({**config, "constants": {"G": 1.0}}))
    before = machine.read_bytes()
    done = adopt(craft.file(tmp_path, HEAD + file), machine)
    assert done.returncode == 2 and said in done.stderr and "Traceback" not in done.stderr, done.stderr
    assert machine.read_bytes() == before


def test_instances_of_parts_are_refused(tmp_path: Path) -> None:
    whole = {
        "tick_hz": 100,
        "initial_state": "RUN",
        "algorithms": {"Law": {"source": "law.py"}},
        "instances": {
            "law": {"algorithm": "Law", "parameters": craft.PARAMETERS},
            "inner": {"machine": "part/tuned.json"},
        },
        "states": {"RUN": {"schedule": {"law": 100, "inner": True}}},
        "structs": craft.CONFIG["structs"],
        "requests": ["GO", "STOP"],
    }
    part = craft.write(tmp_path / "part")
    craft.write(tmp_path)
    config = craft.config()
    del config["states"]["END"], config["transitions"], config["requests"]
    part.write_text(json.dumps(config))
    machine = tmp_path / "whole.json"
    machine.write_text(json.dumps(whole))
    before = machine.read_bytes()
    done = adopt(craft.file(tmp_path, HEAD + "    law.gain: 4.0\n    inner.law.gain: 2.0\n"), machine)
    assert done.returncode == 2 and "`inner.law` is an instance of a part" in done.stderr, done.stderr
    assert machine.read_bytes() == before

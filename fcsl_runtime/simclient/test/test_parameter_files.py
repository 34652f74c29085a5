# SPDX-License-Identifier: Apache-2.0
"""A machine begins with the parameters of a file: the same as one that was compiled with these values, in every host."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tuned_craft as craft
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from native import flying

from simclient import AlgTwin, ProcessTwin, PyTwin, Twin, TwinError
from simclient.bag import columns
from simclient.bag.digest import digest
from simclient.library import runtime_program
from simclient.replay import replay
from simclient.vars.client import VarClient

HEAD = "/**:\n  ros__parameters:\n"


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return craft.write(tmp_path_factory.mktemp("compiled"))


@pytest.fixture(scope="module")
def edited(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same machine, of which a user has edited the JSON."""
    return craft.write(tmp_path_factory.mktemp("edited"), **craft.CHANGED)


def flown(twin: Twin) -> list[bytes]:
    """The struct at the beginning and after some ticks."""
    found = [twin._save()]
    for tick in range(3):
        twin.set("law.inputs.x", 0.5 + tick)
        twin.tick(4)
        found.append(twin._save())
    return found


@pytest.mark.parametrize("kind", [AlgTwin, PyTwin, ProcessTwin])
def test_begins_as_one_compiled_with_these_values(
    kind: type[Twin], machine: Path, edited: Path, tmp_path: Path
) -> None:
    with AlgTwin.from_config(edited) as twin:
        expected = flown(twin)
    with AlgTwin.from_config(machine) as twin:
        assert flown(twin)[0] != expected[0]
    with kind.from_config(machine, parameters=craft.file(tmp_path)) as twin:
        assert twin.get_value("law.state.begun") == 3.0 * 2.0 + 1.5 - 4.0 + 0.5  # start() has read them
        assert flown(twin) == expected


def test_values_by_name(machine: Path, edited: Path) -> None:
    values: dict[str, Any] = {
        **{f"law.{name}": craft.CHANGED[name] for name in ("gain", "narrow", "steps", "large", "on", "masks")},
        "law.table": np.array(craft.CHANGED["table"]),
        "law": {"least": "failed", "on_done": "tr_GO", "loop": {"kp": np.float64(1.5), "ki": 0.25}},
        "law.targets": {"0": {"kp": -2}, "1": {"ki": 0.5}},
    }
    with AlgTwin.from_config(edited) as twin:
        expected = flown(twin)
    with AlgTwin.from_config(machine, parameters=values) as twin:
        assert flown(twin) == expected


def fc(library: Path, *options: str | Path) -> subprocess.CompletedProcess[str]:
    line = [runtime_program("fcsl-fc"), library, "--rate", "max", *options]
    return subprocess.run(list(map(str, line)), capture_output=True, text=True, timeout=120)


@pytest.fixture(scope="module")
def library(machine: Path) -> Path:
    from simclient.machine_build import build_config

    return build_config(machine)[0]


def test_flight_program_records_and_replays(machine: Path, library: Path, edited: Path, tmp_path: Path) -> None:
    bag = tmp_path / "flight"
    done = fc(library, "--ticks", "20", "--parameters", craft.file(tmp_path), "--record", bag)
    assert done.returncode == 0, done.stderr
    assert replay(bag, library=library).identical
    with AlgTwin.from_config(edited) as twin:
        twin.record(tmp_path / "edited")
        twin.tick(20)
        twin.stop_recording()
    assert digest(bag) == digest(tmp_path / "edited")


def test_sections_for_other_nodes(library: Path, tmp_path: Path) -> None:
    with AlgTwin.from_library(library, parameters=craft.file(tmp_path)) as twin:
        assert twin.get_value("law.parameters.gain") == 3.0
    bag, options = tmp_path / "flight", ("--namespace", "quad1", "--record-fields", "*.parameters.*")
    done = fc(library, "--ticks", "1", "--parameters", craft.file(tmp_path), "--record", bag, *options)
    assert done.returncode == 0, done.stderr
    assert columns(bag, "law.parameters.gain")[1].tolist() == [0.0]


#: What a file says below HEAD, the line of the error, and its text.
WRONG = {
    "nearest": ("    law.gian: 1.0\n", 3, "machine `tuned` has no parameter `law.gian`; did you mean `law.gain`?"),
    "without_instance": ("    gain: 1.0\n", 3, "no parameter `gain`; did you mean `law.gain`?"),
    "as_the_server": ("    law.parameters.gain: 1.0\n", 3, "did you mean `law.gain`?"),
    "of_nobody": ("    zebra.crossing: 1.0\n", 3, "machine `tuned` has no parameter `zebra.crossing`"),
    "range": ("    law:\n      gain: 11.0\n", 4, "`law.gain` lies in [0, 10]"),
    "unit": ("    law.gain: 1.0  # [N/deg]\n", 3, "`law.gain` is in N/rad, but the comment says [N/deg]"),
    "no_unit": ("    law.steps: 1  # [m]\n", 3, "`law.steps` has no unit, but the comment says [m]"),
    "float": ("    law.steps: 1.5\n", 3, "`law.steps`: expected an integer, without point or exponent"),
    "too_large": ("    law.large: 18446744073709551616\n", 3, "`law.large`: out of the range of u64"),
    "too_large_f32": ("    law.narrow: 1e39\n", 3, "`law.narrow`: out of the range of f32"),
    "octal": ("    law.steps: 03\n", 3, "`law.steps`: a whole number does not begin with 0"),
    "nan": ("    law.narrow: .nan\n", 3, "`law.narrow`: expected a finite number"),
    "hex": ("    law.large: 0x10\n", 3, "`law.large`: expected an integer"),
    "string": ('    law.gain: "1.0"\n', 3, "`law.gain`: expected a finite number"),
    "bool": ("    law.on: yes\n", 3, "`law.on`: expected true or false"),
    "enumerator": ("    law.least: bad\n", 3, "`law.least`: no such enumerator"),
    "list": ("    law.gain: [1.0]\n", 3, "`law.gain`: expected one value, not a list"),
    "scalar": ("    law.masks: true\n", 3, "`law.masks`: expected a list"),
    "short": ("    law.table: [1, 2, 3, 4, 5]\n", 3, "`law.table`: expected lists nested as its shape"),
    "long": ("    law.table: [1, 2, 3, 4, 5, 6, 7]\n", 3, "`law.table`: too many values"),
    "turned": ("    law.table: [[1, 2], [3, 4], [5, 6]]\n", 3, "`law.table`: expected lists nested as its shape"),
    "frozen": ("    law.shape: 1.0\n", 3, "`law.shape` is frozen: the compiler folded its value into the code"),
    "twice": ("    law.gain: 1.0\n    law:\n      gain: 2.0\n", 5, "`law.gain` is given twice, first in line 3"),
    "no_value": ("    law.gain:\n    law.steps: 1\n", 3, "`law.gain` has no value"),
    "tab": ("\tlaw.gain: 1.0\n", 3, "a line is indented by a tab"),
    "indentation": ("    law.gain: 1.0\n   law.steps: 1\n", 4, "the indentation fits no line above"),
    "deeper": ("    law.gain: 1.0\n      law.steps: 1\n", 4, "the indentation fits no line above"),
    "block_list": ("    law.masks:\n      - true\n      - false\n", 4, "a list is written in brackets"),
    "alias": ("    law.gain: *one\n", 3, "a value or name begins with `*`"),
    "open_list": ("    law.masks: [true, false\n", 4, "expected `,` or `]` in a list"),
    "open_braces": ("    law: {gain: 1.0\n", 4, "expected `,` or `}` in a mapping"),
    "open_string": ('    law.least: "failed\n', 3, "a string does not end on its line"),
    "rest": ("    law.gain: 1.0 : 2\n", 3, "expected the end of the line behind a value"),
    "zero": ("    law.gain: 1.0\0\n", 1, "there is a zero byte: this is no text"),
    "deep": ("    a: " + "{a: " * 40 + "\n", 3, "lists and mappings lie too deep inside each other"),
    "deep_list": ("    law.masks: " + "[" * 40 + "\n", 3, "lists and mappings lie too deep inside each other"),
    "long_name": (f"    {'a' * 600}: 1\n", 3, "a name is too long"),
    "steers_a_terminal": ("    law.\x1b[31m: 1\n", 3, "has no parameter `law.?[31m`"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong(name: str, library: Path, tmp_path: Path) -> None:
    text, line, said = WRONG[name]
    path = craft.file(tmp_path, HEAD + text)
    with pytest.raises(TwinError) as caught:
        AlgTwin.from_library(library, parameters=path)
    assert f"params.yaml:{line}: " in str(caught.value)
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "no `ros__parameters:` in it"),
        ("# nothing\n---\n", "no `ros__parameters:` in it"),
        ("law.gain: 1.0\n", "`law.gain` has a value outside of `ros__parameters:`"),
        ("/other:\n  ros__parameters:\n    law.gain: 1.0\n", "no section is for `/tuned`; the first is for `/other`"),
    ],
)
def test_no_section(text: str, said: str, library: Path, tmp_path: Path) -> None:
    with pytest.raises(TwinError, match=said.replace("*", r"\*")):
        AlgTwin.from_library(library, parameters=craft.file(tmp_path, text))


def test_flight_program_refuses(library: Path, tmp_path: Path) -> None:
    path = craft.file(tmp_path, HEAD + "    law.gian: 1.0\n")
    done = fc(library, "--ticks", "1", "--parameters", path)
    assert done.returncode == 1 and "params.yaml:3: " in done.stderr and "did you mean `law.gain`?" in done.stderr
    done = fc(library, "--ticks", "1", "--parameters", tmp_path / "none.yaml")
    assert done.returncode == 2 and "none.yaml: No such file" in done.stderr
    done = fc(library, "--ticks", "1", "--parameters", tmp_path)
    assert done.returncode == 1 and "not a regular file" in done.stderr


def test_wrong_arguments_of_twins(machine: Path, tmp_path: Path) -> None:
    for wrong, said in (
        (3, "the path of a parameter file, or a mapping from names to values, wanted"),
        ({"law.gain": object()}, "is no value of a parameter"),
        ({"law.gain": float("nan")}, "^`law.gain`: expected a finite number"),
        (tmp_path / "none.yaml", "no such parameter file"),
        (tmp_path, "Is a directory"),
    ):
        with pytest.raises(TwinError, match=said):
            AlgTwin.from_config(machine, parameters=wrong)  # type: ignore[arg-type]


# ---- save and load on a running machine --------------------------------------------------------------------------------


def var(*words: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["fcsl", "var", *map(str, words)], capture_output=True, text=True, timeout=60)


@contextmanager
def serving(library: Path, folder: Path, *options: str | Path) -> Iterator[VarClient]:
    """A paused flight program with its variable server."""
    socket = folder / "fc.sock"
    with flying("--socket", socket, "--paused", *options, library=str(library)) as program:
        program.client(socket).close()
        with VarClient(socket) as client:
            yield client


def test_gains_tuned_in_flight_are_kept(library: Path, tmp_path: Path) -> None:
    """Loaded all at once, saved, and flown with again: the beginning is the same."""
    tuned, other = tmp_path / "tuned.yaml", tmp_path / "again.yaml"
    with serving(library, tmp_path) as client:
        address = client.address
        assert var("--socket", address, "save-parameters", tuned).stdout.startswith("0 parameters differ")
        assert AlgTwin.from_library(library, parameters=tuned).get_value("law.parameters.gain") == 1.0
        refused = var(
            "--socket", address, "load-parameters", craft.file(tmp_path, HEAD + "    law.on: false\n    law.gain: 11\n")
        )
        assert refused.returncode == 1 and "params.yaml:4: `law.gain` lies in [0, 10]" in refused.stderr
        assert client.get_value("law.parameters.on") is True
        loaded = var("--socket", address, "load-parameters", craft.file(tmp_path))
        assert loaded.returncode == 0, loaded.stderr
        exists = var("--socket", address, "save-parameters", tuned)
        assert exists.returncode == 1 and "say --overwrite" in exists.stderr
        saved = var("--socket", address, "save-parameters", tuned, "--overwrite")
        assert saved.stdout == f"13 parameters differ from the compiled values: {tuned}\n", saved.stderr
        values = client.get("law.parameters")["law.parameters"]
    assert "    law.gain: 3.0  # [N/rad]\n" in tuned.read_text()
    assert '    law.on_done: "tr_GO"\n' in tuned.read_text()
    with serving(library, tmp_path, "--parameters", tuned) as client:
        assert client.get("law.parameters")["law.parameters"] == values
        assert var("--socket", client.address, "save-parameters", other).returncode == 0
    assert other.read_text() == tuned.read_text()


@given(
    st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=6, max_size=6),
    st.floats(width=32, allow_nan=False, allow_infinity=False),
)
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_saved_floats_come_back_bit_for_bit(library: Path, tuner: VarClient, table: list[float], narrow: float) -> None:
    tuner.set({"law.parameters.table": [table[:3], table[3:]], "law.parameters.narrow": narrow})
    text = tuner.parameters()
    held = tuner.save()
    tuner.set({"law.parameters.table": [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], "law.parameters.narrow": 0.5})
    tuner.set_parameters(text)
    assert tuner.save() == held
    read = yaml.safe_load(text)["/**"]["ros__parameters"]
    assert read.get("law.table", [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]) == table
    assert all(type(value) is float for value in read.get("law.table", ()))


@pytest.fixture(scope="module")
def tuner(library: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[VarClient]:
    with serving(library, tmp_path_factory.mktemp("served")) as client:
        yield client

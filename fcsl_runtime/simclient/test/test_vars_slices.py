# SPDX-License-Identifier: Apache-2.0
"""Slices through arrays of structs: every bracket means what NumPy makes of it on the axes of the name before it."""

from __future__ import annotations

import itertools
import math
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from native import Client, flying
from test_vars import brackets, numpy_part

CONFIG = Path(__file__).resolve().parents[3] / "fcsl_compiler/test/golden/values.json"
#: Name of the array, its shape, a field of each struct and that field's shape.
ARRAYS = [
    ("nav.inputs.targets", (3,), "pose.position", (3,)),
    ("nav.inputs.targets", (3,), "weight", ()),
    ("nav.state.history", (2, 2), "pose.attitude", (4,)),
    ("nav.state.history", (2, 2), "weight", ()),
]


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    folder = tmp_path_factory.mktemp("values")
    command = [sys.executable, "-m", "fcsl_compiler.cli.main", "build", str(CONFIG), "-o", str(folder)]
    subprocess.run(command, check=True, capture_output=True, timeout=120)
    (library,) = folder.glob("*.so")
    with flying("--socket", folder / "s", "--paused", library=str(library)) as fc:
        opened = fc.client(folder / "s")
        for name, shape, field, inner in ARRAYS:
            for n, path in enumerate(leaves(name, shape, field)):
                opened.set(path, (np.arange(math.prod(inner)).reshape(inner) + 100.0 * n).tolist())
        yield opened
        opened.close()
        assert fc.stop()[0] == 0


def leaves(name: str, shape: tuple[int, ...], field: str) -> list[str]:
    return [f"{name}{''.join(f'[{i}]' for i in index)}.{field}" for index in itertools.product(*map(range, shape))]


def whole(client: Client, array: tuple[str, tuple[int, ...], str, tuple[int, ...]]) -> np.ndarray[Any, Any]:
    """A row for each struct: its field's scalars."""
    name, shape, field, _ = array
    paths = leaves(name, shape, field)
    values = client.ok("get", paths=paths)["values"]
    return np.array([np.ravel(values[path]) for path in paths])


def chosen(
    array: tuple[str, tuple[int, ...], str, tuple[int, ...]], outer: str, inner: str
) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Numbers of the structs and of the scalars in each, in NumPy's shapes. Raises IndexError."""
    _, shape, _, field = array
    structs, scalars = np.arange(math.prod(shape)).reshape(shape), np.arange(math.prod(field)).reshape(field)
    return np.asarray(numpy_part(structs, outer)), np.asarray(numpy_part(scalars, inner) if inner else scalars)


@settings(max_examples=150)
@given(array=st.sampled_from(ARRAYS), outer=brackets.filter(bool), inner=brackets, data=st.data())
def test_slices_are_numpys(client: Client, array: Any, outer: str, inner: str, data: st.DataObject) -> None:
    path = f"{array[0]}{outer}.{array[2]}{inner}"
    try:
        structs, scalars = chosen(array, outer, inner)
    except IndexError:
        assert client.error("get", paths=[path])["code"] == "bad_index"
        return
    before = whole(client, array)
    shape = structs.shape + scalars.shape
    assert client.get(path) == before[np.ix_(structs.ravel(), scalars.ravel())].reshape(shape).tolist()
    assume(len(np.unique(structs)) == structs.size and len(np.unique(scalars)) == scalars.size)
    count = structs.size * scalars.size
    values = data.draw(st.lists(st.integers(-1000, 1000), min_size=count, max_size=count))
    client.set(path, np.array(values, dtype=float).reshape(shape).tolist())
    before[np.ix_(structs.ravel(), scalars.ravel())] = np.array(values, dtype=float).reshape(structs.size, scalars.size)
    assert np.array_equal(whole(client, array), before)


def test_everywhere_a_path_may_stand(client: Client) -> None:
    client.set("nav.inputs.targets[:].weight", [1.0, 2.0, 3.0])
    assert client.ok("eval", expression="nav.inputs.targets[-1].weight + nav.inputs.targets[1].weight")["value"] == 5.0
    assert client.ok("subscribe", paths=["nav.inputs.targets[::-1].weight"])["subscription"] == 1
    client.send(b'{"cmd":"tick"}\n')
    sample, reply = client.read(), client.read()
    assert sample["values"] == {"nav.inputs.targets[::-1].weight": [3.0, 2.0, 1.0]} and reply["ok"]
    client.ok("unsubscribe", subscription=1)
    error = client.error("set", values={"nav.inputs.targets[0:2].weight": [1.0, 2.0, 3.0]})
    assert error["code"] == "bad_value" and "f64[2]" in error["message"]
    for path in ("nav.inputs.targets[0:2].wight", "nav.inputs.tragets[0:2].weight", "nav.inputs.targets[0:2]"):
        assert client.error("get", paths=[path])["code"] in ("unknown_path", "bad_index"), path


@pytest.mark.parametrize(
    ("path", "plain"),
    [
        ("nav.inputs.targets[-1]", "nav.inputs.targets[2]"),
        ("nav.inputs.targets[-1].pose", "nav.inputs.targets[2].pose"),
        ("nav.state.history[1,0]", "nav.state.history[1][0]"),
        ("nav.state.history[-1][-2]", "nav.state.history[1][0]"),
        ("nav.state.history[-2,1].pose", "nav.state.history[0][1].pose"),
        ("nav.state.history[-1]", "nav.state.history[1]"),
    ],
)
def test_a_struct_of_an_array_is_named_as_its_fields_are(client: Client, path: str, plain: str) -> None:
    value = client.get(plain)
    assert isinstance(value, dict) and client.get(path) == value


@pytest.mark.parametrize(
    "path",
    [
        "nav.inputs.targets[-4]",
        "nav.inputs.targets[3]",
        "nav.inputs.targets[1:]",
        "nav.inputs.targets[-1].pos",
        "nav.inputs.targets[-1,0]",
        "nav.inputs.targets[-1][0]",
        "nav.state.history[-1].pose",
        "nav.state.history[-1,]",
        "nav.state.history[]",
    ],
)
def test_what_is_no_struct_of_an_array(client: Client, path: str) -> None:
    assert client.error("get", paths=[path])["code"] == "unknown_path"


def test_what_an_index_is_outside_of_is_said(client: Client) -> None:
    error = client.error("get", paths=["nav.inputs.targets[3].weight"])
    assert error["code"] == "bad_index" and error["message"].endswith("does not name a part of f64[3]")
    error = client.error("get", paths=["nav.state.history[0,2].pose.attitude[0]"])
    assert error["message"].endswith("does not name a part of f64[2][2][4]")


def test_the_element_that_is_named_is_described(client: Client) -> None:
    for path, described in (
        ("nav.inputs.targets[-1].weight", "nav.inputs.targets[2].weight"),
        ("nav.state.history[1,0].pose.attitude[2]", "nav.state.history[1][0].pose.attitude"),
        ("nav.inputs.targets[1:].weight", "nav.inputs.targets[1].weight"),
    ):
        assert client.ok("describe", path=path)["path"] == described

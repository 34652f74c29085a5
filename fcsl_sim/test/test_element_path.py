# SPDX-License-Identifier: Apache-2.0
"""Paths of values and of their parts. test_set_argument.py has `--set`, `sets` and studies read them alike."""

from __future__ import annotations

import numpy as np
import pytest

from fcsl_sim.element_path import row_major_index, split_path


@pytest.mark.parametrize(
    ("path", "parts"),
    [
        ("wind.parameters.height", ("wind.parameters.height", ())),
        ("wind.parameters.height[10]", ("wind.parameters.height", (10,))),
        ("body.inputs.inertia[0][2]", ("body.inputs.inertia", (0, 2))),
        ("nav.state.targets[1].position[2]", ("nav.state.targets[1].position", (2,))),
        ("wind.parameters.height[-1]", ("wind.parameters.height[-1]", ())),
        ("", ("", ())),
    ],
)
def test_a_path_is_a_field_and_an_index(path: str, parts: tuple[str, tuple[int, ...]]) -> None:
    assert split_path(path) == parts


def test_elements_are_counted_row_by_row() -> None:
    numbers = np.arange(24).reshape(2, 3, 4)
    for size in range(4):
        for index in np.ndindex(*numbers.shape[:size]):
            assert row_major_index(index, numbers.shape) == numbers[index].flat[0]
    for beyond in ((2,), (0, 3), (1, 2, 4), (0, 0, 0, 0)):
        assert row_major_index(beyond, numbers.shape) is None
    assert row_major_index((), ()) == 0 and row_major_index((0,), ()) is None

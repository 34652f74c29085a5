# SPDX-License-Identifier: Apache-2.0
"""The wire that docs/reference/transports.md names, over a pipe: a controller and a simulator meet over it."""

from __future__ import annotations

from pathlib import Path

from page_example import HAL, run_program


def test_the_example_of_the_page_carries_a_run(tmp_path: Path) -> None:
    assert "(../../fcsl_hal/test/own_wire/pipe_wire.c)" in (HAL.parent / "docs/reference/transports.md").read_text()
    run_program(HAL / "test/own_wire/pipe_wire.c", "PIPE_WIRE", HAL / "test/own_wire/main.c", tmp_path)

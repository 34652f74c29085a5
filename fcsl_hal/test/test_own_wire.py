# SPDX-License-Identifier: Apache-2.0
"""The wire of docs/reference/transports.md, over a pipe: a controller and a simulator meet over it."""

from __future__ import annotations

from pathlib import Path

from page_example import HAL, run_example


def test_the_example_of_the_page_carries_a_run(tmp_path: Path) -> None:
    run_example("reference/transports.md", "pipe_wire.c", "PIPE_WIRE", HAL / "test/own_wire/main.c", tmp_path)

# SPDX-License-Identifier: Apache-2.0
"""The HAL of docs/hardware/hal.md: a host runs a controller with it."""

from __future__ import annotations

from pathlib import Path

from page_example import HAL, run_example


def test_the_example_of_the_page_closes_the_loop(tmp_path: Path) -> None:
    run_example("hardware/hal.md", "loopback_hal.c", "LOOPBACK_HAL", HAL / "test/own_hal/main.c", tmp_path)

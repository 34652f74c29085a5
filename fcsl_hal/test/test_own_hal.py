# SPDX-License-Identifier: Apache-2.0
"""The example that docs/hardware/hal.md names, a HAL: a host runs a controller with it."""

from __future__ import annotations

from pathlib import Path

from page_example import HAL, run_program

OWN_HAL = HAL / "test/own_hal"


def test_the_example_of_the_page_closes_the_loop(tmp_path: Path) -> None:
    assert "fcsl_hal/test/own_hal/loopback_hal.c" in (HAL.parent / "docs/hardware/hal.md").read_text()
    run_program(OWN_HAL / "loopback_hal.c", "LOOPBACK_HAL", OWN_HAL / "main.c", tmp_path)

# SPDX-License-Identifier: Apache-2.0
"""Machines and plans of craft/: built on the host, read in the guest, whose root is the host's."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

_SOURCES = Path(__file__).resolve().parents[1] / "craft"
_MACHINES = ("craft", "listener", "panel")


@dataclass(frozen=True)
class Craft:
    folder: Path

    def library(self, machine: str) -> Path:
        return self.folder / f"lib{machine}.so"

    def plan(self, board: str) -> Path:
        return self.folder / f"{board}.plan"

    def build(self) -> None:
        """Raises CalledProcessError, with what fcslc said."""
        from fcsl_compiler.driver.cache import build_machine

        self.folder.mkdir(parents=True, exist_ok=True)
        for machine in _MACHINES:
            shutil.copyfile(build_machine(_SOURCES / f"{machine}.json", "simulation").library, self.library(machine))
        for board in _SOURCES.glob("*.board.json"):
            plan = self.plan(board.name.removesuffix(".board.json"))
            # Each board leaves out what it does not try: fcslc warns of that.
            subprocess.run(["fcslc", "board", board, "-o", plan], check=True, capture_output=True, text=True)

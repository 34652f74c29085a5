# SPDX-License-Identifier: Apache-2.0
"""A command of a tool that makes its options when the command line names it.

argparse would make those of all commands, which takes longer than the help of most tools needs for all else.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any, Self


class Command(argparse.ArgumentParser):
    """`fill` adds the options; `settings` are those of ArgumentParser. For `add_subparsers(parser_class=Command)`."""

    def __init__(self, *, fill: Callable[[argparse.ArgumentParser], object], **settings: Any):
        self._fill, self.settings = fill, settings

    def filled(self) -> Self:
        super().__init__(**self.settings)
        self._fill(self)
        return self

    def parse_known_args(self, *arguments: Any, **named: Any) -> Any:
        self.filled()
        return super().parse_known_args(*arguments, **named)

# SPDX-License-Identifier: Apache-2.0
"""Warns when a test writes connected inputs, which the next copy from their sources overwrites."""

from __future__ import annotations

import os
import re
import sys
import warnings
from collections.abc import Iterable
from pathlib import Path

from ..descriptor import Field
from ..errors import OverwrittenWarning
from ..paths import split_path

_PACKAGE = str(Path(__file__).parents[1]) + os.sep
#: Most inputs listed in one message.
_SHOWN = 3
_PORT = re.compile(r".+?\.inputs\.[^.\[]+")


def warn_overwritten(fields: Iterable[Field]) -> None:
    """One warning for these leaves of connected inputs, at the line that called this package."""
    connected = dict(map(_connection, fields))
    text = _one(*connected.popitem()) if len(connected) == 1 else _several(connected)
    warn(text)


def warn(text: str, package: str = _PACKAGE) -> None:
    """An OverwrittenWarning at the line that called this package, or `package`, a folder (with a separator behind)."""
    warnings.warn(text, OverwrittenWarning, stacklevel=_levels_inside(package) + 1)


def _connection(field: Field) -> tuple[str, str]:
    """Input and source of the connection that contains a leaf."""
    port = _PORT.match(field.path)
    target = port[0] if port else field.path
    return target, field.connected_from.removesuffix(field.path[len(target) :])


def _one(target: str, source: str) -> str:
    instance, feeder = split_path(target)[0], split_path(source)[0] or source.partition(".")[0]
    text = f"{target} is connected from {source}, which is copied over it when `{instance}` next runs"
    if feeder in ("machine", "the machine", "channels"):
        return text
    alone = (
        f', or open `{instance}` without `{feeder}`: from_instances(…, ["{instance}"])' if feeder != instance else ""
    )
    return f"{text}; set {source}{alone}"


def _several(connected: dict[str, str]) -> str:
    shown = [f"{target} (from {source})" for target, source in connected.items()]
    more = [f"{len(shown) - _SHOWN} more"] if len(shown) > _SHOWN else []
    return (
        f"{', '.join(shown[:_SHOWN] + more)} are connected, and their sources are copied over them when their instances "
        "next run; set the sources, or open the instances without them: from_instances(…)"
    )


def _levels_inside(package: str) -> int:
    """Stack frames up to the first one outside of these packages, whose line the warning shows."""
    inside = (_PACKAGE, package)
    frame, levels = sys._getframe(1), 1
    while frame.f_back is not None and frame.f_code.co_filename.startswith(inside):
        frame, levels = frame.f_back, levels + 1
    return levels - 1

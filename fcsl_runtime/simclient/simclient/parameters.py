# SPDX-License-Identifier: Apache-2.0
"""Parameters with which a machine begins: a parameter file (docs/reference/variables.md), or a mapping from the names of such a
file to values.

The runtime's C reads both, so that every host takes the same files and says the same of wrong ones.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from ctypes import POINTER, Structure, c_char_p, c_int, c_size_t
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Union

from .descriptor import Field
from .errors import TwinError

#: What may be given: a path, or values by name, "pilot.gain"; structs and arrays as mappings and lists.
Given = Union[str, Path, Mapping[str, Any], "Parameters"]


class CParameters(Structure):
    """fcsl_parameters_t"""

    _fields_ = [
        ("text", c_char_p),
        ("size", c_size_t),
        ("name", c_char_p),
        ("name_space", c_char_p),
        ("used", POINTER(c_int)),
    ]


@dataclass(frozen=True)
class Parameters:
    """The content of a parameter file; `name` is what errors call it, "" for one that no user has written."""

    text: bytes
    name: str

    def to_c(self, name_space: str = "") -> CParameters:
        name = self.name.encode("utf-8", "surrogateescape")
        return CParameters(self.text, len(self.text), name, name_space.encode(), None)


def parameter_name(field: Field) -> str:
    """As a parameter file has it: `pilot.parameters.targets[0].mass` is `pilot.targets.0.mass`."""
    name = field.path.replace(f"{field.instance}.parameters.", f"{field.instance}.", 1)
    return name.replace("[", ".").replace("]", "")


def read_parameters(given: Given | None) -> Parameters | None:
    """None where nothing is given. Raises TwinError for a file that cannot be read; what it says is checked when a machine is
    opened with it."""
    if given is None or isinstance(given, Parameters):
        return given
    if isinstance(given, Mapping):
        return Parameters(_text({"/**": {"ros__parameters": dict(given)}}).encode(), "")
    if not isinstance(given, str | Path):
        raise TwinError(
            f"parameters={given!r}: the path of a parameter file, or a mapping from names to values, wanted"
        )
    try:
        return Parameters(Path(given).read_bytes(), str(given))
    except OSError as error:
        raise TwinError(f"{given}: {error.strerror}") from None


def _text(values: Mapping[str, Any]) -> str:
    try:
        return json.dumps(values, default=_plain, ensure_ascii=False)
    except (TypeError, ValueError) as error:
        raise TwinError(f"parameters={values!r}: {error}") from None


def _plain(value: Any) -> Any:
    """A numpy array or scalar as Python has it; nothing else."""
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"{value!r} is no value of a parameter")

# SPDX-License-Identifier: Apache-2.0
"""`--set altimeter.parameters.sigma=0.8`, `--set wind.parameters.wind_north[2]=3`: values in place of the file's.

A path is one that a study may disperse (campaign/study.py), or a whole array, or a row of one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

from fcsl_compiler.api.diagnostics import DiagnosticSink, SourceFile, Span
from fcsl_compiler.api.json_files import ConfigReader, JsonNode, parse_json
from fcsl_compiler.api.types import scalar_of, shape_of

from .element_path import name_an_element, row_major_index, split_path
from .models import ModelField, type_of

_OPTION = "--set"
Value = bool | int | float | str
Old = TypeVar("Old")


@dataclass(frozen=True, eq=False)
class Setting:
    """`index` is empty where the whole field `path` is set."""

    path: str
    index: tuple[int, ...]
    span: Span
    value: JsonNode


class Settings:
    """Those of the command line; each is a text of its own in messages. One that was taken is gone."""

    def __init__(self, sets: Sequence[str], sink: DiagnosticSink):
        """E215: not of the form."""
        self._left: list[Setting] = []
        for text in sets:
            path, equals, value_text = text.partition("=")
            span = SourceFile(_OPTION, text).span(0, max(1, len(path)))
            if not equals:
                sink.error("E215", "not of the form `instance.parameters.name=value`", span)
                continue
            value = parse_json(SourceFile(f"{_OPTION} {path}", value_text), sink)
            if value:
                self._left.append(Setting(*split_path(path), span, value))

    def take_whole(self, path: str) -> Setting | None:
        """The last one of the field as a whole."""
        found = self._take([s for s in self._left if s.path == path and not s.index])
        return found[-1] if found else None

    def take_elements(self, path: str) -> list[Setting]:
        """Those of parts of the field, in their order."""
        return self._take([s for s in self._left if s.path == path and s.index])

    def left(self) -> Sequence[Setting]:
        """Those that nobody took."""
        return self._left

    def _take(self, found: list[Setting]) -> list[Setting]:
        self._left = [s for s in self._left if s not in found]
        return found


def with_elements(
    scalars: Sequence[Old], target: ModelField, settings: Sequence[Setting], reader: ConfigReader
) -> Sequence[Old | Value]:
    """The value of a field, row-major, with its parts replaced. E217: there is no such element."""
    shape = shape_of(target.type)
    changed: list[Old | Value] = list(scalars)
    for setting in settings:
        at = row_major_index(setting.index, shape)
        if at is None:
            fix = name_an_element(setting.path, shape)
            reader.sink.error("E217", f"`{setting.path}` is {target.type}", setting.span, help=fix)
            continue
        what = f"{target.role} `{target.name}{''.join(f'[{i}]' for i in setting.index)}`"
        rest = shape[len(setting.index) :]
        part = reader.value(setting.value, type_of(scalar_of(target.type).name, rest), what)
        size = math.prod(rest)
        changed[at : at + size] = part or changed[at : at + size]
    return changed

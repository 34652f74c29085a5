# SPDX-License-Identifier: Apache-2.0
"""Requests of a machine as the algorithms of one part call them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any


class Requests:
    """`bound`: by part, what the whole machine calls the requests that the part lists. `seen`: the machine's requests in
    order, as the part `part` calls them."""

    def __init__(self, requests: Sequence[str], part: str, bound: Mapping[str, Mapping[str, str]]):
        self._part, self._bound = part, bound
        own = {whole: name for name, whole in bound[part].items()}
        taken = set(own.values())
        self._names = {name: own.get(name, f"{name} of the machine" if name in taken else name) for name in requests}
        self.seen = list(self._names.values())

    def name(self, text: str) -> str:
        """What the part calls a request that a value names. Texts of parts have a `part`."""
        whole = self._bound[getattr(text, "part", "")].get(text, text)
        return str(self._names.get(whole, whole))

    def defaults(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Values that a file of the part has."""
        return {key: _Text(value, self._part) if isinstance(value, str) else value for key, value in values.items()}


class _Text(str):
    part: str

    def __new__(cls, text: str, part: str) -> _Text:
        made = super().__new__(cls, text)
        made.part = part
        return made

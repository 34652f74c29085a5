# SPDX-License-Identifier: Apache-2.0
"""Words of the numbers in a machine's messages, as twins spell them: healths, and transition requests (tr_GO, or empty).

The recorder's definitions say which fields these are. A uint8 is a health. An int32 is a request if it is called
transition_request, or if its comment begins so; the constants `TR_…` of the same message name its values. Messages that
the recorder made for chosen fields have no constants, so their requests have no words.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from ..c_machine import HEALTH_NAMES
from .bag import Array

_SECTION = re.compile(r"^={80}\nMSG: \w+/(\w+)\n", re.MULTILINE)
_DECLARATION = re.compile(r"^([\w/]+)(?:\[\d+\])? (\w+)(?: # *(.*))?$", re.MULTILINE)
_REQUEST = re.compile(r"^int32 TR_(\w+)=(\d+)$", re.MULTILINE)
_IS_REQUEST = re.compile(r"TransitionRequest(;|$)")
_HEALTHS = dict(enumerate(HEALTH_NAMES))


class _Member(NamedTuple):
    type: str
    comment: str


class _Section:
    """The definition of one message."""

    def __init__(self, text: str):
        self.members = {name: _Member(kind, comment) for kind, name, comment in _DECLARATION.findall(text)}
        self._requests = {int(n): f"tr_{name}" if int(n) else "" for name, n in _REQUEST.findall(text)}

    def words(self, name: str) -> Mapping[int, str]:
        member = self.members.get(name)
        if member is None:
            return {}
        if member.type == "uint8":
            return _HEALTHS
        is_request = name == "transition_request" or _IS_REQUEST.match(member.comment)
        return self._requests if member.type == "int32" and is_request else {}


def words_of(schema: str, paths: Iterable[str]) -> dict[str, Mapping[int, str]]:
    """Number → word for those of the field paths that have words. `schema`: the definition of a machine's message."""
    first, *others = _SECTION.split(schema)
    whole = _Section(first)
    sections = {name: _Section(text) for name, text in zip(others[::2], others[1::2], strict=True)}
    found = {}
    for path in paths:
        *outer, last = (part.partition("[")[0] for part in path.split("."))
        section: _Section | None = whole
        for name in outer:
            member = section.members.get(name) if section else None
            section = sections.get(member.type.rpartition("/")[2]) if member else None
        if section and (words := section.words(last)):
            found[path] = words
    return found


def spelled(values: Array, words: Mapping[int, str]) -> Array:
    """The words of integers, of the same shape; a number without a word as its digits."""
    numbers, where = np.unique(values, return_inverse=True)
    texts = np.array([words.get(int(number), str(number)) for number in numbers], dtype=np.str_)
    spelled_out: Array = texts[where].reshape(values.shape)
    return spelled_out

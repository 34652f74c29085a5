# SPDX-License-Identifier: Apache-2.0
"""Where a model in C or C++ compares its time, as text: what it computes then may jump within a step of the integrator."""

from __future__ import annotations

import re

#: Comments, texts, characters, and arguments of templates.
_BLANK = re.compile(
    r"/\*.*?\*/|//[^\n]*|\"(?:\\.|[^\"\\\n])*\"|'(?:\\.|[^'\\\n])*'|<(?=\S)[\w:,\s*&]*(?<=\S)>", re.DOTALL
)
#: Functions that take no part in steps, up to their bodies.
_OTHERS = re.compile(r"\b(?:init|update|reset|next_time)\s*\([^(){};]*\)[\w\s]*\{")
#: What the functions of steps call their time.
_TIME = re.compile(r"\b(?:derivative|output|event)\s*\((?:[^(){};]*?,)?\s*(?:const\s+)?double\s+(\w+)\s*[,)]")
#: What ends a comparison.
_END = re.compile(r"[;{}?:]|&&|\|\||(?<![<>=!])=(?!=)")
_COMPARES = re.compile(r"(?<![<-])<=?(?!<)|(?<![->])>=?(?!>)|[=!]=")
#: Functions that jump.
_STEPS = "fmod|floor|ceil|trunc|round|remainder|copysign"


def time_comparison(text: str) -> int | None:
    """The line of the first comparison, 1 …, or None."""
    code = _without_others(_BLANK.sub(_blank, text))
    names = sorted(set(_TIME.findall(code)))
    if not names:
        return None
    time = re.compile(rf"(?<![\w.>])(?:{'|'.join(names)})\b(?!\s*\()")
    jumps = re.compile(rf"\b(?:{_STEPS})\s*\([^;]*?{time.pattern}")
    begin = 0
    for end in [*(found.start() for found in _END.finditer(code)), len(code)]:
        part = code[begin:end]
        places = [found.start() for found in jumps.finditer(part)]
        places += [found.start() for found in _COMPARES.finditer(part) if time.search(_operands(part, found))]
        if places:
            return code.count("\n", 0, begin + min(places)) + 1
        begin = end
    return None


def _operands(part: str, comparison: re.Match[str]) -> str:
    """What is compared: to both sides as far as parentheses are closed."""
    left, right = part[: comparison.start()], part[comparison.end() :]
    return f"{_closed(left[::-1], ')', '(')[::-1]} {_closed(right, '(', ')')}"


def _closed(text: str, opens: str, closes: str) -> str:
    depth = 0
    for place, c in enumerate(text):
        depth += (c == opens) - (c == closes)
        if depth < 0 or (depth == 0 and c == ","):
            return text[:place]
    return text


def _blank(found: re.Match[str]) -> str:
    return re.sub(r"[^\n]", " ", found[0])


def _without_others(code: str) -> str:
    for found in reversed(list(_OTHERS.finditer(code))):
        end, depth = found.end(), 1
        while depth and end < len(code):
            depth += {"{": 1, "}": -1}.get(code[end], 0)
            end += 1
        body = re.sub(r"[^\n]", " ", code[found.end() : end])
        code = code[: found.end()] + body + code[end:]
    return code

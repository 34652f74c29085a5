# SPDX-License-Identifier: Apache-2.0
"""Units as users write them, `m/s2`, `kg*m^2`, `m/s²`, `N m`, compared by what they are made of: `m/s` times `s` is `m`.

A unit that is not written so is one of its own. None: any unit, as a number without one has.
"""

from __future__ import annotations

import re
from fractions import Fraction
from functools import cache

#: Powers of base units, by name.
Unit = tuple[tuple[str, Fraction], ...]

#: In SI, where a radian is 1 (BIPM, The International System of Units, 9th edition, table 4).
_DERIVED = {
    **{"rad": "1", "sr": "1", "Hz": "1/s", "N": "kg m/s2", "Pa": "kg/m/s2", "J": "kg m2/s2", "W": "kg m2/s3"},
    **{"C": "A s", "V": "kg m2/s3/A", "Ω": "kg m2/s3/A2", "Ohm": "kg m2/s3/A2", "T": "kg/s2/A", "H": "kg m2/s2/A2"},
}
_FACTOR = re.compile(r"\s*([*/·.]?)\s*(?:(1)|([^\W\d]+|[%°]\w*)(?:(?:\^|\*\*)?(-?\d+))?)")


_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")


@cache
def read(text: str) -> Unit | None:
    """None without a text."""
    text = text.translate(_SUPERSCRIPTS)
    if not text.strip():
        return None
    powers: dict[str, Fraction] = {}
    at = 0
    while at < len(text.rstrip()):
        found = _FACTOR.match(text, at)
        if found is None:
            return ((text.strip(), Fraction(1)),)
        at = found.end()
        sign = -1 if found[1] == "/" else 1
        if found[3]:
            _add(powers, found[3], Fraction(sign * int(found[4] or 1)))
    return _unit(powers)


def _add(powers: dict[str, Fraction], name: str, power: Fraction) -> None:
    derived = read(_DERIVED[name]) if name in _DERIVED else ((name, Fraction(1)),)
    for base, times in derived or ():
        powers[base] = powers.get(base, Fraction(0)) + times * power


def _unit(powers: dict[str, Fraction]) -> Unit:
    return tuple(sorted((name, power) for name, power in powers.items() if power))


def product(a: Unit | None, b: Unit | None, power: int = 1) -> Unit | None:
    """Of a and b to this power. A number without a unit may convert one, so the product has any."""
    if a is None or b is None:
        return None
    powers = dict(a)
    for name, own in b:
        powers[name] = powers.get(name, Fraction(0)) + own * power
    return _unit(powers)


def power(unit: Unit | None, exponent: Fraction) -> Unit | None:
    return None if unit is None else tuple((name, own * exponent) for name, own in unit if own * exponent)


def text(unit: Unit) -> str:
    """`kg m2/s2`; `1` without base units."""
    above = " ".join(_factor(name, own) for name, own in unit if own > 0)
    below = "".join("/" + _factor(name, -own) for name, own in unit if own < 0)
    return (above or "1") + below


def _factor(name: str, own: Fraction) -> str:
    return name if own == 1 else f"{name}^({own})" if own.denominator > 1 else f"{name}{own}"

# SPDX-License-Identifier: Apache-2.0
"""Expressions over fields: units, kinds and shapes. Their values are compared with the server's in C by simclient's test_vars.py."""

from __future__ import annotations

import ast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fcsl_compiler.api.expressions import SCALARS, ExpressionError, Kind, Quantity, evaluator, parse, read_unit
from fcsl_compiler.expression import units

FIELDS = {
    "nav.height": Quantity(Kind.FLOAT, unit=read_unit("m")),
    "nav.speed": Quantity(Kind.FLOAT, unit=read_unit("m/s")),
    "nav.velocity": Quantity(Kind.FLOAT, (3,), read_unit("m s^-1")),
    "nav.place": Quantity(Kind.FLOAT, (2,), read_unit("m")),
    "nav.pitch": Quantity(Kind.FLOAT, unit=read_unit("rad")),
    "nav.heading": Quantity(Kind.FLOAT, unit=read_unit("deg")),
    "nav.matrix": Quantity(Kind.FLOAT, (3, 3)),
    "motor.rate": Quantity(Kind.FLOAT, unit=read_unit("rad/s")),
    "motor.force": Quantity(Kind.FLOAT, unit=read_unit("N")),
    "body.mass": Quantity(Kind.FLOAT, unit=read_unit("kg")),
    "clock.time": Quantity(Kind.FLOAT, unit=read_unit("s")),
    "clock.count": Quantity(Kind.INTEGER),
    "raw.value": Quantity(Kind.FLOAT),
    "machine.state": Quantity(Kind.NAME, names=("RUN", "SAFE")),
    "motor.on": Quantity(Kind.BOOL),
}


def find(path: str) -> Quantity:
    if path not in FIELDS:
        raise ExpressionError(f"no field {path}")
    return FIELDS[path]


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("m/s", "m s^-1"),
        ("m/s", "m*s**-1"),
        ("m/s2", "m/s/s"),
        ("m/s²", "m s⁻²"),
        ("N", "kg*m/s^2"),
        ("N m", "J"),
        ("N·m", "W s"),
        ("rad/s", "Hz"),
        ("V/A", "Ohm"),
        ("1/s", "Hz"),
        ("rad", "1"),
        ("kg", " kg "),
    ],
)
def test_units_that_are_the_same(one: str, other: str) -> None:
    """SI's own definitions (BIPM, The International System of Units, table 4)."""
    assert read_unit(one) == read_unit(other) is not None


@pytest.mark.parametrize(
    ("one", "other"), [("m", "ft"), ("m/s", "m s"), ("deg", "rad"), ("N", "kg"), ("m (up)", "m"), ("%", "1")]
)
def test_units_that_differ(one: str, other: str) -> None:
    assert read_unit(one) != read_unit(other)


def test_no_unit_is_any_unit() -> None:
    assert read_unit("") is None and read_unit("  ") is None


@given(
    st.lists(
        st.tuples(st.sampled_from(["m", "s", "kg", "N", "J", "rad", "Hz"]), st.integers(-3, 3).filter(bool)),
        min_size=1,
        max_size=4,
    )
)
def test_a_unit_is_read_as_it_is_shown(factors: list[tuple[str, int]]) -> None:
    unit = read_unit(" ".join(f"{name}^{power}" for name, power in factors))
    assert unit is not None and read_unit(units.text(unit)) == unit


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("nav.height / clock.time", "m/s"),
        ("nav.speed * clock.time - nav.height", "m"),
        ("body.mass * nav.speed / clock.time + motor.force", "N"),
        ("sqrt(nav.height * nav.height)", "m"),
        ("nav.height ** 2", "m2"),
        ("norm(nav.velocity)", "m/s"),
        ("max(nav.speed, 3.0, norm(nav.velocity))", "m/s"),
        ("motor.rate * clock.time + nav.pitch", "1"),
        ("degrees(nav.pitch) - nav.heading", "deg"),
        ("abs(-nav.height) % nav.height", "m"),
        ("nav.height // nav.height", "1"),
        ("3.6 * nav.speed", ""),
        ("raw.value + nav.height", "m"),
    ],
)
def test_the_unit_of_a_value(text: str, unit: str) -> None:
    assert parse(text, find).quantity.unit == read_unit(unit)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "nav.height + clock.time",
            "`nav.height` is in m and `clock.time` in s: `+` needs one unit; convert one of them",
        ),
        ("nav.height < nav.speed", "`nav.height` is in m and `nav.speed` in m/s: a comparison needs one unit"),
        ("0 < nav.height < nav.speed", "a comparison needs one unit"),
        ("nav.pitch == nav.heading", "`nav.pitch` is in rad or 1 and `nav.heading` in deg"),
        ("max(nav.height, 1.0, nav.speed)", "`max` needs one unit"),
        ("nav.height in (1.0, nav.speed)", "a comparison needs one unit"),
        ("degrees(nav.height)", "`degrees` is of rad, and `nav.height` is in m"),
        ("norm(nav.velocity * clock.time - nav.place) > 1", "are vectors of different sizes"),
        ("norm(nav.height)", "`norm` is of a vector, and `nav.height` is a scalar"),
        ("nav.velocity == 1", "`nav.velocity` is a vector of 3: take one of its elements, or `norm`"),
        ("nav.velocity", "is a vector of 3"),
        ("nav.matrix", "`nav.matrix` is a matrix"),
        ("machine.state + 1", "`machine.state` is a name, not a number"),
        ("machine.state == 3", "`machine.state` is a name and `3` an integer: they cannot be compared"),
        ("machine.state == 'RNU'", "`machine.state` is never 'RNU': it is one of 'RUN', 'SAFE'; did you mean `RUN`?"),
        ("machine.state < 'SAFE'", "are names, which have no order"),
        ("'RUN' == 'RUN'", "are both constants"),
        ("'RUN'", "is a name by itself"),
        ("motor.on and 1", "`1` is an integer, neither True nor False"),
        ("not clock.count", "`clock.count` is an integer, neither True nor False; compare it: `clock.count == …`"),
        ("mean(nav.height)", "`mean` is of all ticks of a flight: only metrics of a campaign have it"),
        ("sine(nav.pitch)", "there is no function `sine`"),
        ("min(nav.height)", "`min` takes 2 to 8 values, not 1"),
        ("nav.hight", "no field nav.hight"),
        ("nav.height[0:2]", "`nav.height[0:2]`: an index is a whole number from 0 on"),
        ("nav.height[-1]", "an index is a whole number from 0 on"),
        ("nav.height[()]", "an index is a whole number from 0 on"),
        ("nav" + ".b" * 505, "no field nav.b.b"),
        ("nav.velocity [0] > 1", "is neither path"),
        ("nav.height > 1 # why", "an expression has no comment"),
        ("(" * 33 + "1" + ")" * 33, "nested too deeply"),
        ("1" * 1024, "more than 1023 bytes"),
        ("nav.height if motor.on else 0", "is neither path, number"),
        ("0x10", "write a number in decimal digits"),
        ("'a\\n' == machine.state", "a name in plain quotes"),
        ("9223372036854775808", "does not fit 64 bits"),
        ("1 +", "is no expression"),
        ("clock.count in machine.state", "is no list: `in` takes one"),
        ("0 < clock.count in (1, 2)", "write a chain with `in` as two comparisons"),
        ("+".join("1" * 257), "is too long: it has more than 256 values"),
        ("-" * 150 + "1", "nested too deeply"),
        ("~clock.count", "is neither path"),
        ("clock.count @ 2", "is neither path"),
        ("None", "is neither path"),
    ],
)
def test_what_is_refused(text: str, message: str) -> None:
    with pytest.raises(ExpressionError) as refused:
        parse(text, find)
    assert message in str(refused.value)


@given(
    st.text(st.characters(codec="utf-8"), max_size=40)
    | st.lists(st.sampled_from([*FIELDS, *"+-*/%<>=!()[],.'", "and", "or", "not", "in", "1", "2.5"]), max_size=12).map(
        " ".join
    )
)
def test_whatever_is_written_is_an_expression_or_refused(text: str) -> None:
    try:
        parse(text, find)
    except ExpressionError as error:
        assert str(error)


@pytest.mark.parametrize(
    "text",
    [
        "1 - 2 - 3",
        "2 ** 3 ** 0.5",
        "-2 ** 2",
        "7 // -2 * 2",
        "1 < 2 < 3 != 2",
        "not 1 > 2 and 2 > 1 or 1 > 2",
        "-7 % 3 - 7 // 2",
        "2 - -2",
        "2 in (1, 2) and 3 not in [1]",
    ],
)
def test_operators_bind_as_pythons(text: str) -> None:
    """Without fields an expression is one of Python's, whose value is known."""
    assert evaluator(parse(text, find), SCALARS)(lambda node: None) == eval(
        compile(ast.parse(text, mode="eval"), "", "eval")
    )

# SPDX-License-Identifier: Apache-2.0
"""Samples out of messages: conversions and their limits, sequences, definitions of a bag, what a pick cannot be."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from fcsl_compiler.base.diagnostics import DiagnosticSink
from fcsl_compiler.base.source import SourceFile, Span
from fcsl_compiler.config.ros import Mapped, check_mapped
from fcsl_compiler.model.machine import RosMapping
from fcsl_compiler.model.types import SCALARS
from fcsl_compiler.ros.composer import Source
from fcsl_compiler.ros.reader import Pick
from fcsl_compiler.ros.standard_messages import STANDARD
from simclient.errors import MapError
from simclient.ros.composer import Composer
from simclient.ros.reader import REASONS, Reader, Samples
from simclient.ros.types import definitions_of

STORE = get_typestore(Stores.ROS2_JAZZY)
OWN = {
    "acme_msgs/msg/Mixed": "uint8 a\nfloat64 b\nbool c\nint16[3] d\nuint8 e\nfloat32 f\nstring g\nuint8 h\nuint64 i\nint8 j\nint32 k\n",
    "acme_msgs/msg/Item": "uint8 kind\nstring label\nfloat64[3] at\n",
    "acme_msgs/msg/Group": "Item[] items\nItem[2] pair\nstring[] tags\nstring[2] marks\n",
    "acme_msgs/msg/Deep": "uint8 n\nGroup[] groups\nfloat64[4] q\nfloat32[3] v\nint64 last\n",
}
TYPES: dict[str, Any] = {}
for _name, _text in OWN.items():
    TYPES |= get_types_from_msg(_text, _name)
STORE.register(TYPES)
T = STORE.types
ALL = definitions_of(STORE.fielddefs)

LIMITS = {"i32": (-(2**31), 2**31 - 1), "u32": (0, 2**32 - 1), "i64": (-(2**63), 2**63 - 1), "u64": (0, 2**64 - 1)}
LIMITS["bool"] = (0, 1)
WIRE_LIMITS = {f"int{n}": (-(2 ** (n - 1)), 2 ** (n - 1) - 1) for n in (8, 16, 32, 64)}
WIRE_LIMITS |= {f"uint{n}": (0, 2**n - 1) for n in (8, 16, 32, 64)}


def cdr(message: Any, name: str) -> bytes:
    return bytes(STORE.serialize_cdr(message, name))


def read(name: str, data: bytes, *picks: Pick) -> Samples:
    return Reader(ALL, name, picks).read_many(data, [0], [len(data)])


def read_one(name: str, data: bytes, pick: Pick) -> tuple[Any, str]:
    samples = read(name, data, pick)
    return samples.values[pick.name][0].tolist(), REASONS[samples.status[0, 0]]


# ---- conversions --------------------------------------------------------------------------------------------------------


@settings(max_examples=400)
@given(st.data(), st.sampled_from(sorted(WIRE_LIMITS)), st.sampled_from([*LIMITS, "f32", "f64"]))
def test_integers(data: st.DataObject, wire: str, target: str) -> None:
    low, high = WIRE_LIMITS[wire]
    edges = [b + d for limits in LIMITS.values() for b in limits for d in (-1, 0, 1) if low <= b + d <= high]
    number = data.draw(st.integers(low, high) | st.sampled_from(edges))
    name = "std_msgs/msg/" + wire.replace("uint", "UInt").replace("int", "Int")
    value, reason = read_one(name, cdr(T[name](number), name), Pick("x", ("data",), target))
    if target == "f64":
        assert (value, reason) == (float(number), "taken")
    elif target == "f32":
        nearest = np.float32(np.int64(number) if number < 2**63 else np.uint64(number))
        assert (value, reason) == (float(nearest), "taken")
    elif LIMITS[target][0] <= number <= LIMITS[target][1]:
        assert (value, reason) == (number, "taken")
    else:
        assert (value, reason) == (0, "range")


FLOATS = st.floats(allow_nan=True) | st.sampled_from(
    [
        f(limit)
        for limits in LIMITS.values()
        for limit in limits
        for f in (float, lambda x: np.nextafter(float(x), np.inf))
    ]
    + [3.4028234663852886e38, 3.4028235677973362e38, 3.4028235677973366e38, -3.4028235677973366e38, 0.5, 1e-46]
)


@settings(max_examples=400)
@given(FLOATS, st.sampled_from([*LIMITS, "f32", "f64"]))
def test_floats(number: float, target: str) -> None:
    name = "std_msgs/msg/Float64"
    value, reason = read_one(name, cdr(T[name](number), name), Pick("x", ("data",), target))
    if math.isnan(number):
        assert (value, reason) == (0, "nan")
    elif target == "f64":
        assert (value, reason) == (number, "taken")
    elif target == "f32":
        with np.errstate(over="ignore"):
            nearest = float(np.float32(number))
        overflow = math.isinf(nearest) and not math.isinf(number)
        assert (value, reason) == ((0.0, "range") if overflow else (nearest, "taken"))
    elif math.isfinite(number) and number == int(number) and LIMITS[target][0] <= int(number) <= LIMITS[target][1]:
        assert (value, reason) == (int(number), "taken")
    else:
        assert (value, reason) == (0, "range")


@given(
    st.lists(st.floats(-1e6, 1e6), min_size=3, max_size=3),
    st.sampled_from([(), (2.5,), (1.0, -0.5, 3.0)]),
    st.sampled_from([(), (0.1,), (1.0, 2.0, -3.0)]),
    st.sampled_from(["", "frd"]),
)
def test_scale_and_offset_come_after_axes(
    v: list[float], scale: tuple[float, ...], offset: tuple[float, ...], axes: str
) -> None:
    name = "geometry_msgs/msg/Vector3"
    data = cdr(T[name](*v), name)
    value, reason = read_one(name, data, Pick("v", (".",), "f64", 3, axes=axes, scale=scale, offset=offset))
    turned = [v[0], -v[1], -v[2]] if axes else v
    if scale or offset:
        factors, biases = (scale or (1.0,)) * 3, (offset or (0.0,)) * 3
        turned = [x * factors[i] + biases[i] for i, x in enumerate(turned)]
    assert (value, reason) == (turned, "taken")


def test_a_bool_is_0_or_1() -> None:
    name = "std_msgs/msg/Bool"
    data = bytearray(cdr(T[name](True), name))
    assert read_one(name, bytes(data), Pick("b", ("data",), "bool")) == (True, "taken")
    assert read_one(name, bytes(data), Pick("b", ("data",), "i32")) == (1, "taken")
    data[4] = 2
    assert read_one(name, bytes(data), Pick("b", ("data",), "bool")) == (False, "range")


# ---- where numbers are ----------------------------------------------------------------------------------------------------


def deep(sizes: list[tuple[int, int]]) -> Any:
    """A message of groups with so many items and tags each."""
    item, group = T["acme_msgs/msg/Item"], T["acme_msgs/msg/Group"]

    def make(i: int) -> Any:
        return item(i, "x" * i, np.arange(3.0) + i)

    groups = [
        group([make(i) for i in range(n)], [make(7), make(8)], ["t" * j for j in range(tags)], ["", "mark"])
        for n, tags in sizes
    ]
    v, q = np.array([1.5, 2.5, 3.5], np.float32), np.array([0.5, 0.1, 0.2, 0.3])
    return T["acme_msgs/msg/Deep"](1, groups, q, v, -(2**60) - 1)


@pytest.mark.parametrize("sizes", [[(2, 0), (1, 3)], [(3, 1), (2, 2), (0, 0)], [(2, 5), (1, 0), (4, 4), (1, 1)]])
def test_walking_over_sequences_of_messages(sizes: list[tuple[int, int]]) -> None:
    name = "acme_msgs/msg/Deep"
    picks = [
        Pick("last", ("last",), "i64"),
        Pick("at", ("groups[0].items[1].at",), "f64", 3),
        Pick("kind", ("groups[1].pair[1].kind",), "u32"),
        Pick("v", ("v",), "f64", 3, axes="frd"),
        Pick("q", ("q",), "f64", 4, order="wxyz"),
        Pick("z", ("groups[0].items[0].at[2]", "q[1]"), "f64", 2),
    ]
    data = cdr(deep(sizes), name)
    samples = read(name, data, *picks)
    row = {column: samples.values[column][0].tolist() for column in samples.values.dtype.names}
    assert not samples.status.any()
    assert row["last"] == -(2**60) - 1 and row["at"] == [1.0, 2.0, 3.0] and row["kind"] == 8
    assert row["v"] == [1.5, -2.5, -3.5] and row["q"] == [0.5, 0.1, 0.2, 0.3] and row["z"] == [2.0, 0.1]
    for cut in range(0, len(data)):
        assert Reader(ALL, name, picks).read_many(data, [0], [cut]).status[0, 0] == REASONS.index("truncated")


def test_a_sequence_of_messages_that_is_too_short() -> None:
    name = "acme_msgs/msg/Deep"
    samples = read(
        name, cdr(deep([(1, 0)]), name), Pick("a", ("groups[0].items[1].kind",), "i32"), Pick("l", ("last",), "i64")
    )
    assert [REASONS[s] for s in samples.status[0]] == ["shape", "shape"]  # the walk ends there


def test_blocks_of_many_sizes() -> None:
    name = "acme_msgs/msg/Mixed"
    for text in ("", "a", "ab", "abc", "abcd"):
        message = T[name](1, 2.5, True, np.array([4, -5, 6], np.int16), 7, 8.5, text, 9, 2**64 - 1, -11, -12)
        fields = {
            "a": "i32",
            "b": "f64",
            "c": "bool",
            "e": "u32",
            "f": "f32",
            "h": "u64",
            "i": "u64",
            "j": "i64",
            "k": "i32",
        }
        picks = [Pick(field, (field,), type_) for field, type_ in fields.items()]
        samples = read(name, cdr(message, name), *picks, Pick("d", ("d",), "i32", 3), Pick("d2", ("d[2]",), "f64"))
        row = samples.values[0].tolist()
        assert row[:9] == (1, 2.5, True, 7, 8.5, 9, 2**64 - 1, -11, -12)
        assert row[9].tolist() == [4, -5, 6] and row[10] == 6.0


@pytest.mark.parametrize(("length", "reason"), [(3, "taken"), (2, "shape"), (4, "shape"), (0, "shape")])
def test_a_whole_sequence_has_as_many_numbers(length: int, reason: str) -> None:
    joy = T["sensor_msgs/msg/Joy"]
    header = T["std_msgs/msg/Header"](T["builtin_interfaces/msg/Time"](1, 2), "")
    data = cdr(joy(header, np.arange(length, dtype=np.float32), np.arange(4, dtype=np.int32)), "sensor_msgs/msg/Joy")
    samples = read(
        "sensor_msgs/msg/Joy",
        data,
        Pick("axes", ("axes",), "f64", 3),
        Pick("one", ("axes[1]",), "f32"),
        Pick("b", ("buttons[1]",), "bool"),
        Pick("two", ("buttons[2]",), "bool"),
    )
    assert [REASONS[s] for s in samples.status[0]] == [reason, "taken" if length > 1 else "shape", "taken", "range"]


def test_quaternions_come_in_both_orders() -> None:
    name = "acme_msgs/msg/Deep"
    data = cdr(deep([]), name)  # 0.5, 0.1, 0.2, 0.3
    for order, axes, source_axes, expected in (
        ("wxyz", "", "", [0.5, 0.1, 0.2, 0.3]),
        ("xyzw", "", "", [0.3, 0.5, 0.1, 0.2]),
        ("wxyz", "enu/flu", "enu/frd", None),
        ("wxyz", "enu/frd", "enu/flu", [0.1, -0.5, -0.3, 0.2]),
    ):
        value, _ = read_one(name, data, Pick("q", ("q",), "f64", 4, order=order, axes=axes, source_axes=source_axes))
        assert value == (expected or [-0.1, 0.5, 0.3, -0.2])


@pytest.mark.parametrize("numbers", [[0.0] * 4, [-0.0, 0.0, -0.0, 0.0], [0.0, 0.0, 0.0, 1e-200]])
@pytest.mark.parametrize("type_", ["f64", "f32"])
def test_a_quaternion_of_length_zero(numbers: list[float], type_: str) -> None:
    """As the target has it: what an f32 rounds to zero is none."""
    name, each = "geometry_msgs/msg/Pose", tuple(f"orientation.{axis}" for axis in "wxyz")
    pose = T[name](T["geometry_msgs/msg/Point"](1.0, 2.0, 3.0), T["geometry_msgs/msg/Quaternion"](*numbers))
    expected = "taken" if any(numbers) and type_ == "f64" else "rotation"
    for pick, reason in (
        (Pick("q", ("orientation",), type_, 4, null_refused=True), expected),
        (Pick("q", ("orientation",), type_, 4, axes="ned/frd", null_refused=True), expected),
        (Pick("q", each, type_, 4, order="wxyz", null_refused=True), expected),
        (Pick("q", each, type_, 4, null_refused=True), "taken"),  # four numbers
        (Pick("q", ("orientation",), type_, 4), "taken"),
    ):
        assert read_one(name, cdr(pose, name), pick)[1] == reason


# ---- what a pick cannot be --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "pick", "text"),
    [
        (
            "geometry_msgs/msg/Nothing",
            Pick("a", ("x",), "f64"),
            "no definition of message type `geometry_msgs/Nothing`",
        ),
        (
            "sensor_msgs/msg/Imu",
            Pick("a", ("gyro",), "f64"),
            "`a`: `sensor_msgs/Imu` has no field `gyro`; fields to map: orient",
        ),
        ("sensor_msgs/msg/Imu", Pick("a", ("orientation",), "f64", 3), "`a`: `orientation` has 4 numbers, not 3"),
        ("sensor_msgs/msg/Imu", Pick("a", ("orientation",), "f64", 4, order="wxyz"), "is in the order x, y, z, w"),
        ("sensor_msgs/msg/Imu", Pick("a", ("angular_velocity",), "f64", 3, order="xyzw"), "a quaternion has 4 numbers"),
        (
            "sensor_msgs/msg/Imu",
            Pick("a", ("angular_velocity",), "f64", 3, axes="ned/frd"),
            "`a`: axes `ned/frd` of a vector",
        ),
        ("sensor_msgs/msg/Imu", Pick("a", ("angular_velocity",), "f64", 3, scale=(1.0, 2.0)), "takes 1 or 3"),
        ("sensor_msgs/msg/Imu", Pick("a", ("header.frame_id",), "f64"), "is text, not a number"),
        ("sensor_msgs/msg/Joy", Pick("a", ("axes[x]",), "f64"), "`axes` has no element `x`"),
        ("acme_msgs/msg/Deep", Pick("a", ("groups.items",), "f64"), "`groups` is a list of messages; take one"),
        ("acme_msgs/msg/Deep", Pick("a", ("groups[0]",), "f64"), "`groups[0]` contains a list"),
        ("acme_msgs/msg/Deep", Pick("a", ("v", "q"), "f64", 6), "`v`, `q` have 7 numbers, not 6"),
        ("acme_msgs/msg/Deep", Pick("a", ("q[]",), "f64"), "`q[]` is not a field of a message"),
        ("acme_msgs/msg/Deep", Pick("a", ("q[4]",), "f64"), "`q` has no element 4; the last one is 3"),
        ("acme_msgs/msg/Deep", Pick("a", ("groups[99999].pair[0].kind",), "i32"), "has no element 99999"),
        ("acme_msgs/msg/Deep", Pick("a", ("n.m",), "i32"), "`n` is a number (uint8), without fields; write `n`"),
    ],
)
def test_picks_that_do_not_fit(name: str, pick: Pick, text: str) -> None:
    with pytest.raises(MapError) as error:
        Reader(ALL, name, [pick])
    assert text in str(error.value)


def test_messages_that_cannot_be_walked() -> None:
    loop = {"a/msg/A": (*ALL["geometry_msgs/msg/Vector3"],), "a/msg/B": ()}
    member = ALL["geometry_msgs/msg/Pose"][0]
    recursive = {"a/msg/R": (type(member)("x", "float64"), type(member)("next", "a/msg/R"))}
    wide = {"a/msg/W": (type(member)("text", "wstring"), type(member)("x", "float64"))}
    with pytest.raises(MapError, match="no definition in the bag"):
        Reader(
            {**loop, "a/msg/C": (type(member)("b", "a/msg/B"), type(member)("x", "float64"))},
            "a/msg/C",
            [Pick("x", ("x",), "f64")],
        )
    with pytest.raises(MapError, match="nested too deeply"):
        Reader(recursive, "a/msg/R", [Pick("x", ("x",), "f64")])
    with pytest.raises(MapError, match="`text` is a wstring, which cannot be walked over"):
        Reader(wide, "a/msg/W", [Pick("x", ("x",), "f64")])
    with pytest.raises(MapError, match="`geometry_msgs/Vector3` has no `header.frame_id`"):
        Reader(STANDARD, "geometry_msgs/msg/Vector3", [Pick("x", ("x",), "f64")], frame="imu")


@pytest.mark.parametrize(
    ("sources", "frame", "text"),
    [
        ([Source("orientation", "f64", 3, 0)], "", "`orientation`: `orientation` has 4 numbers, not 3"),
        ([Source("orientation", "f64", 4, 0, axes="frd", name="q")], "", "`q`: axes `frd` of a quaternion"),
        ([Source("angular_velocity", "f64", 3, 0), Source("angular_velocity.z", "f64", 1, 0)], "", "is filled by"),
    ],
)
def test_sources_that_do_not_fit(sources: list[Source], frame: str, text: str) -> None:
    with pytest.raises(MapError) as error:
        Composer(STANDARD, "sensor_msgs/msg/Imu", sources, frame)
    assert text in str(error.value)


def test_a_value_that_its_field_cannot_hold_is_not_sent() -> None:
    composer = Composer(STANDARD, "std_msgs/msg/Int8", [Source("data", "i64", 1, 0)])
    for number, fits in ((127, True), (128, False), (-128, True), (-129, False)):
        data = composer.compose([np.array([number], np.int64).ctypes.data], 0)
        assert data == (b"\0\1\0\0" + np.int8(number).tobytes() if fits else None)
    assert composer.refused == 2
    single = Composer(STANDARD, "std_msgs/msg/Float32", [Source("data", "f64", 1, 0)])
    sent = [single.compose([np.array([x]).ctypes.data], 0) for x in (1e39, math.inf, -math.nan)]
    assert [s and s[4:] for s in sent] == [None, np.float32(math.inf).tobytes(), b"\0\0\xc0\x7f"]


F32_BEYOND = float.fromhex("0x1.ffffffp+127")  # rounds to infinity
NUMPY = {"bool": np.bool_, "i32": np.int32, "u32": np.uint32, "i64": np.int64, "u64": np.uint64, "f64": np.float64}


def built(wire: str, source: str, number: float) -> bool:
    """Whether the compiler accepts this safe value of an actuator that a field of this type carries."""
    span = Span(SourceFile("x.json", ""), 1, 1, 1, 1)
    ros = RosMapping(f"std_msgs/{wire}", "data", "out", "", "", "")
    sink = DiagnosticSink()
    check_mapped([Mapped("out", "actuator", ros, SCALARS[source], "", span, (number,), span)], sink)
    return not sink.failed


WHOLE = ["Bool", *(sign + str(bits) for sign in ("Int", "UInt") for bits in (8, 16, 32, 64))]
CONVERTED = [(wire, source) for wire in WHOLE for source in LIMITS]
CONVERTED += [(wire, source) for wire in ("Float32", "Float64") for source in NUMPY if source != "bool"]


@pytest.mark.parametrize(("wire", "source"), CONVERTED)
def test_the_compiler_refuses_the_safe_values_that_are_not_sent(wire: str, source: str) -> None:
    if source == "f64":
        numbers = [
            s * x for s in (-1.0, 1.0) for x in (0.0, 0.1, 1e39, math.nextafter(F32_BEYOND, 0), F32_BEYOND, 1e308)
        ]
    else:
        low, high = LIMITS[source]
        ends = {limit for limits in [*LIMITS.values(), *WIRE_LIMITS.values()] for limit in limits}
        numbers = sorted({n + d for n in ends for d in (-1, 0, 1) if low <= n + d <= high})
    composer = Composer(STANDARD, f"std_msgs/msg/{wire}", [Source("data", source, 1, 0)])
    for number in numbers:
        sent = composer.compose([np.array([number], NUMPY[source]).ctypes.data], 0) is not None
        assert built(wire, source, number) == sent, number


@pytest.mark.parametrize(("count", "fits"), [(1024, True), (1025, False)])
def test_as_many_sequences_as_there_may_be(count: int, fits: bool) -> None:
    types = get_types_from_msg("\n".join(f"float64[] f{i}" for i in range(count)), "a_msgs/msg/A")
    picks = [Pick(name=f"v{i}", fields=(f"f{i}[0]",), type="f64") for i in range(count)]
    try:
        Reader(definitions_of(types), "a_msgs/msg/A", picks)
    except MapError as error:
        assert not fits and "has too many parts" in str(error)
    else:
        assert fits

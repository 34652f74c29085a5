# SPDX-License-Identifier: Apache-2.0
"""Changes of axes against scipy's rotations and against what the words mean."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fcsl_compiler.board.rotations import from_angles
from fcsl_compiler.ros.axes import XYZW, AxesError, conversion, inverse, mounting, permutation, product
from fcsl_compiler.ros.message_fields import QUATERNION_AXES, Kind

Array = np.ndarray[Any, Any]

#: The axes of each word, in those of ROS: a column per axis.
NED = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])
FRD = np.diag([1.0, -1, -1])
TO: dict[str, Array] = {"enu": np.eye(3), "ned": NED, "flu": np.eye(3), "frd": FRD}
PAIRS = list(itertools.product(QUATERNION_AXES, repeat=2))
RNG = np.random.default_rng(7)


def quaternion(rotation: Rotation) -> Array:
    """w, x, y, z"""
    return np.roll(rotation.as_quat(), 1)


def rotation(q: Array) -> Rotation:
    return Rotation.from_quat(np.roll(q, -1))


def turned(attitude: Rotation, axes: str) -> Rotation:
    """The orientation of `attitude` (ENU, FLU) in these axes."""
    world, body = axes.split("/")
    return Rotation.from_matrix(TO[world] @ attitude.as_matrix() @ TO[body].T)


def test_words_mean_what_they_say() -> None:
    east, up = np.array([1.0, 0, 0]), np.array([0.0, 0, 1])
    left = np.array([0.0, 1, 0])
    ned, frd = np.array(conversion(Kind.VECTOR, 3, "", "ned")), np.array(conversion(Kind.VECTOR, 3, "", "frd"))
    assert (ned @ east).tolist() == [0, 1, 0] and (ned @ up).tolist() == [0, 0, -1]
    assert (frd @ left).tolist() == [0, -1, 0] and (frd @ up).tolist() == [0, 0, -1]
    facing_north = quaternion(Rotation.from_euler("z", 90, degrees=True))
    converted = np.array(conversion(Kind.QUATERNION, 4, "", "ned/frd")) @ facing_north
    assert np.allclose(converted, [1, 0, 0, 0], atol=1e-15)
    nose_up = quaternion(Rotation.from_euler("y", -30, degrees=True))  # FLU: nose up is negative; FRD: positive
    converted = np.array(conversion(Kind.QUATERNION, 4, "", "ned/frd")) @ nose_up
    assert np.allclose(rotation(converted).as_euler("ZYX", degrees=True), [90, 30, 0])  # facing east


@pytest.mark.parametrize(("source", "target"), PAIRS)
def test_orientations_agree_with_scipy(source: str, target: str) -> None:
    matrix = np.array(conversion(Kind.QUATERNION, 4, source, target))
    for attitude in Rotation.random(50, rng=RNG):
        got = matrix @ quaternion(turned(attitude, source))
        assert abs(got @ quaternion(turned(attitude, target))) == pytest.approx(1.0, abs=1e-14)
        # It turns the vectors of one body into those of one world.
        v = RNG.normal(size=3)
        body = np.array(conversion(Kind.VECTOR, 3, source.split("/")[1], target.split("/")[1])) @ v
        world = np.array(conversion(Kind.VECTOR, 3, source.split("/")[0], target.split("/")[0]))
        assert np.allclose(rotation(got).apply(body), world @ turned(attitude, source).apply(v), atol=1e-14)


@pytest.mark.parametrize(("source", "target"), PAIRS)
def test_there_and_back_is_the_same_quaternion(source: str, target: str) -> None:
    there, back = conversion(Kind.QUATERNION, 4, source, target), conversion(Kind.QUATERNION, 4, target, source)
    assert np.allclose(product(back, there), np.eye(4), atol=3e-16)
    assert np.allclose(inverse(there), back, atol=0)
    for between in QUATERNION_AXES:
        first, second = conversion(Kind.QUATERNION, 4, source, between), conversion(Kind.QUATERNION, 4, between, target)
        by_two, at_once = np.array(product(second, first)), np.array(there)
        assert np.allclose(by_two, at_once, atol=3e-16) or np.allclose(by_two, -at_once, atol=3e-16)


@pytest.mark.parametrize(("source", "target"), [("enu", "ned"), ("ned", "enu"), ("flu", "frd"), ("frd", "flu")])
def test_vectors_and_covariances(source: str, target: str) -> None:
    a = TO[target] @ TO[source].T
    v, w = RNG.normal(size=3), RNG.normal(size=3)
    assert (np.array(conversion(Kind.VECTOR, 3, source, target)) @ v).tolist() == (a @ v).tolist()
    both = np.array(conversion(Kind.VECTORS, 6, source, target)) @ np.concatenate([v, w])
    assert both.tolist() == [*(a @ v), *(a @ w)]
    c = RNG.normal(size=(3, 3))
    got = np.array(conversion(Kind.COVARIANCE, 9, source, target)) @ c.ravel()
    assert got.tolist() == (a @ c @ a.T).ravel().tolist()
    c, a = RNG.normal(size=(6, 6)), np.kron(np.eye(2), a)
    got = np.array(conversion(Kind.COVARIANCE, 36, source, target)) @ c.ravel()
    assert got.tolist() == (a @ c @ a.T).ravel().tolist()


def test_each_row_is_of_one_term_or_two_of_the_same_size() -> None:
    """So the order of a sum changes nothing, and neither do zeros that meet an infinity: they are left out."""
    for kind, count, words in ((Kind.VECTOR, 3, ("enu", "ned")), (Kind.COVARIANCE, 36, ("flu", "frd"))):
        for source, target in itertools.product(words, repeat=2):
            assert all(sorted(map(abs, row))[-2:] == [0, 1] for row in conversion(kind, count, source, target))
    for source, target in itertools.product(QUATERNION_AXES, repeat=2):
        for row in conversion(Kind.QUATERNION, 4, source, target):
            used = [abs(x) for x in row if x != 0.0]
            assert used in ([1.0], [math.sqrt(0.5)] * 2)


def test_order_of_a_quaternion() -> None:
    assert (np.array(permutation(XYZW)) @ [1, 2, 3, 4]).tolist() == [4, 1, 2, 3]
    assert (np.array(inverse(permutation(XYZW))) @ [4, 1, 2, 3]).tolist() == [1, 2, 3, 4]


@pytest.mark.parametrize(
    ("kind", "count", "source", "target", "text"),
    [
        (Kind.VECTOR, 3, "ned", "flu", "one is of the world, the other of a body"),
        (Kind.VECTOR, 3, "", "ned/frd", "the axes of a vector are enu, ned, flu, frd"),
        (Kind.QUATERNION, 4, "frd", "", "the axes of a quaternion are enu/flu"),
        (Kind.NUMBERS, 1, "", "frd", "they have no axes"),
    ],
)
def test_what_does_not_go_together(kind: Kind, count: int, source: str, target: str, text: str) -> None:
    with pytest.raises(AxesError, match=text):
        conversion(kind, count, source, target)


@pytest.mark.parametrize("angles", [(90, 0, 0), (0, 45, 0), (180, 0, 90), (315, 135, 225)])
def test_a_turned_sensor_is_turned_back(angles: tuple[int, int, int]) -> None:
    """Of whatever kind its numbers are: a vector v becomes R v, a covariance R C R', an orientation q conj(r)."""
    matrix = from_angles(*angles)
    turn = np.reshape(matrix, (3, 3))
    assert np.array_equal(mounting(Kind.VECTOR, 3, matrix), turn)
    twist = np.array(mounting(Kind.VECTORS, 6, matrix))
    assert np.array_equal(twist[:3, :3], turn) and np.array_equal(twist[3:, 3:], turn) and not twist[:3, 3:].any()
    covariance = np.arange(9.0).reshape(3, 3)
    turned = np.array(mounting(Kind.COVARIANCE, 9, matrix)) @ covariance.ravel()
    assert turned.reshape(3, 3) == pytest.approx(turn @ covariance @ turn.T, abs=1e-12)
    back = np.array(mounting(Kind.QUATERNION, 4, matrix)) @ (1.0, 0.0, 0.0, 0.0)
    assert rotation(back).as_matrix() == pytest.approx(turn.T, abs=1e-12)

# SPDX-License-Identifier: Apache-2.0
"""How the values of a campaign are spread: distributions, and designs that say which values belong to which case.

A value depends on the study's seed, the path of its parameter and the number of its case alone, so neither the order of cases
nor other parameters change it.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Protocol

Value = bool | int | float
#: Of a correlation matrix; less is a rounding.
_LEAST_PIVOT = 1e-12


class Distribution(Protocol):
    """Values of one parameter."""

    def at(self, share: float) -> Value:
        """The value below which this share of all values lies, 0 to 1."""

    def levels(self) -> tuple[Value, ...] | None:
        """All values, if they are a list."""

    def corners(self) -> tuple[Value, Value] | None:
        """The smallest and the largest value; None: it has no bounds."""


@dataclass(frozen=True)
class Uniform:
    low: float
    high: float

    def at(self, share: float) -> Value:
        return self.low + share * (self.high - self.low)

    def levels(self) -> None:
        return None

    def corners(self) -> tuple[Value, Value]:
        return self.low, self.high


@dataclass(frozen=True)
class Normal:
    """Of this mean and standard deviation; cut off outside of `within`."""

    mean: float
    deviation: float
    within: tuple[float, float] | None

    def shares(self) -> tuple[float, float]:
        """Which share of all values is below `within`, and which below its end."""
        if not self.within:
            return 0.0, 1.0
        low, high = (NormalDist().cdf((end - self.mean) / self.deviation) for end in self.within)
        return low, high

    def at(self, share: float) -> Value:
        low, high = self.shares()
        inside = low + share * (high - low)
        if not 0.0 < inside < 1.0:  # the farthest that a double can say
            inside = min(max(inside, 2.0**-53), 1.0 - 2.0**-53)
        value = self.mean + self.deviation * NormalDist().inv_cdf(inside)
        return min(max(value, self.within[0]), self.within[1]) if self.within else value

    def levels(self) -> None:
        return None

    def corners(self) -> tuple[Value, Value] | None:
        return self.within


@dataclass(frozen=True)
class Choice:
    """One of some values, each as often as its weight says."""

    values: tuple[Value, ...]
    weights: tuple[float, ...]

    def at(self, share: float) -> Value:
        left = share * math.fsum(self.weights)
        for value, weight in zip(self.values, self.weights, strict=True):
            left -= weight
            if left < 0.0:
                return value
        return self.values[-1]

    def levels(self) -> tuple[Value, ...]:
        return self.values

    def corners(self) -> tuple[Value, Value]:
        return min(self.values), max(self.values)


def random_bits(seed: int, *words: object) -> int:
    """64 bits that depend on nothing else."""
    text = " ".join(map(str, (seed, *words)))
    return int.from_bytes(hashlib.blake2b(text.encode(), digest_size=8).digest(), "little")


def random_share(seed: int, *words: object) -> float:
    """Uniform in [0, 1)."""
    return (random_bits(seed, *words) >> 11) * 2.0**-53


def shuffled(index: int, count: int, seed: int, *words: object) -> int:
    """Where a permutation of 0 … count - 1 puts `index`. It needs no memory: a Feistel network of four rounds over the next
    power of four, walked until it ends below `count`. Source: J. Black, P. Rogaway, Ciphers with arbitrary finite
    domains, CT-RSA 2002."""
    half = max(1, (max(count - 1, 1).bit_length() + 1) // 2)
    mask = (1 << half) - 1
    while True:
        left, right = index >> half, index & mask
        for number in range(4):
            left, right = right, left ^ (random_bits(seed, *words, "round", number, right) & mask)
        index = left << half | right
        if index < count:
            return index


class Design(Protocol):
    """Which values the cases have."""

    @property
    def count(self) -> int:
        """Of cases."""

    def values(self, case: int) -> tuple[Value, ...]:
        """One for each parameter, in the order of the study."""


def cholesky(matrix: Sequence[Sequence[float]]) -> list[list[float]] | None:
    """The lower triangle L with L L' = matrix, which is symmetric; None: it is not positive definite. In Python, so that it has the
    same bits everywhere."""
    rows: list[list[float]] = []
    for i, wanted in enumerate(matrix):
        row = [0.0] * len(matrix)
        for j in range(i + 1):
            left = wanted[j] - math.fsum(row[k] * (rows[j] if j < i else row)[k] for k in range(j))
            if i == j:
                if left <= _LEAST_PIVOT:
                    return None
                row[i] = math.sqrt(left)
            else:
                row[j] = left / rows[j][j]
        rows.append(row)
    return rows


@dataclass(frozen=True)
class Random:
    """A Monte Carlo campaign: each value by itself, but for `factor`, the lower triangle of the correlations. A Gaussian copula: normal
    numbers are correlated, and the share of each decides its value."""

    seed: int
    paths: Sequence[str]
    distributions: Sequence[Distribution]
    count: int
    factor: Sequence[Sequence[float]] = ()

    def values(self, case: int) -> tuple[Value, ...]:
        shares = [random_share(self.seed, case, path) for path in self.paths]
        if self.factor:
            shares = self._correlated(shares)
        return tuple(spread.at(share) for spread, share in zip(self.distributions, shares, strict=True))

    def _correlated(self, shares: Sequence[float]) -> list[float]:
        """A value that is correlated with none before it stays as it is, to the bit."""
        normal = NormalDist()
        numbers = [normal.inv_cdf(min(max(share, 2.0**-54), 1.0 - 2.0**-53)) for share in shares]
        found = []
        for i, row in enumerate(self.factor):
            correlated = any(row[:i])
            found.append(
                normal.cdf(math.fsum(map(math.prod, zip(row, numbers, strict=True)))) if correlated else shares[i]
            )
        return found


@dataclass(frozen=True)
class LatinHypercube:
    """Each parameter's range is cut into as many equally likely parts as there are cases, and each part is used once. Source:
    M. D. McKay, R. J. Beckman, W. J. Conover, Technometrics 21 (1979) 239."""

    seed: int
    paths: Sequence[str]
    distributions: Sequence[Distribution]
    count: int

    def values(self, case: int) -> tuple[Value, ...]:
        found = []
        for path, spread in zip(self.paths, self.distributions, strict=True):
            part = shuffled(case, self.count, self.seed, path)
            found.append(spread.at((part + random_share(self.seed, case, path)) / self.count))
        return tuple(found)


class Grid:
    """Every combination of levels; the last parameter changes fastest."""

    def __init__(self, levels: Sequence[Sequence[Value]]):
        self._levels = levels
        self.count = math.prod(map(len, levels))

    def values(self, case: int) -> tuple[Value, ...]:
        found: list[Value] = []
        for levels in reversed(self._levels):
            case, place = divmod(case, len(levels))
            found.append(levels[place])
        return tuple(reversed(found))

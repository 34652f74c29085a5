# SPDX-License-Identifier: Apache-2.0
"""The histogram of durations against NumPy's quantiles of the same values."""

from __future__ import annotations

import ctypes
import subprocess

import numpy as np
import pytest
from conftest import CFLAGS, ROOT
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

RUNTIME = ROOT / "fcsl_runtime/fcsl_runtime"
BITS = 5
BUCKETS = (64 - BITS + 1) << BITS
QUANTILES = {"p50": 0.5, "p99": 0.99, "p999": 0.999}


class Histogram(ctypes.Structure):
    _fields_ = [("counts", ctypes.c_uint64 * BUCKETS), ("max", ctypes.c_uint64)]


class Summary(ctypes.Structure):
    _fields_ = [(name, ctypes.c_uint64) for name in ("count", *QUANTILES, "max")]


@pytest.fixture(scope="module")
def code(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    library = tmp_path_factory.mktemp("histogram") / "libhistogram.so"
    flags = [*CFLAGS, f"-I{RUNTIME / 'include'}"]
    subprocess.run(["cc", *flags, str(RUNTIME / "src/base/histogram.c"), "-o", str(library)], check=True)
    loaded = ctypes.CDLL(str(library))
    loaded.fcsl_histogram_add.argtypes = [ctypes.POINTER(Histogram), ctypes.c_uint64]
    loaded.fcsl_histogram_end.argtypes = [ctypes.c_uint32]
    loaded.fcsl_histogram_end.restype = ctypes.c_uint64
    loaded.fcsl_histogram_summary.argtypes = [ctypes.POINTER(Histogram), ctypes.POINTER(Summary)]
    return loaded


def fill(code: ctypes.CDLL, values: list[int]) -> tuple[Histogram, Summary]:
    histogram, summary = Histogram(), Summary()
    for value in values:
        code.fcsl_histogram_add(histogram, value)
    code.fcsl_histogram_summary(histogram, summary)
    return histogram, summary


def check(summary: Summary, values: list[int]) -> None:
    """Each quantile is never below the exact one, and at most 1/32 above it."""
    assert summary.count == len(values) and summary.max == max(values, default=0)
    for name, quantile in QUANTILES.items():
        if values:
            exact = int(np.quantile(np.array(values, dtype=np.uint64), quantile, method="inverted_cdf"))
            assert exact <= getattr(summary, name) <= exact + exact // 32, name


@settings(max_examples=100, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(st.one_of(st.integers(0, 200), st.integers(0, 10**7), st.integers(0, 2**64 - 1)), max_size=300))
def test_quantiles(code: ctypes.CDLL, values: list[int]) -> None:
    histogram, summary = fill(code, values)
    check(summary, values)
    assert sum(histogram.counts) == len(values)


def test_many_values_of_a_long_tail(code: ctypes.CDLL) -> None:
    random = np.random.default_rng(1)
    values = [int(v) for v in random.lognormal(np.log(20_000), 1.5, 40_000)]
    check(fill(code, values)[1], values)


def test_every_bucket_holds_what_it_says(code: ctypes.CDLL) -> None:
    """Its end and the value before the next one's begin lie in it; it is at most 1/32 of its values wide."""
    begin = 0
    for bucket in range(BUCKETS):
        end = code.fcsl_histogram_end(bucket)
        assert begin <= end and (end - begin) * 32 <= begin
        for value in (begin, end):
            histogram, _ = fill(code, [value])
            assert histogram.counts[bucket] == 1
        begin = end + 1
    assert begin == 2**64


def test_control_a_bucket_too_wide_is_found(code: ctypes.CDLL) -> None:
    """Half as many buckets: the bound of the error is exceeded somewhere."""
    values = list(range(1000, 3000))
    coarse = [value | 0x7F for value in values]
    _, summary = fill(code, coarse)
    with pytest.raises(AssertionError):
        check(summary, values)

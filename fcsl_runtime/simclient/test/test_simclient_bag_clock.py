# SPDX-License-Identifier: Apache-2.0
"""One clock for all times of a command: header stamps, or times of recording. It is chosen, and named."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import pytest
from foreign_bags import MS, header, imu, make, number, write

from simclient import BagError
from simclient.bag.export import select
from simclient.bag.formats import open_bag
from simclient.bag.info import describe
from simclient.replay.cut import cut
from simclient.view.picture import plot

WALL = 1_700_000_000 * 10**9
SIM = 928 * 10**9


def transform(time_ns: int) -> Any:
    return make(
        "tf2_msgs/msg/TFMessage", transforms=[make("geometry_msgs/msg/TransformStamped", header=header(time_ns))]
    )


@pytest.fixture
def simulated(tmp_path: Path) -> Path:
    """Stamps of a simulation, recorded by a clock on the wall, ten seconds at 10 Hz."""
    times = [i * 100 * MS for i in range(101)]
    return write(
        tmp_path / "simulated",
        {
            "/imu": [(WALL + t, imu(SIM + t, (t / 1e9, 0, 0))) for t in times],
            "/tf": [(WALL + t, transform(SIM + t)) for t in times],
        },
    )


def facts(text: str) -> dict[str, str]:
    return {name: value.strip() for name, _, value in (line.partition("  ") for line in text.splitlines())}


def test_info_of_topics_with_and_without_headers(simulated: Path) -> None:
    by_log = facts(describe(open_bag(simulated)))
    assert by_log["time"] == "log times (/tf without a header)"
    assert (by_log["duration"], by_log["from"]) == ("10.000000000 s", "1700000000.000000000 s")
    by_header = facts(describe(open_bag(simulated), time="header"))
    assert by_header["time"] == "header stamps" and by_header["timeless"] == "/tf, without a header"
    assert (by_header["duration"], by_header["from"]) == ("10.000000000 s", "928.000000000 s")


@pytest.mark.parametrize("zeros", [1, 3])
def test_stamps_of_zero(zeros: int, tmp_path: Path) -> None:
    times = [i * 50 * MS for i in range(40)]
    bag = write(
        tmp_path / "bag", {"/imu": [(WALL + t, imu(0 if n < zeros else WALL + t)) for n, t in enumerate(times)]}
    )
    text = describe(open_bag(bag))
    assert facts(text)["duration"] == f"{1.95 - 0.05 * zeros:.9f} s" and "20.00 Hz" in text
    told = f"{zeros} message{'s' if zeros > 1 else ''} of /imu with the stamp zero"
    assert facts(text)["timeless"] == told
    found = select(open_bag(bag))
    assert len(found.series[0].times) == 40 - zeros and found.clock.timeless == [told]
    assert len(select(open_bag(bag), time="log").series[0].times) == 40
    assert plot(bag, tmp_path / "x.png", paths=["/imu:angular_velocity.x"]) == [told]


def test_the_start_of_simulated_time_is_a_time(tmp_path: Path) -> None:
    bag = write(tmp_path / "bag", {"/imu": [(i * MS, imu(i * MS)) for i in range(9)]})
    assert facts(describe(open_bag(bag)))["from"] == "0.000000000 s" and "timeless" not in describe(open_bag(bag))


def test_a_table_has_one_clock(simulated: Path, tmp_path: Path) -> None:
    from simclient.bag.command import main

    target = tmp_path / "x.csv"
    for options, first_s, rows in (((), "1700000000.000000000", 101), (("--time", "header"), "928.000000000", 101)):
        assert main(["export", str(simulated), "-o", str(target), *options]) == 0
        with target.open() as stream:
            table = list(csv.DictReader(stream))
        assert table[0]["time_s"] == first_s and len(table) == rows


def test_a_cut_has_one_clock(simulated: Path, tmp_path: Path) -> None:
    """Both topics, whichever clock chooses."""
    for name, begin_s, clock in (("a", SIM / 1e9, "header"), ("b", WALL / 1e9, ""), ("c", WALL / 1e9, "log")):
        begin_ns = round(begin_s) * 10**9 + 2 * 10**9
        found = cut(open_bag(simulated), tmp_path / name, begin_ns, begin_ns + 10**9, time=clock)
        counts = {topic.name: topic.count for topic in open_bag(tmp_path / name).topics.values()}
        assert counts == {"/imu": 11, "/tf": 11} and found.messages == 22
    assert "by header stamps" in str(cut(open_bag(simulated), tmp_path / "d", SIM, SIM, time="header"))


def test_a_cut_by_the_other_clock_says_so(simulated: Path, tmp_path: Path) -> None:
    with pytest.raises(
        BagError, match=r"no message from 940.* its log times .* go from 1700000000\.0.* --time chooses the clock"
    ):
        cut(open_bag(simulated), tmp_path / "part", 940 * 10**9, 950 * 10**9)
    assert not (tmp_path / "part").exists()


def test_a_picture_names_its_clock(simulated: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from simclient.view import picture

    shown: list[str] = []
    monkeypatch.setattr(picture, "save", lambda figure, output: shown.append(figure.axes[-1].get_xlabel()))
    for time in ("", "log"):
        plot(simulated, tmp_path / "x.png", paths=["/imu:angular_velocity.x"], time=time)
    assert shown[0] == "time, s (header stamps)" and shown[1].endswith("UTC, s (log times)")


def test_topics_without_headers_need_the_times_of_recording(tmp_path: Path) -> None:
    bag = write(tmp_path / "bag", {"/level": [(WALL + i * MS, number(i)) for i in range(9)]})
    assert facts(describe(open_bag(bag)))["time"] == "log times (/level without a header)"
    by_header = describe(open_bag(bag), time="header")
    assert facts(by_header)["messages"] == "9" and "duration" not in by_header
    with pytest.raises(BagError, match="nothing to export"):
        select(open_bag(bag), time="header")

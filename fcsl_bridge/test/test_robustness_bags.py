# SPDX-License-Identifier: Apache-2.0
"""A recording whose node is killed or whose disk fails keeps everything but the last second, for every reader."""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path

import pytest
import rig
from bridge_harness import LIMIT_S, MACHINE, SIM, Domain, Process
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from fcsl_bridge.base.machine_index import find_machine
from fcsl_bridge.nodes import start
from fcsl_compiler.base.packages import package_prefix
from simclient.bag import Bag
from simclient.errors import BagError
from simclient.replay import replay

SEED = 7
#: Rounds of four processes each that end at random times.
BATCHES = 2 if os.environ.get("FCSL_VERIFY", "") in ("", "0") else 5


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return rig.build(tmp_path_factory.mktemp("rig"))


def tool(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["fcsl", *map(str, arguments)], capture_output=True, text=True, env=os.environ, timeout=LIMIT_S
    )


def messages_for_rosbags(bag: Path) -> int:
    # A recording in which nothing was written yet has no types.
    with AnyReader([bag], default_typestore=get_typestore(Stores.EMPTY)) as reader:
        return sum(1 for _ in reader.messages())


def check_what_is_left(bag: Path, library: Path) -> int:
    """Every reader finds the same messages in an incomplete bag, and they are the machine's; returns the ticks."""
    opened = Bag(bag)
    assert opened.truncated
    assert messages_for_rosbags(bag) == sum(topic.count for topic in opened.topics.values())
    verdict = replay(opened, library=str(library))
    assert verdict.divergence is None and not verdict.identical
    return verdict.ticks


def check_tools(bag: Path, library: Path) -> None:
    """The command-line tools report what is missing, and cut a complete bag from the rest."""
    info = tool("bag", "info", bag)
    assert "was not closed after" in info.stdout and "the bag is incomplete" in info.stderr
    rest = bag.with_name("rest")
    assert "replays" in tool("bag", "cut", bag, "-o", rest).stdout
    assert not Bag(rest).truncated and messages_for_rosbags(rest) == messages_for_rosbags(bag)
    assert replay(rest, library=str(library)).divergence is None


def test_killed_free_running(domain: Domain, library: Path) -> None:
    bag = domain.folder / "bag"
    process = domain.start("controller_node", machine=library, mode="realtime", record=bag)
    wait_for_ticks(bag, 11)
    process.signal(signal.SIGKILL)
    assert process.finish() == -signal.SIGKILL
    assert check_what_is_left(bag, library) > 10
    check_tools(bag, library)


def test_killed_in_lockstep(domain: Domain) -> None:
    bag = domain.folder / "bag"
    controller = domain.start("controller_node", machine=MACHINE, record=bag)
    domain.start("sim_node", sim=SIM, seed=SEED, speed=8.0)
    wait_for_ticks(bag, 675)  # it has left ASCENT
    controller.signal(signal.SIGKILL)
    assert controller.finish() == -signal.SIGKILL
    library, _ = find_machine(MACHINE)
    assert check_what_is_left(bag, library) >= 675


def wait_for_ticks(bag: Path, count: int) -> None:
    """Returns once the bag's file has this number of readable ticks of the only machine."""
    limit = time.monotonic() + LIMIT_S
    while ticks_in(bag) < count:
        assert time.monotonic() < limit, f"{bag} does not grow"
        time.sleep(0.1)


def ticks_in(bag: Path) -> int:
    try:
        opened = Bag(bag)
        return opened.topics[opened.machine().state].count
    except (BagError, KeyError):  # it is empty so far
        return 0


def wait_for_file(path: Path, size: int) -> None:
    """Returns once the file has `size` bytes."""
    limit = time.monotonic() + LIMIT_S
    while not (path.exists() and path.stat().st_size >= size):
        assert time.monotonic() < limit, f"{path} does not grow"
        time.sleep(0.02)


def test_killed_at_any_moment(domain: Domain, library: Path) -> None:
    """With three signals: no bag, or a readable one; no traceback, no child process left, the documented exit status."""
    moments = random.Random(4)
    for batch in range(BATCHES):
        flights = [moment(domain, library, f"bag{batch}_{i}", moments) for i in range(4)]
        for bag, number, process, children in flights:
            status = ended(process)
            assert status == -number or (status == 0 and number != signal.SIGKILL), process.err
            wait_for_end(children)
            check_bag_or_none(bag, library, closed=status == 0)


def moment(domain: Domain, library: Path, name: str, moments: random.Random) -> tuple[Path, int, Process, list[Path]]:
    bag, number = domain.folder / name, moments.choice((signal.SIGKILL, signal.SIGKILL, signal.SIGINT, signal.SIGTERM))
    process = domain.start("controller_node", machine=library, mode="realtime", record=bag)
    time.sleep(moments.uniform(0.2, 1.5))
    children = Path(f"/proc/{process.process.pid}/task/{process.process.pid}/children").read_text(encoding="ascii")
    process.signal(number)
    return bag, number, process, [Path("/proc", child) for child in children.split()]


def wait_for_end(children: Sequence[Path]) -> None:
    """Returns once none of these processes runs. A node that starts has one for some ms, to ask cc for its version."""
    limit = time.monotonic() + LIMIT_S
    while any(child.exists() for child in children):
        assert time.monotonic() < limit, f"the node left {children}"
        time.sleep(0.02)


def ended(process: Process) -> int:
    """The exit status. Before the node's first line runs, Python handles SIGINT with a traceback, as if killed."""
    try:
        status = process.process.wait(LIMIT_S)
    except subprocess.TimeoutExpired:
        raise AssertionError(f"it goes on:\n{process.out}{process.err}") from None
    if "Traceback" not in process.err:
        return status
    assert str(Path(start.__file__).parent.resolve()) not in process.err, process.err
    return -signal.SIGINT


def check_bag_or_none(bag: Path, library: Path, closed: bool) -> None:
    if closed and bag.exists():
        assert replay(bag, library=str(library)).identical
        return
    if not (bag / "metadata.yaml").exists():
        return
    assert messages_for_rosbags(bag) >= 0
    try:
        assert replay(bag, library=str(library)).divergence is None
    except BagError as error:  # nothing was written yet
        assert "checkpoint is missing" in str(error) or "before the first record" in str(error)


# ---- the disk ----------------------------------------------------------------------------------------------------------


def limited(domain: Domain, kilobytes: int, parameters: Sequence[str]) -> Process:
    """A controller that cannot write files larger than this, which emulates a full disk for one process. No compiled
    import of Python is cut short for later processes."""
    path = package_prefix("fcsl_bridge") / "lib" / "fcsl_bridge" / "controller_node"
    arguments = ["--ros-args", *(word for parameter in parameters for word in ("-p", parameter))]
    limits = f"export PYTHONDONTWRITEBYTECODE=1; ulimit -f {kilobytes}"
    return domain.run(["bash", "-c", f'{limits}; exec "$@"', "-", path, *arguments])


def test_full_disk_free_running(domain: Domain, library: Path) -> None:
    """The machine continues without a record; the written part stays readable."""
    bag = domain.folder / "bag"
    options = [f"machine:={library}", "mode:=realtime", f"record:={bag}"]
    process = limited(domain, 16, options)
    process.wait_for("flying on without a record")
    assert "recording failed: cannot write to bag" in process.err and "File too large" in process.err
    process.signal(signal.SIGINT)
    assert process.finish() == 0
    assert "interrupted: " in process.out and "recorded to" not in process.out
    assert check_what_is_left(bag, library) > 0


def test_full_disk_in_lockstep(domain: Domain) -> None:
    """A simulation without its record is useless: it ends with an error."""
    bag = domain.folder / "bag"
    controller = limited(domain, 150, [f"machine:={MACHINE}", f"record:={bag}"])
    sim = domain.start("sim_node", sim=SIM, seed=SEED, timeout_s=3.0)
    assert controller.finish() == 1
    assert "recording failed: cannot write to bag" in controller.err
    assert sim.finish() == 1 and "controller" in sim.err
    library, _ = find_machine(MACHINE)
    assert check_what_is_left(bag, library) > 0


def test_the_bag_is_taken_away(domain: Domain, library: Path) -> None:
    """The open file is still written; the failure to complete the bag is an error at the end."""
    bag = domain.folder / "bag"
    process = domain.start("controller_node", machine=library, mode="realtime", record=bag)
    wait_for_file(bag / "bag_0.mcap", 500)
    shutil.rmtree(bag)
    process.signal(signal.SIGINT)
    assert process.finish() == 1
    assert f"cannot write '{bag}/.metadata.yaml.tmp': No such file" in process.err

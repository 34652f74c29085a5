# SPDX-License-Identifier: Apache-2.0
"""A map that names a transform by its frames: composed from /tf and /tf_static, checked against SciPy."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foreign_bags import MS, encoded, header, make, number, quaternion, vector, write, write_mcap
from scipy.spatial.transform import Rotation, Slerp

from simclient import MapError
from simclient.machine_build import build_config
from simclient.replay import poses, replay_foreign
from simclient.replay.foreign import ForeignRun

START = 100 * 10**9
Array = np.ndarray[Any, Any]
MIRROR = '''\
class Mirror:
    """Where a vehicle is, as told."""

    outputs = {"position": "f64[3] m", "attitude": "f64[4]"}

    def execute(self):
        pass
'''
CHANNELS = """\
channels:
  position: {topic: %s}
  attitude: {topic: %s}
"""
FROM_POSE = CHANNELS % ("/pose, field: pose.position", "/pose, field: pose.orientation")
EXPECT = """\
expect:
  mirror.outputs.position: {topic: "tf:%s", field: transform.translation, abs: 1e-9%s}
  mirror.outputs.attitude: {topic: "tf:%s", field: transform.rotation, abs: 1e-9%s}
"""


@pytest.fixture(scope="module")
def mirror(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A machine at 100 Hz whose outputs are its channels."""
    folder = tmp_path_factory.mktemp("mirror")
    (folder / "mirror.py").write_text(MIRROR)
    rest = {"direction": "sensor", "max_age_ticks": 100}
    machine = {
        "tick_hz": 100,
        "initial_state": "RUN",
        "algorithms": {"Mirror": {"source": "mirror.py"}},
        "instances": {"mirror": {"algorithm": "Mirror"}},
        "connections": [],
        "states": {"RUN": {"schedule": {"mirror": 100}}},
        "transitions": [],
        "channels": [
            {"name": name, "id": i + 1, "field": f"mirror.outputs.{name}", **rest}
            for i, name in enumerate(("position", "attitude"))
        ],
    }
    (folder / "mirror.json").write_text(json.dumps(machine))
    return build_config(folder / "mirror.json")[0]


Runs = Callable[..., ForeignRun]


@pytest.fixture
def run(mirror: Path, tmp_path: Path) -> Runs:
    numbers = iter(range(100))

    def of(content: Any, chart: str, form: str = "mcap") -> ForeignRun:
        (tmp_path / "map.yaml").write_text(chart)
        bag = write(tmp_path / f"bag{next(numbers)}", content, form)
        return replay_foreign(bag, tmp_path / "map.yaml", library=str(mirror))

    return of


def transform(time_ns: int, parent: str, child: str, pose: Sequence[float]) -> Any:
    """`pose`: position x, y, z, rotation x, y, z, w."""
    x, y, z, w = pose[3:]
    moved = make("geometry_msgs/msg/Transform", translation=vector(*pose[:3]), rotation=quaternion(w, x, y, z))
    kind = "geometry_msgs/msg/TransformStamped"
    return make(kind, header=header(time_ns, parent), child_frame_id=child, transform=moved)


def tf(*transforms: Any) -> Any:
    return make("tf2_msgs/msg/TFMessage", transforms=list(transforms))


def link(parent: str, child: str, period_ms: int, walk: Array, delay_ms: int = 0) -> list[tuple[int, Any]]:
    """A pose of `walk` (n, 7) every period, recorded `delay_ms` behind its stamp."""
    times = [START + period_ms * i * MS for i in range(len(walk))]
    return [(t + delay_ms * MS, tf(transform(t, parent, child, pose))) for t, pose in zip(times, walk, strict=True)]


def walk(seed: int, count: int) -> Array:
    """Random poses, a small step from one to the next."""
    random = np.random.default_rng(seed)
    turned = Rotation.identity()
    found = []
    for position in np.cumsum(random.normal(size=(count, 3)), axis=0):
        turned = turned * Rotation.from_rotvec(random.normal(scale=0.3, size=3))
        found.append(np.concatenate((position, turned.as_quat())))
    return np.array(found)


def matrices(walked: Array) -> Array:
    """(n, 4, 4) of poses (n, 7)."""
    found = np.tile(np.eye(4), (len(walked), 1, 1))
    found[:, :3, :3] = Rotation.from_quat(walked[:, 3:]).as_matrix()
    found[:, :3, 3] = walked[:, :3]
    return found


def between(walked: Array, period_ms: float, at_ms: Array) -> Array:
    """(m, 4, 4): SciPy's interpolation of a link."""
    times = np.arange(len(walked)) * period_ms
    position = np.stack([np.interp(at_ms, times, walked[:, i]) for i in range(3)], axis=1)
    turned = Slerp(times, Rotation.from_quat(walked[:, 3:]))(at_ms)
    return matrices(np.concatenate((position, turned.as_quat()), axis=1))


def pose_of(time_ns: int, matrix: Array) -> tuple[int, Any]:
    x, y, z, w = Rotation.from_matrix(matrix[:3, :3]).as_quat()
    pose = make("geometry_msgs/msg/Pose", position=point(*matrix[:3, 3]), orientation=quaternion(w, x, y, z))
    return time_ns, make("geometry_msgs/msg/PoseStamped", header=header(time_ns), pose=pose)


def point(x: float, y: float, z: float) -> Any:
    return make("geometry_msgs/msg/Point", x=x, y=y, z=z)


def still(count: int) -> list[tuple[int, Any]]:
    """A pose that stays at the origin, every 10 ms."""
    return [pose_of(START + 10 * i * MS, np.eye(4)) for i in range(count)]


# ---- arithmetic -------------------------------------------------------------------------------------------------------


def test_poses_agree_with_scipy() -> None:
    first, second = walk(1, 50), walk(2, 50)
    a, b = (poses.Poses(w[:, :3], w[:, 3:]) for w in (first, second))
    for found, wanted in (
        (poses.compose(a, b), matrices(first) @ matrices(second)),
        (poses.inverse(a), np.linalg.inv(matrices(first))),
    ):
        assert matrices(np.concatenate(found, axis=1)) == pytest.approx(wanted, abs=1e-12)


@pytest.mark.parametrize("scale", [1e-9, 1e-4, 0.3, 3.0])
def test_interpolation_agrees_with_scipys_slerp(scale: float) -> None:
    """Neighbours may be almost the same, far apart, or the same rotation with the other sign."""
    random = np.random.default_rng(3)
    steps = Rotation.from_rotvec(random.normal(size=(20, 3)) * scale)
    turned = steps.as_quat() * random.choice((-1.0, 1.0), size=(20, 1))
    times = np.arange(20, dtype=np.int64) * 10 * MS
    at = np.sort(random.integers(0, times[-1] + 1, size=200))
    at[:3], at[-1] = (0, 10 * MS, 15 * MS), times[-1]
    at.sort()
    found = poses.interpolate(times, poses.Poses(np.zeros((20, 3)), turned), at)
    wanted = Slerp(times.astype(float), Rotation.from_quat(turned))(at.astype(float))
    assert (Rotation.from_quat(found.rotation).inv() * wanted).magnitude().max() < 1e-12
    assert np.linalg.norm(found.rotation, axis=1) == pytest.approx(1.0, abs=1e-15)


# ---- through a replay -------------------------------------------------------------------------------------------------

#: camera ── arm ── base_link ── odom ── map, and gps ── map: static are arm's and gps's.
WALKS = {"map->odom": walk(4, 5), "odom->base_link": walk(5, 20), "arm->camera": walk(6, 20)}
MOVING = WALKS["odom->base_link"]
MOUNTS = {"base_link->arm": walk(7, 1), "map->gps": walk(8, 1)}


def tree() -> dict[str, list[tuple[int, Any]]]:
    """50 Hz of odometry and of a camera that moves, 10 Hz of map->odom, whose messages are recorded late."""
    moving = [
        *link("map", "odom", 100, WALKS["map->odom"], delay_ms=35),
        *link("odom", "base_link", 20, WALKS["odom->base_link"]),
        *link("arm", "camera", 20, WALKS["arm->camera"]),
    ]
    static = [transform(0, *name.split("->"), pose[0]) for name, pose in MOUNTS.items()]
    return {"/tf": sorted(moving, key=lambda m: m[0]), "/tf_static": [(START, tf(*static))]}


def camera_in_gps(at_ms: Array) -> Array:
    return (
        np.linalg.inv(matrices(MOUNTS["map->gps"]))
        @ between(WALKS["map->odom"], 100, at_ms)
        @ between(WALKS["odom->base_link"], 20, at_ms)
        @ matrices(MOUNTS["base_link->arm"])
        @ between(WALKS["arm->camera"], 20, at_ms)
    )


@pytest.mark.parametrize("form", ["mcap", "sqlite3", "ros1"])
def test_a_chain_of_static_and_moving_transforms(form: str, run: Runs) -> None:
    """The machine mirrors poses that SciPy composed; the map expects what it composes itself."""
    at_ms = np.arange(0.0, 381.0, 20.0)
    chain = camera_in_gps(at_ms)
    content = tree() | {"/pose": [pose_of(START + int(t) * MS, m) for t, m in zip(at_ms, chain, strict=True)]}
    done = run(content, FROM_POSE + EXPECT % ("gps->camera", "", " gps -> camera", ""), form)
    for comparison in done.comparisons:
        assert len(comparison.t_s) == 20 and comparison.holds, str(done)
    content["/tf_static"] = [(START, tf(*(transform(0, *n.split("->"), p[0] * 1.001) for n, p in MOUNTS.items())))]
    done = run(content, FROM_POSE + EXPECT % ("gps->camera", "", "gps->camera", ""), form)
    assert [comparison.holds for comparison in done.comparisons] == [False, True]  # lengths differ, rotations do not
    assert "tf:gps->camera" not in done.oddities


def test_a_channel_may_take_a_transform_and_its_inverse(run: Runs) -> None:
    chart = CHANNELS % ('"tf:base_link->odom", field: transform.translation', "/pose, field: pose.orientation")
    content = {"/tf": link("odom", "base_link", 10, MOVING)}
    back = np.linalg.inv(matrices(MOVING))
    content["/pose"] = [pose_of(START + 10 * i * MS, m) for i, m in enumerate(back)]
    done = run(content, chart + "expect: {mirror.outputs.position: {topic: /pose, field: pose.position, abs: 1e-9}}")
    assert done.fates["position"].coverage.used == 20 and done.comparisons[0].holds, str(done)


def test_the_window_counts_and_times_outside_a_link_are_told(run: Runs) -> None:
    done = run(tree() | {"/pose": still(50)}, FROM_POSE + EXPECT % (("map->camera", ", from_s: 0.1, until_s: 0.2") * 2))
    assert all(len(c.t_s) == 6 and c.t_s[0] == pytest.approx(0.1) for c in done.comparisons)
    assert "tf:map->camera: 1 times are left out, at which not every transform of the chain is known" in str(done)


def test_unusable_transforms_are_refused_and_counted(run: Runs) -> None:
    walked = np.tile((1.0, 0, 0, 0, 0, 0, 1.0), (12, 1))
    walked[2, 1] = np.nan
    walked[3, 3:] = 0.0
    walked[11] *= 7.0
    messages = link("odom", "base_link", 10, walked)
    messages[5][1].transforms[0].header = header(0, "odom")
    messages[11][1].transforms[0].header = header(START - 2000 * MS, "odom")
    done = run({"/tf": messages, "/pose": still(12)}, FROM_POSE + EXPECT % (("odom->base_link", "") * 2))
    (note,) = done.notes
    assert note.startswith("tf:odom->base_link: odom->base_link: refused: 1 with a NaN (first: message 2)")
    for reason in (
        "1 with a rotation of length zero or infinity",
        "1 with the stamp zero",
        "1 after a backward jump of the clock",
    ):
        assert reason in note
    # Those that are refused do not count; the position is off by 1 m in all others.
    assert [len(c.t_s) for c in done.comparisons] == [8, 8]
    assert done.comparisons[0].error.tolist() == [1.0] * 8 and done.comparisons[1].holds


def test_times_of_recording_place_transforms_too(run: Runs) -> None:
    content = {"/tf": link("odom", "base_link", 10, MOVING, delay_ms=30), "/pose": still(30)}
    done = run(content, "time: log\n" + FROM_POSE + EXPECT % (("odom->base_link", "") * 2))
    assert done.comparisons[0].t_s == pytest.approx(np.arange(20) * 0.01 + 0.03)


def test_damage_behind_the_transforms_is_told(mirror: Path, tmp_path: Path) -> None:
    """In a chunk of poses alone."""
    messages = [(t, "/tf", m) for t, m in link("odom", "base_link", 10, MOVING)]
    messages += [(t, "/pose", m) for t, m in still(300)]
    bag = write_mcap(tmp_path / "bag.mcap", messages, chunk_bytes=2000)
    data = bytearray(bag.read_bytes())
    data[len(data) // 2 : len(data) // 2 + 40] = bytes(40)
    bag.write_bytes(data)
    (tmp_path / "map.yaml").write_text(FROM_POSE + EXPECT % (("odom->base_link", "") * 2))
    done = replay_foreign(bag, tmp_path / "map.yaml", library=str(mirror))
    assert done.truncated.startswith("bag.mcap lacks ") and done.truncated.endswith(" (a damaged chunk)")
    assert 200 < done.fates["position"].messages < 300 and len(done.comparisons[0].t_s) == 20


def test_damaged_messages_are_passed_over(mirror: Path, tmp_path: Path) -> None:
    messages = [(t, "/tf", m) for t, m in link("odom", "base_link", 10, MOVING)]
    messages += [(t, "/pose", m) for t, m in still(20)]
    data, kind, text = encoded(messages[3][2])
    messages[3] = (messages[3][0], "/tf", (data[:-9], kind, text))
    messages[4] = (messages[4][0], "/tf", (data[:4] + b"\xff\xff\xff\xff" + data[8:], kind, text))
    bag = write_mcap(tmp_path / "bag.mcap", messages)
    (tmp_path / "map.yaml").write_text(FROM_POSE + EXPECT % (("odom->base_link", "") * 2))
    done = replay_foreign(bag, tmp_path / "map.yaml", library=str(mirror))
    assert done.notes == ("/tf and /tf_static: 2 damaged messages were passed over",)
    assert len(done.comparisons[0].t_s) == 18


def test_another_type_on_the_topic(run: Runs) -> None:
    content = {"/tf": link("a", "b", 10, MOVING), "/tf_static": [(START, number(1.0))], "/pose": still(20)}
    with pytest.raises(MapError, match=r"`/tf_static` is std_msgs/msg/Float64, not tf2_msgs/msg/TFMessage"):
        run(content, FROM_POSE + EXPECT % (("a->b", "") * 2))


WRONG = {
    "a frame that the bag does not have": (
        "odom->base_lnk",
        tree(),
        r"no frame `base_lnk`; did you mean `base_link`\?; it has arm, base_link, camera, gps, map, odom",
    ),
    "no frames": ("odom-base_link", tree(), r"`tf:odom-base_link` names no two frames; write tf:PARENT->CHILD"),
    "one frame": ("odom->odom", tree(), "names no two frames"),
    "no transforms": ("a->b", {}, "no topic `/tf`.*\n.*/pose"),
    "two trees": (
        "a->d",
        {"/tf": [*link("a", "b", 10, MOVING), *link("c", "d", 10, MOVING)]},
        r"nothing connects the frames `a` and `d`; it has a->b, c->d",
    ),
    "two parents": (
        "map->base",
        {"/tf": [*link("map", "base", 10, MOVING), *link("odom", "base", 10, MOVING)]},
        r"nothing connects .*; frame `base` has several parents: map->base, odom->base",
    ),
    "a circle": (
        "a->c",
        {"/tf": [*link("a", "b", 10, MOVING), *link("b", "c", 10, MOVING), *link("c", "a", 10, MOVING)]},
        r"is its own ancestor: a->b, b->c, c->a",
    ),
    "static ones alone": ("map->gps", tree(), "are static, so there is no time to compare at"),
    "no time in common": (
        "a->c",
        {"/tf": [*link("a", "b", 10, MOVING[:1]), *link("b", "c", 10, MOVING)[1:]]},
        "have no time in common",
    ),
    "none that can be used": (
        "a->b",
        {"/tf": link("a", "b", 10, np.zeros((2, 7)))},
        r"no transform of a->b can be used: 2 with a rotation of length zero or infinity",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_frames_are_one_message_with_its_line(case: str, run: Runs) -> None:
    frames, content, message = WRONG[case]
    with pytest.raises(MapError, match=r"map\.yaml:5:28: (.|\n)*" + message):
        run(content | {"/pose": still(2)}, FROM_POSE + EXPECT % ((frames, "") * 2))

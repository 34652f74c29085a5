# SPDX-License-Identifier: Apache-2.0
"""Truth as standard messages: valid and invalid `ros` lists."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

import pytest

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_sim import SimConfig, Simulation

LoadSim = Callable[..., SimConfig]
X = {"output": "ramp.outputs.x", "type": "nav_msgs/Odometry", "field": "pose.pose.position.z", "topic": "odom"}
RATE = {
    "output": "ramp.outputs.seen_rate",
    "type": "nav_msgs/Odometry",
    "field": "twist.twist.linear.z",
    "topic": "odom",
}


def mapped(*items: dict[str, Any]) -> Callable[[dict[str, Any]], None]:
    return lambda config: config.update(ros=list(items))


def test_outputs_of_one_topic_make_one_message(load_sim: LoadSim) -> None:
    frames = {"frame": "map", "child_frame": "base_link"}
    height = {"output": "altimeter.outputs.value", "type": "std_msgs/Float64", "field": "data", "topic": "/height"}
    config = load_sim(mapped(X | frames, height, RATE | frames))
    odom, other = config.ros
    assert (odom.name, odom.type, odom.frame, odom.child_frame) == ("odom", "nav_msgs/msg/Odometry", "map", "base_link")
    assert odom.instances == ("ramp",) and [s.name for s in odom.sources] == [X["output"], RATE["output"]]
    assert (other.name, other.type, other.instances) == ("/height", "std_msgs/msg/Float64", ("altimeter",))
    with Simulation(config.plan, config.tables) as sim:
        sim.sense()
        for topic in config.ros:
            assert topic.composer().compose([sim.instance_data(name) for name in topic.instances], 0) is not None


def test_without_a_list_there_are_none(load_sim: LoadSim) -> None:
    assert load_sim().ros == ()


@pytest.mark.parametrize(
    ("items", "code", "said"),
    [
        ([X | {"type": "nav_msgs/Odometri"}], "E236", "there is no message `nav_msgs/Odometri`"),
        ([X | {"field": "child_frame_id", "choices": ["a", "b"]}], "E258", "is f64, and with `choices` it is an index"),
        ([X | {"field": "pose.position.z"}], "E237", "pose"),
        ([X | {"field": "pose.pose.position"}], "E238", "pose.pose.position"),
        ([X, X], "E241", "belongs to"),
        ([X, RATE | {"frame": "map"}], "E241", "topic `odom` has two frames"),
        (
            [X, RATE | {"type": "geometry_msgs/Twist", "field": "linear.z"}],
            "E241",
            "topic `odom` has two types",
        ),
        ([X | {"output": "ramp.outputs.y"}], "E216", "`ramp` has no output `outputs.y`"),
        ([X | {"output": "ramp.inputs.rate"}], "E215", "truth is an output of a model"),
        ([X | {"output": "romp.outputs.x"}], "E206", "no instance `romp`"),
        ([X | {"topic": "no topic"}], "E203", "`no topic` is not a topic"),
        ([{key: value for key, value in X.items() if key != "topic"}], "E202", "topic"),
        ([X | {"topics": "odom"}], "E201", "unknown key `topics`"),
        ([X | {"axes": "up"}], "E205", "`axes` cannot be `up`"),
        (["odom"], "E208", "a mapping of truth is an object"),
    ],
)
def test_what_is_wrong_is_told_where_it_stands(load_sim: LoadSim, items: list[Any], code: str, said: str) -> None:
    with pytest.raises(DiagnosticError) as caught:
        load_sim(mapped(*items))
    text = str(caught.value)
    assert code in text and said in text, text
    assert "ramp.sim.json:" in text


def test_truth_as_numbers_is_truth_by_name(load_sim: LoadSim) -> None:
    config = load_sim()
    with Simulation(config.plan, config.tables) as sim:
        sim.sense()
        names, data = sim.truth_names(), sim.truth_values()
        assert len(data) == 8 * len(names) and "ramp.outputs.x" in names
        assert list(struct.unpack(f"<{len(names)}d", data)) == [float(sim.get(name)) for name in names]
        assert [sim.sampled(c.index) for c in sim.machine.channels if c.direction == "sensor"] == [True, True]
        assert not sim.sampled(10_000)

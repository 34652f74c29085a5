# SPDX-License-Identifier: Apache-2.0
"""How fast `simclient.replay --map` runs the attitude filter of examples/ahrs at 1 kHz on a bag with one IMU."""

from __future__ import annotations

import json
import math
import shutil
import time
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.rosbag2.enums import CompressionFormat, CompressionMode
from rosbags.typesys import Stores, get_typestore

from simclient.replay import replay_foreign

from ..harness.size import sized

ROOT = Path(__file__).resolve().parents[3]
TICK_HZ = 1000
SECONDS = sized(120, 2)
RATES_HZ = (100, 200, 1000)
REPEATS = sized(3, 1)
MAP = """\
channels:
  imu.gyro: /imu/data
  imu.accel: /imu/data
  reference.orientation: {topic: /imu/data, field: orientation}
"""


def _machine(folder: Path) -> Path:
    """examples/ahrs at 1 kHz."""
    shutil.copytree(ROOT / "examples/ahrs", folder / "ahrs")
    config = folder / "ahrs/ahrs.json"
    machine = json.loads(config.read_text())
    machine["tick_hz"] = TICK_HZ
    machine["states"] = {"RUN": {"schedule": dict.fromkeys(machine["instances"], TICK_HZ)}}
    config.write_text(json.dumps(machine))
    return config


def _bag(path: Path, rate_hz: int) -> Path:
    """A vehicle that rocks, as sensor_msgs/Imu in zstd chunks."""
    store = get_typestore(Stores.ROS2_JAZZY)
    types, kind = store.types, "sensor_msgs/msg/Imu"
    vector, zeros = types["geometry_msgs/msg/Vector3"], np.zeros(9)
    writer = Writer(path, version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection("/imu/data", kind, typestore=store)
        for i in range(SECONDS * rate_hz):
            time_ns = 10**18 + i * 10**9 // rate_hz
            angle = 0.2 * math.sin(i / rate_hz)
            stamp = types["builtin_interfaces/msg/Time"](sec=time_ns // 10**9, nanosec=time_ns % 10**9)
            message = types[kind](
                header=types["std_msgs/msg/Header"](stamp=stamp, frame_id="imu_link"),
                orientation=types["geometry_msgs/msg/Quaternion"](
                    x=math.sin(angle / 2), y=0.0, z=0.0, w=math.cos(angle / 2)
                ),
                orientation_covariance=zeros,
                angular_velocity=vector(x=0.2 * math.cos(i / rate_hz), y=0.0, z=0.0),
                angular_velocity_covariance=zeros,
                linear_acceleration=vector(x=0.0, y=9.81 * math.sin(angle), z=9.81 * math.cos(angle)),
                linear_acceleration_covariance=zeros,
            )
            writer.write(connection, time_ns, store.serialize_cdr(message, kind))
    return path


def replay_map(folder: Path) -> dict[str, Any]:
    """Seconds of the bag per second, reading included, by the IMU's rate; best of REPEATS.

    `plain` writes nothing; `recorded` writes a bag with every output of every tick, and makes its digest.
    """
    config, chart = _machine(folder), folder / "map.yaml"
    chart.write_text(MAP)
    figures: dict[str, Any] = {"tick_hz": TICK_HZ, "bag_s": SECONDS}
    for rate_hz in RATES_HZ:
        bag = _bag(folder / f"imu{rate_hz}", rate_hz)
        replay_foreign(bag, chart, config=str(config))  # builds the machine
        for name in ("plain", "recorded"):
            best = math.inf
            for repeat in range(REPEATS):
                output = folder / f"out{rate_hz}_{repeat}" if name == "recorded" else None
                begun = time.perf_counter()
                replay_foreign(bag, chart, config=str(config), output=output)
                best = min(best, time.perf_counter() - begun)
                if output:
                    shutil.rmtree(output)
            figures.setdefault(f"imu_{rate_hz}_hz", {})[name] = SECONDS / best
    return figures

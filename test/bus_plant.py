# SPDX-License-Identifier: Apache-2.0
"""A simulator of the lander on the bus, which needs nothing of FCSL. docs/reference/transports.md, "Named values", has keys and bytes.

`python3 bus_plant.py tcp/127.0.0.1:7447`, and `fcsl-fc liblander_control.so --hal zenoh:tcp:127.0.0.1:7447`.
"""

import queue
import struct
import sys
import zlib

import zenoh

# The rows of the channels (docs/reference/transports.md): id, direction, type, number of values.
TABLE = zlib.crc32(struct.pack("<" + 3 * "HBBI", 1, 0, 6, 1, 2, 0, 6, 1, 16, 1, 6, 1))
config = zenoh.Config.from_json5('{mode: "peer", scouting: {multicast: {enabled: false}}}')
config.insert_json5("listen/endpoints", f'["{sys.argv[1]}"]')
came: dict[str, queue.Queue[bytes]] = {name: queue.Queue() for name in ("@control", "throttle", "tick")}
with zenoh.open(config) as bus:

    def put(name: str, data: bytes) -> None:
        bus.put(f"lander_control/{name}", data, congestion_control=zenoh.CongestionControl.BLOCK)

    def heard(sample: zenoh.Sample) -> None:
        came[str(sample.key_expr).rpartition("/")[2]].put(bytes(sample.payload))

    for name in came:
        bus.declare_subscriber(f"lander_control/{name}", heard, allowed_origin=zenoh.Locality.REMOTE)
    token = bus.liveliness().declare_token(f"lander_control/@simulator/{bus.zid()}")
    hello = came["@control"].get(timeout=60)
    put("@control", hello[:7] + b"\1" + hello[8:])  # the same hello, of one that sends the time
    height, speed, mass, flown, tick = 0.0, 0.0, 500.0, False, 0
    while not (flown and height <= 0.0) and tick < 12000:
        put("altitude", struct.pack("<d", height))
        put("velocity", struct.pack("<d", speed))
        put("tick", struct.pack("<QQIBBHB", tick, tick * 10_000_000, TABLE, 0, 0, 3, 0b011))
        throttle, commit = came["throttle"].get(timeout=10), came["tick"].get(timeout=10)
        thrust = 2000.0 * min(max(struct.unpack("<d", throttle)[0], 0.0), 1.0) if commit[21] else 0.0  # armed
        for _ in range(10):  # of 1 ms
            height, speed = height + 0.001 * speed, speed + 0.001 * (thrust / mass - 1.62)
            mass -= 0.001 * thrust / (220.0 * 9.80665)
            if height <= 0.0 and speed <= 0.0 and not flown:
                height = speed = 0.0  # it stands on the ground
        flown, tick = flown or height > 1.0, tick + 1
    put("@control", b"FCSW\1\0\3" + bytes(13))  # the run is over
    print(f"touchdown at {-speed:.2f} m/s after {tick} ticks")

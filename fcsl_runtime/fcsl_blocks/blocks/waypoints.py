# SPDX-License-Identifier: Apache-2.0
"""A mission of points in space, one after the other."""

from fcsl_builtins import clamp, dot, f64, hypot, isfinite, min
from logic import reached

#: Least cosine of a turn that counts as one of at most 90 deg, for the rounding of right angles.
RIGHT_ANGLE = -1e-6


def length(v: "f64[3]") -> f64:
    """|v|, without overflow on the way."""
    return hypot(hypot(v[0], v[1]), v[2])


def direction(v: "f64[3]") -> "f64[3]":
    """v / |v|, or v where that is zero."""
    size = length(v)
    return v / size if size > 0.0 else v


class WaypointSequencer:
    """The active waypoint of a mission in space: which one, the leg to it, the distances, and when the mission is done.

    q = direction from `previous` to the active waypoint w, p = direction from w to the one after it
    plane through w: normal q + p, which bisects a corner of at most 90 deg; at a sharper one normal q, across the leg
    arrived at w: |position - w| <= acceptance_radius; or, with pass_plane and no dwell at w, (position - w) . normal >= 0
    along_track = (position - previous) . q, cross_track = |position - previous - along_track q|
    distance = |w - position|, remaining = distance + the lengths of the legs from w to the last waypoint

    The mission is the first `count` of n waypoints. Having arrived, and stayed active for dwell[index], w becomes
    `previous`, and the one after it active, in the same run; at most one in each run. Once arrived, the time counts, even
    if the vehicle is blown away. After the last one, the first follows with `loop`; without, the last one stays active, and
    `done` becomes true. A count that is raised then leads on. Waypoints may change in flight, but for `previous`, which is
    where the leg began. A leg without length counts as passed.

    The mission begins at the first waypoint. With `jump`, jump_to becomes active in this run: with jump_to = 0 the mission
    begins anew. In the first run after a break (`resumed`) the active waypoint stays, for a mission that was interrupted;
    for one that begins anew, connect machine.resumed to `jump`, too. In both cases the leg begins at the position of that
    run, and a dwell from its beginning. A changed period counts from the next run on.

    Source: R. Beard, T. McLain, "Small Unmanned Aircraft", ch. 11, algorithm 5 (half planes), as implemented in
    holdenaaron93/UAS, followWpp.m; PX4-Autopilot, src/modules/navigator/mission_block.cpp (radius, plane across the leg,
    time that counts from the arrival). At a sharp corner the bisecting plane lies nearly along the leg, and would be passed
    long before w.
    Limits: legs are straight lines, not great circles. A vehicle that moves more than 2 acceptance_radius in a period needs
    pass_plane. Where waypoints are nearer to one another than acceptance_radius, one of them goes by in each run. A jump_to
    outside of 0..count-1 is clamped, as is the active waypoint where count falls, which begins a leg at the position. If
    the position, or a waypoint or dwell of what remains, is not finite, a distance overflows or count < 1, the run is
    passed over: outputs and times stay, health is degraded, and a start or a jump waits.
    """

    inputs = {
        "position": "f64[3] m",  # in the frame of the waypoints
        "waypoints": "f64[n][3] m",
        "dwell": "f64[n] s",  # how long to stay at each
        "count": "i32",  # waypoints in use; at most n
        "jump": "bool",  # make jump_to active
        "jump_to": "i32",  # index, from 0
        "period": "f64 s",  # machine.period
        "resumed": "bool",  # machine.resumed
    }
    parameters = {
        "acceptance_radius": "f64 m in 0..",
        "pass_plane": "bool = true",  # passing a waypoint is arriving, where there is no dwell
        "loop": "bool = false",  # the first waypoint follows the last one
    }
    outputs = {
        "index": "i32",  # of the active waypoint, from 0
        "target": "f64[3] m",  # the active waypoint
        "previous": "f64[3] m",  # where the leg to it begins
        "along_track": "f64 m",  # way along the leg, from `previous`
        "cross_track": "f64 m",  # distance from the line of the leg, not negative
        "distance": "f64 m",  # to the active waypoint
        "remaining": "f64 m",  # to the last waypoint, along the legs
        "dwelling": "bool",  # arrived, and waiting for the end of the dwell
        "done": "bool",  # arrived at the last waypoint, and its dwell is over
    }
    state = {
        "begins": "bool",  # the leg begins at the position of the next run
        "jumps": "bool",  # a jump is to be made
        "goal": "i32",  # where to
        "arrived": "bool",  # at the active waypoint
        "waited": "f64 s",  # since then, at the next run
    }

    def execute(self):
        self.begins = self.begins or self.resumed
        if self.jump:
            self.jumps = True
            self.goal = self.jump_to
        count = min(self.count, len(self.waypoints))
        if count < 1:
            self.health = "degraded"
            return
        index = clamp(self.goal if self.jumps else self.index, 0, count - 1)
        fresh = self.begins or self.jumps or index != self.index
        previous = self.position if fresh else self.previous
        arrived = self.arrived and not fresh
        waited = self.waited
        target = self.waypoints[index]
        dwell = self.dwell[index]
        after = index + 1 if index + 1 < count else 0
        goes_on = after > 0 or self.loop
        away = self.position - target
        known = isfinite(dwell) and isfinite(length(target - previous))
        if not arrived:
            q = direction(target - previous)
            p = direction(self.waypoints[after] - target) if goes_on else q
            normal = q + p if dot(p, q) > RIGHT_ANGLE and dot(q, q) > 0.0 else q
            passed = self.pass_plane and dwell <= 0.0 and dot(away, normal) >= 0.0
            arrived = length(away) <= self.acceptance_radius or passed
            waited = 0.0
        over = arrived and reached(waited, dwell, self.period)
        waited += self.period
        if over and goes_on:
            previous = target
            index = after
            target = self.waypoints[index]
            arrived = False

        known = known and isfinite(length(target - previous))
        leg = direction(target - previous)
        rel = self.position - previous
        along = dot(rel, leg)
        cross = length(rel - along * leg)
        distance = length(target - self.position)
        remaining = distance
        for i in range(len(self.waypoints) - 1):
            if i >= index and i + 1 < count:
                remaining += length(self.waypoints[i + 1] - self.waypoints[i])
        if not (known and isfinite(along) and isfinite(cross) and isfinite(remaining)):
            self.health = "degraded"
            return
        self.begins = False
        self.jumps = False
        self.arrived = arrived
        self.waited = waited
        self.index = index
        self.target = target
        self.previous = previous
        self.along_track = along
        self.cross_track = cross
        self.distance = distance
        self.remaining = remaining
        self.dwelling = arrived and not over
        self.done = over and not goes_on

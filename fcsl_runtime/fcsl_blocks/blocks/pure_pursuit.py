# SPDX-License-Identifier: Apache-2.0
"""Following a path of points on the ground."""

from fcsl_builtins import all, clamp, copysign, cos, hypot, inf, isfinite, min, sin, sqrt


class PurePursuit:
    """Pure pursuit: the curvature that leads a vehicle along a path of straight segments, and its distance from it.

    L = clamp(lookahead_time |speed|, lookahead_min, lookahead_max)
    goal = the first point of the path beyond the nearest one at the distance L; else the nearest or the last point
    curvature = 2 y / d^2    (d: distance to the goal, y: its part to the left; the arc that is tangent to the heading)
    yaw_rate = curvature speed

    The path is the first `count` of n points. The nearest point is looked for from that of the run before (`progress`)
    to at most search_distance further, so that paths may cross themselves; it never goes back. In the first run, after a
    break (`resumed`) and with `restart`, it is looked for on the whole path: set restart with each new path. Where the
    whole path is further away than L, the goal is the nearest point; near the end, where the path is shorter than L, it is
    the last one. `done` is true where at most goal_tolerance of the path remains, at whatever cross_track from it; then, and
    without points (count = 0), curvature and yaw_rate are 0. The period makes no difference.

    Source: PythonRobotics, PathTracking/pure_pursuit/pure_pursuit.py (2 sin(angle) / L, nearest point that goes on,
    lookahead with speed); MathWorks, "Pure Pursuit Controller" (use, lookahead). The goal is the intersection of a circle
    with a segment: |a + t (b - a) - position| = L, the greater root t.
    Limits: corners are cut, within about L. A goal behind the vehicle is reached by a wide arc, one exactly behind not at
    all. A closed path needs a search_distance, or its end is as near as its beginning. Speeds are forward: with a
    negative one yaw_rate keeps the curvature, but the vehicle leaves the path. If an input or a point of the path is not
    finite, or its length overflows, the run is passed over: outputs stay, health is degraded, and a start waits.
    """

    inputs = {
        "position": "f64[2] m",  # x, y of the vehicle; of a car, of its rear axle
        "heading": "f64 rad",  # counterclockwise from x
        "speed": "f64 m/s",  # forward
        "path": "f64[n][2] m",  # x, y of the points
        "count": "i32",  # points in use; clamped to 0..n
        "restart": "bool",  # look for the nearest point on the whole path
        "resumed": "bool",  # machine.resumed
    }
    parameters = {
        "lookahead_time": "f64 s in 0.. = 0",  # lookahead per speed
        "lookahead_min": "f64 m in 1e-6..",  # least lookahead, that of a vehicle at rest
        "lookahead_max": "f64 m in 1e-6.. = 1e308",
        "search_distance": "f64 m in 0.. = 1e308",  # how far along the path the nearest point may go in a run
        "max_curvature": "f64 1/m in 0.. = 1e308",
        "goal_tolerance": "f64 m in 0.. = 0.1",
    }
    outputs = {
        "curvature": "f64 1/m",  # positive to the left
        "yaw_rate": "f64 rad/s",  # at this speed
        "goal": "f64[2] m",  # where the arc leads
        "cross_track": "f64 m",  # distance from the path, positive where the vehicle is left of it
        "progress": "f64 m",  # of the nearest point, along the path
        "remaining": "f64 m",  # from there to the end of the path
        "done": "bool",  # at the end
        "saturated": "bool",  # max_curvature is active
    }
    state = {"begun": "bool"}  # progress is of this path, since the last break

    def execute(self):
        if self.resumed or self.restart:
            self.begun = False
        count = clamp(self.count, 0, len(self.path))
        total = 0.0
        for i in range(len(self.path) - 1):
            if i + 1 < count:
                total += hypot(self.path[i + 1, 0] - self.path[i, 0], self.path[i + 1, 1] - self.path[i, 1])

        # the nearest point between least and most along the path, at progress
        least = 0.0
        most = inf
        if self.begun:
            least = min(self.progress, total)
            most = least + self.search_distance
        start = 0.0
        best = inf
        side = 0.0
        progress = least
        nearest = self.path[0] if count > 0 else self.position
        for i in range(len(self.path) - 1):
            if i + 1 < count:
                way = self.path[i + 1] - self.path[i]
                length = hypot(way[0], way[1])
                if length > 0.0 and start <= most and start + length >= least:
                    along = way / length
                    rel = self.position - self.path[i]
                    t = clamp(rel[0] * along[0] + rel[1] * along[1], 0.0, length)
                    t = clamp(t, least - start, min(most - start, length))
                    foot = self.path[i] + t * along
                    distance = hypot(self.position[0] - foot[0], self.position[1] - foot[1])
                    if distance < best:
                        best = distance
                        progress = start + t
                        nearest = foot
                        side = along[0] * rel[1] - along[1] * rel[0]
                start += length

        # where the path leaves the circle around the vehicle
        reach = clamp(self.lookahead_time * abs(self.speed), self.lookahead_min, self.lookahead_max)
        goal = nearest
        found = best >= reach
        start = 0.0
        for i in range(len(self.path) - 1):
            if i + 1 < count:
                way = self.path[i + 1] - self.path[i]
                length = hypot(way[0], way[1])
                if not found and length > 0.0 and start + length >= progress:
                    along = way / length
                    rel = self.path[i] - self.position
                    middle = -(rel[0] * along[0] + rel[1] * along[1])
                    across = rel[0] * along[1] - rel[1] * along[0]
                    t = middle + sqrt(reach * reach - across * across)
                    if t <= length:
                        goal = self.path[i] + t * along
                        found = True
                    else:
                        goal = self.path[i + 1]
                start += length

        ahead = goal - self.position
        distance = hypot(ahead[0], ahead[1])
        left = cos(self.heading) * ahead[1] - sin(self.heading) * ahead[0]
        end = total - progress
        done = end <= self.goal_tolerance
        wanted = 0.0 if done or distance == 0.0 else 2.0 * (left / distance) / distance
        curvature = clamp(wanted, -self.max_curvature, self.max_curvature)
        yaw_rate = curvature * self.speed
        offset = hypot(self.position[0] - nearest[0], self.position[1] - nearest[1])
        if not (all(isfinite(ahead)) and isfinite(left) and isfinite(yaw_rate) and isfinite(end) and isfinite(offset)):
            self.health = "degraded"
            return
        self.begun = True
        self.curvature = curvature
        self.yaw_rate = yaw_rate
        self.goal = goal
        self.cross_track = copysign(offset, side)
        self.progress = progress
        self.remaining = end
        self.done = done
        self.saturated = curvature != wanted

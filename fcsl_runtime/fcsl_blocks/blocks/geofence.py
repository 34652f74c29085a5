# SPDX-License-Identifier: Apache-2.0
"""A fence around the volume in which a vehicle may be."""

from fcsl_builtins import all, clamp, hypot, inf, isfinite, min


class Geofence:
    """A polygon on the ground with floor and ceiling: whether a vehicle is inside, how far from the border, and warnings.

    inside the polygon: an odd number of its edges crosses the ray from the position toward +x
    distance = +-|position - nearest|    (nearest: the nearest point of all edges; + inside the polygon, - outside)
    vertical_distance = min(altitude - floor, ceiling - altitude)
    clearance = min(distance, vertical_distance), inside = clearance >= 0
    breached becomes true where clearance < 0, and false again where clearance >= hysteresis
    warning becomes true where clearance < warning_distance, false where clearance >= warning_distance + hysteresis

    The polygon has the first `count` of n vertices, either way round, convex or not; the last one is connected with the
    first, which may be repeated. The way back to an outside vehicle is nearest - position. In the first run after a break
    (`resumed`), breached and warning begin anew, without the hysteresis of before. The period makes no difference.

    Source: PX4-Autopilot, src/modules/navigator/geofence.cpp, and ArduPilot, libraries/AP_Math/polygon.cpp (crossings of a
    ray, after W. R. Franklin's PNPOLY); ArduPilot, libraries/AC_Avoidance/AP_OABendyRuler.cpp (distance with a negative sign
    outside). Here the sign of a cross product tells on which side of the position an edge crosses the ray.
    Limits: a plane, not the globe. Where edges cross one another, the even-odd rule holds: what is enclosed twice is outside.
    A count below 3 encloses nothing: breached, as a fence that nobody has loaded; one above n counts as n. On the border
    itself, `inside` may be either within a few roundings. Outside of polygon and altitudes at once, clearance is the worse of
    both distances, not the way back. floor above ceiling: always breached. Between two runs a vehicle may pass a narrow
    polygon unseen. If an input is not finite or a distance overflows, the run is passed over: outputs stay, health is
    degraded, and a start waits; act on the health, too. Until the first run that is not, breached and warning are true.
    """

    inputs = {
        "position": "f64[2] m",  # x, y
        "altitude": "f64 m",  # positive upward
        "polygon": "f64[n][2] m",  # x, y of the vertices
        "count": "i32",  # vertices in use
        "resumed": "bool",  # machine.resumed
    }
    parameters = {
        "floor": "f64 m = -1e308",  # least altitude
        "ceiling": "f64 m = 1e308",  # greatest altitude
        "warning_distance": "f64 m in 0.. = 0",  # clearance below which there is a warning
        "hysteresis": "f64 m in 0.. = 0",  # further inside than where breached or warning began, they end
    }
    outputs = {
        "inside": "bool",  # of polygon and altitudes, without hysteresis
        "distance": "f64 m",  # from the border of the polygon, positive inside
        "nearest": "f64[2] m",  # nearest point of the border
        "vertical_distance": "f64 m",  # from floor or ceiling, positive between them
        "clearance": "f64 m",  # the lesser of both distances
        "breached": "bool",
        "warning": "bool",  # too near to the border, or outside
    }
    state = {"begun": "bool"}  # since the last break there was a run with finite inputs

    def start(self):
        self.breached = True
        self.warning = True

    def execute(self):
        self.begun = self.begun and not self.resumed
        count = clamp(self.count, 1, len(self.polygon))
        best = inf
        way = [0.0, 0.0]  # to the nearest point
        odd = False
        length = 0.0  # of all edges: not finite if a vertex is not
        start = self.polygon[count - 1] - self.position
        for i in range(len(self.polygon)):
            if i < count:
                end = self.polygon[i] - self.position
                edge = end - start
                size = hypot(edge[0], edge[1])
                along = edge / size if size > 0.0 else edge
                t = clamp(-(start[0] * along[0] + start[1] * along[1]), 0.0, size)
                foot = start + t * along
                distance = hypot(foot[0], foot[1])
                if distance < best:
                    best = distance
                    way = foot
                if (start[1] > 0.0) != (end[1] > 0.0):
                    across = start[0] * along[1] - start[1] * along[0]
                    odd = odd != ((across > 0.0) == (end[1] > 0.0))
                length += size
                start = end

        nearest = self.position + way
        vertical = min(self.altitude - self.floor, self.ceiling - self.altitude)
        if not (isfinite(best) and isfinite(length) and isfinite(vertical) and all(isfinite(nearest))):
            self.health = "degraded"
            return
        self.distance = best if odd else 0.0 - best
        self.nearest = nearest
        self.vertical_distance = vertical
        self.clearance = min(self.distance, vertical)
        empty = self.count < 3
        self.inside = self.clearance >= 0.0 and not empty
        more = self.hysteresis if self.begun else 0.0
        self.breached = empty or self.clearance < (more if self.breached else 0.0)
        self.warning = empty or self.clearance < self.warning_distance + (more if self.warning else 0.0)
        self.begun = True

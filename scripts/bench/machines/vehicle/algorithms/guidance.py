from fcsl_builtins import norm

COUNT = 4


class Guidance:
    """Flies a closed tour of waypoints at a constant speed."""

    inputs = {"north": "f64", "east": "f64", "up": "f64"}
    outputs = {"velocity": "f64[3]"}
    parameters = {
        "waypoints": "f64[COUNT][3]",
        "speed": "f64",
        "reach": "f64",  # a waypoint nearer than this is passed
    }
    state = {"next": "u32"}

    def execute(self):
        to = self.waypoints[self.next] - [self.north, self.east, self.up]
        distance = norm(to)
        if distance < self.reach:
            self.next = (self.next + 1) % COUNT
            self.velocity = [0.0, 0.0, 0.0]
        else:
            self.velocity = to * (self.speed / distance)

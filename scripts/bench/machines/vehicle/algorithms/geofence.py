from fcsl_builtins import sqrt


class Geofence:
    """Asks for a landing when the vehicle is too far away."""

    inputs = {"north": "f64", "east": "f64"}
    outputs = {"distance": "f64", "transition_request": "TransitionRequest"}
    parameters = {"radius": "f64"}

    def execute(self):
        self.distance = sqrt(self.north * self.north + self.east * self.east)
        if self.distance > self.radius:
            self.transition_request = "LAND"

class Route:
    """Owns the route: n points, of which the first `used` are one, and where the rover is on the ground."""

    inputs = {"position": "f64[3] m"}
    parameters = {"points": "f64[n][2] m", "used": "i32 in 0.."}
    outputs = {"path": "f64[n][2] m", "count": "i32", "place": "f64[2] m"}

    def execute(self):
        self.path = self.points
        self.count = self.used
        self.place = self.position[0:2]

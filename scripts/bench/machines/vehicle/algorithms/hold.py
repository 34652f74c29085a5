class Hold:
    """The pilot's sticks are velocities."""

    inputs = {"sticks": "f64[4]"}
    outputs = {"velocity": "f64[3]"}
    parameters = {"speed": "f64"}

    def execute(self):
        self.velocity = self.speed * self.sticks[0:3]

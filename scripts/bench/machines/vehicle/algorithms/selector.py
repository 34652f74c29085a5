class Selector:
    """The velocity asked for by whichever block runs in this state."""

    inputs = {
        "mission": "f64[3]",
        "mission_health": "Health",
        "landing": "f64[3]",
        "landing_health": "Health",
        "hold": "f64[3]",
        "hold_health": "Health",
    }
    outputs = {"velocity": "f64[3]"}

    def execute(self):
        if self.mission_health != "stale":
            self.velocity = self.mission
        elif self.landing_health != "stale":
            self.velocity = self.landing
        elif self.hold_health != "stale":
            self.velocity = self.hold
        else:
            self.velocity = [0.0, 0.0, 0.0]

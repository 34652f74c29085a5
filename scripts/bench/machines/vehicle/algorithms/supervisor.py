class Supervisor:
    """Asks for a landing when the pilot or the battery does; below 1 V there is no battery."""

    inputs = {"switch": "f64", "voltage": "f64"}
    outputs = {"low": "bool", "transition_request": "TransitionRequest"}
    parameters = {"empty": "f64"}

    def execute(self):
        self.low = 1.0 < self.voltage < self.empty
        if self.low or self.switch > 0.5:
            self.transition_request = "LAND"
        elif self.switch < -0.5:
            self.transition_request = "HOLD"

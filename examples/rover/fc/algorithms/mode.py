BY_HAND = 1
ROUTE = 2


class Mode:
    """Owns the state of the rover, and whether its wheels are armed.

    It begins locked. An emergency stop, lost switches, lost or unusable encoders, and a fault of what makes the commands
    disarm and lock: the switch must be at 0, with nothing wrong, before anything moves again. Without word from the
    operator, driving by hand stops. The wheels are armed only while `drive` runs: its commands are then of this state.
    """

    inputs = {
        "wanted": "i32",
        "stop": "bool",
        "switches": "Health",
        "operator": "Health",
        "wheels": "Health",
        "odometry": "Health",  # not nominal: an encoder gives no number
        "command": "Health",  # of the tick before, as that of drive
        "drive": "Health",
    }
    outputs = {"armed": "bool", "by_hand": "bool", "transition_request": "TransitionRequest"}
    state = {"locked": "bool"}

    def start(self):
        self.locked = True

    def execute(self):
        lost = self.switches == "failed" or self.wheels == "failed" or self.odometry != "nominal"
        if self.stop or lost or self.command == "failed" or self.drive == "failed":
            self.locked = True
        elif self.wanted == 0 and self.switches == "nominal":
            self.locked = False
        self.by_hand = not self.locked and self.wanted == BY_HAND and self.operator == "nominal"
        self.armed = not self.locked and self.drive == "nominal"
        if self.locked:
            self.transition_request = "EMERGENCY"
        elif self.by_hand:
            self.transition_request = "MANUAL"
        elif self.wanted == ROUTE:
            self.transition_request = "FOLLOW"
        else:
            self.transition_request = "STOP"

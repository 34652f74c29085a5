BY_HAND = 1
ROUTE = 2


class Mode:
    """Owns the state of the rover, and whether its wheels are armed.

    An emergency stop, lost switches or lost encoders disarm in the same tick and lock: the switch must be at 0, with
    nothing wrong, before anything moves again. Without word from the operator, driving by hand stops.
    """

    inputs = {
        "wanted": "i32",
        "stop": "bool",
        "switches": "Health",
        "operator": "Health",
        "wheels": "Health",
    }
    outputs = {
        "armed": "bool",
        "by_hand": "bool",  # the operator's speeds count, where no route does
        "transition_request": "TransitionRequest",
    }
    state = {"locked": "bool"}

    def execute(self):
        wrong = self.stop or self.switches == "failed" or self.wheels == "failed"
        if wrong:
            self.locked = True
        elif self.wanted == 0:
            self.locked = False
        self.by_hand = not self.locked and self.wanted != 0 and self.operator != "failed"
        self.armed = not self.locked
        if self.locked:
            self.transition_request = "EMERGENCY"
        elif self.wanted == ROUTE:
            self.transition_request = "FOLLOW"
        elif self.wanted == BY_HAND and self.by_hand:
            self.transition_request = "MANUAL"
        else:
            self.transition_request = "STOP"

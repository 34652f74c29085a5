"""Who flies. Each algorithm runs in the state that it leads out of."""

from rc import MODE, ON, STICKS


class Engage:
    """MANUAL → AUTO: on the rising edge of the mode switch, and in the air when the remote control is lost."""

    inputs = {
        "sticks": "f64[8]",
        "rc_valid": "bool",
        "rc_lost": "bool",
        "on_ground": "bool",
        "resumed": "bool",
    }
    outputs = {"transition_request": "TransitionRequest"}
    state = {"switch_was": "bool"}

    def execute(self):
        switch = self.sticks[MODE] > ON
        rises = switch and not self.switch_was and not self.resumed
        self.switch_was = switch
        if (rises and self.rc_valid) or (self.rc_lost and not self.on_ground):
            self.transition_request = "AUTO"


class Takeover:
    """AUTO → MANUAL: by the mode switch, or by a stick that moves from where it was when AUTO began.

    A remote control that is silent takes nothing over. When it is back, its sticks count from where they are then.
    """

    inputs = {"sticks": "f64[8]", "rc_valid": "bool", "resumed": "bool"}
    outputs = {"transition_request": "TransitionRequest"}
    parameters = {"stick_moves": "f64 in 0..2"}
    state = {"sticks_were": "f64[4]", "was_valid": "bool"}

    def execute(self):
        if self.resumed or not self.was_valid:
            self.sticks_were = self.sticks[0:4]
        moved = False
        for stick in range(STICKS):
            if abs(self.sticks[stick] - self.sticks_were[stick]) > self.stick_moves:
                moved = True
        self.was_valid = self.rc_valid
        if self.rc_valid and (moved or not self.sticks[MODE] > ON):
            self.transition_request = "MANUAL"

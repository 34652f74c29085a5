TRANSITION = 0
NOMINAL = 1
MANEUVER = 2
STANDBY = 3

GOOD = 0
CHANGING = 1
FAULT = 2


class Panel:
    outputs = {"standby": "bool", "apfail": "bool", "supported": "bool", "limits": "bool"}

    def execute(self):
        pass


class Autopilot:
    inputs = {"standby": "bool", "apfail": "bool", "supported": "bool", "good": "bool"}
    outputs = {"mode": "i32", "active": "bool", "request": "bool", "pullup": "bool"}

    def execute(self):
        if self.mode == TRANSITION:
            if self.standby:
                self.mode = STANDBY
            elif self.supported and self.good:
                self.mode = NOMINAL
        elif self.mode == NOMINAL:
            if self.standby:
                self.mode = STANDBY
            elif not self.good:
                self.mode = MANEUVER
        elif self.mode == MANEUVER:
            if self.standby and self.good:
                self.mode = STANDBY
            elif self.supported and self.good:
                self.mode = TRANSITION
        elif self.apfail:
            self.mode = MANEUVER
        elif not self.standby:
            self.mode = TRANSITION
        self.active = self.mode != TRANSITION
        self.request = self.mode == TRANSITION or self.mode == NOMINAL
        self.pullup = self.mode == MANEUVER


class Sensor:
    inputs = {"limits": "bool", "active": "bool", "request": "bool"}
    outputs = {"mode": "i32", "good": "bool"}

    def execute(self):
        if self.mode == GOOD:
            if self.limits:
                self.mode = FAULT
            elif not self.request:
                self.mode = CHANGING
        elif self.mode == CHANGING:
            if self.active and self.request:
                self.mode = GOOD
        elif not self.request or not self.limits:
            self.mode = CHANGING
        self.good = self.mode != FAULT

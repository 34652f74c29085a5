from fcsl_builtins import abs, max


class Triplex:
    """Compares three redundant signals, latches the branch that fails (1: C, 2: B, 4: A) and selects a value.

    Two signals that differ by more than `trip` miscompare. Of two such pairs one branch is common: when they have
    miscompared for more than `limit` ticks, that branch has failed.
    """

    inputs = {"a": "f64", "b": "f64", "c": "f64"}
    outputs = {"persistence": "i32", "total": "i32", "failed": "i32", "selected": "f64"}
    parameters = {"trip": "f64", "limit": "i32"}

    def execute(self):
        ab = abs(self.a - self.b) > self.trip
        bc = abs(self.b - self.c) > self.trip
        ac = abs(self.a - self.c) > self.trip
        if ab and bc and ac:
            self.total += 1
        elif (ab and bc) or (ab and ac) or (bc and ac):
            if self.persistence <= self.limit:
                self.persistence += 1
                self.total += 1
            else:
                self.persistence = 0
                self.failed = 1 if not ab else 2 if not ac else 4
        elif not (ab or bc or ac):
            self.persistence = max(self.persistence - 1, 0)
        if self.failed == 0:
            mean = (self.a + self.b + self.c) / 3.0
            nearer = self.b if abs(self.a - mean) > abs(self.b - mean) else self.a
            self.selected = self.c if abs(nearer - mean) > abs(self.c - mean) else nearer
        elif self.failed == 1:
            self.selected = (self.a + self.b) / 2.0
        elif self.failed == 2:
            self.selected = (self.a + self.c) / 2.0
        else:
            self.selected = (self.b + self.c) / 2.0

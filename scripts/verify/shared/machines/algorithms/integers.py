from fcsl_builtins import f32, f64, i32, i64, sat_i32, sat_i64, sat_u32, sat_u64, u32, u64, wrap_add, wrap_i32, wrap_u32


class Integers:
    """Integers of every width, and between integers and floats.

    Processors without such instructions compute them by hand.
    """

    inputs = {
        "a": "i64",
        "b": "i64",
        "c": "i32",
        "d": "i32",
        "e": "u64",
        "f": "u64",
        "g": "u32",
        "x": "f64",
        "s": "f32",
        "shift": "i32",
    }
    outputs = {
        "floats": "f64[6]",
        "narrow": "f32[4]",
        "wide": "i64[4]",
        "words": "i32[4]",
        "natural": "u64[6]",
        "half": "u32[4]",
        "ran": "i64",
    }

    def execute(self):
        self.floats = [f64(self.a), f64(self.e), f64(self.c), f64(self.g), f64(self.s), f64(f32(self.x))]
        self.narrow = [f32(self.a), f32(self.e), f32(self.c), f32(self.g)]
        self.wide = [sat_i64(self.x), sat_i64(self.s), wrap_add(self.a, self.b), self.a >> 7]
        self.words = [sat_i32(self.x), sat_i32(self.s), wrap_i32(self.a), self.c >> 3]
        self.natural = [
            sat_u64(self.x),
            sat_u64(self.s),
            self.e * self.f,
            (self.e << 5) | (self.f >> 3),
            self.e ^ self.f,
            ~self.e,
        ]
        self.half = [sat_u32(self.x), sat_u32(self.s), wrap_u32(self.a), self.g * 2654435761]
        self.ran = wrap_add(self.ran, 1)
        # A fault from here on leaves all of the above as it was.
        self.natural[5] = (self.e // self.f) ^ (self.e % self.f) ^ (self.e >> self.shift)
        self.wide[3] = self.a // self.b + self.a % self.b
        self.words[3] = self.c // self.d - self.c % self.d
        self.wide[2] = i64(self.x) + i64(self.s)
        self.words[2] = i32(self.x)
        self.half[3] = u32(self.x)
        self.natural[4] = u64(self.s)

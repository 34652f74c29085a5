class Block:
    """A source block with every scalar type, written by the host."""

    outputs = {
        "vec": "f64[3]",
        "quat": "f64[4]",
        "real": "f64 m/s",  # a speed
        "big": "i64",
        "long_word": "u64",
        "single": "f32",
        "grid": "f32[2][3]",
        "small": "i32",
        "word": "u32",
        "flag": "bool",
    }

    def execute(self):
        pass

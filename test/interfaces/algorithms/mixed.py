class Mixed:
    """Every type that a message can hold."""

    outputs = {
        "flag": "bool",  # »schräg« → π ≈ 3.14 🚀 # a second hash
        "counts": "i32[5]",  # "double", 'single', `back` \n \t \" \\ \u0041
        "wide": "i64 Pa",  # @(1 / 0) @{x} @[if True] @# ${HOME} $<1:x> %s %(y)d {brace} {{double}}
        "mask": "u32",  # */ /* // <b>&amp;</b> ]]> ==== MSG: other/Name ====
        "big": "u64",  # uint8 FAKE=1
        "ratio": "f32[2][3] 1/s",  # rows, columns
        "cube": "f64[2][3][4] m/s^2",
        "last": "f64",  # a;list;of;cmake [brackets] "quoted;list"
        "modes": "Health[2][2]",  # rows, columns
        "after": "TransitionRequest",
        "transition_request": "TransitionRequest",
    }

    def start(self):
        """A host writes these, and what it wrote stays."""
        self.counts = [0, 0, 0, 0, 0]
        self.wide = 0
        self.mask = 0
        self.ratio = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
        self.cube[0][0][0] = 0.0
        self.last = 0.0
        self.modes = [["nominal", "nominal"], ["nominal", "nominal"]]
        self.after = ""

    def execute(self):
        self.flag = not self.flag
        self.big += 1
        if self.big == 7:
            self.transition_request = "STOP_NOW"
        if self.big == 9:
            self.transition_request = "GoOn"

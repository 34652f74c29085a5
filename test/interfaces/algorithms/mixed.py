"""Every type that a message can hold."""


class Outputs:
    flag: bool  # »schräg« → π ≈ 3.14 🚀 # a second hash
    counts: "i32[5]"  # "double", 'single', `back` \n \t \" \\ \u0041
    wide: "i64 Pa"  # @(1 / 0) @{x} @[if True] @# ${HOME} $<1:x> %s %(y)d {brace} {{double}}
    mask: u32  # */ /* // <b>&amp;</b> ]]> ==== MSG: other/Name ====
    big: u64  # uint8 FAKE=1
    ratio: "f32[2, 3] 1/s"  # rows, columns
    cube: "f64[2, 3, 4] m/s^2"
    last: f64  # a;list;of;cmake [brackets] "quoted;list"


def execute(y: Outputs) -> None:
    y.flag = not y.flag
    y.big += 1
    if y.big == 7:
        y.transition_request = TransitionRequest.STOP_NOW
    if y.big == 9:
        y.transition_request = TransitionRequest.GoOn

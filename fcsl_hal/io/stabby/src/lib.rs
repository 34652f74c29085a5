//! What Zenoh uses of `stabby`: the type of three strings that a program and a plugin compare. FCSL loads no plugins, so their
//! layout in memory need not be stable.

pub mod str {
    pub type Str<'a> = &'a str;
}

//! Nothing: a Cargo package needs a target, and this one exists only to pin and fetch its dependency.

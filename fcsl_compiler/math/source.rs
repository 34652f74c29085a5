//! Empty: a Cargo package needs a target. This package only pins and fetches its dependency.

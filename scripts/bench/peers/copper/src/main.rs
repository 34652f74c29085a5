// SPDX-License-Identifier: Apache-2.0
//! Times `run_one_iteration` of Copper's runtime on chains of trivial tasks: each adds 1 to what the one before gave.
//! The first is a source, the last a sink, as Copper wants it. Prints medians over rounds as JSON.
use cu29::prelude::*;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

const ROUNDS: usize = 101;
const STEPS: usize = 2000;
/// What the last task saw, as the bits of an f64: proof that all of them ran.
static SEEN: AtomicU64 = AtomicU64::new(0);

#[derive(Reflect)]
pub struct First;
impl Freezable for First {}
impl CuSrcTask for First {
    type Resources<'r> = ();
    type Output<'m> = output_msg!(f64);

    fn new(_: Option<&ComponentConfig>, _: Self::Resources<'_>) -> CuResult<Self> {
        Ok(Self)
    }

    fn process(&mut self, _: &CuContext, output: &mut Self::Output<'_>) -> CuResult<()> {
        output.set_payload(1.0);
        Ok(())
    }
}

#[derive(Reflect)]
pub struct Link;
impl Freezable for Link {}
impl CuTask for Link {
    type Resources<'r> = ();
    type Input<'m> = input_msg!(f64);
    type Output<'m> = output_msg!(f64);

    fn new(_: Option<&ComponentConfig>, _: Self::Resources<'_>) -> CuResult<Self> {
        Ok(Self)
    }

    fn process(&mut self, _: &CuContext, input: &Self::Input<'_>, output: &mut Self::Output<'_>) -> CuResult<()> {
        output.set_payload(input.payload().copied().unwrap_or_default() + 1.0);
        Ok(())
    }
}

#[derive(Reflect)]
pub struct Last;
impl Freezable for Last {}
impl CuSinkTask for Last {
    type Resources<'r> = ();
    type Input<'m> = input_msg!(f64);

    fn new(_: Option<&ComponentConfig>, _: Self::Resources<'_>) -> CuResult<Self> {
        Ok(Self)
    }

    fn process(&mut self, _: &CuContext, input: &Self::Input<'_>) -> CuResult<()> {
        let value = input.payload().copied().unwrap_or_default() + 1.0;
        SEEN.store(value.to_bits(), Ordering::Relaxed);
        Ok(())
    }
}

/// An application over a chain, and the function that times it.
macro_rules! chain {
    ($module:ident, $app:ident, $config:literal) => {
        mod $module {
            use super::*;

            #[copper_runtime(config = $config)]
            struct $app {}

            pub fn time(links: usize, folder: &Path) -> CuResult<f64> {
                let log = folder.join(concat!(stringify!($module), ".copper"));
                let app = $app::builder().with_log_path(&log, Some(1024 * 1024 * 1024))?.build()?;
                let mut running = app.start()?;
                let mut rounds = Vec::with_capacity(ROUNDS);
                for _ in 0..ROUNDS {
                    let begun = Instant::now();
                    for _ in 0..STEPS {
                        running.run_one_iteration()?;
                    }
                    rounds.push(begun.elapsed().as_nanos() as f64 / STEPS as f64);
                }
                running.stop()?;
                assert_eq!(f64::from_bits(SEEN.load(Ordering::Relaxed)), links as f64, "not every task ran");
                rounds.sort_by(f64::total_cmp);
                Ok(rounds[ROUNDS / 2])
            }
        }
    };
}

chain!(three, Three, "chain3.ron");
chain!(three_unlogged, ThreeUnlogged, "chain3_unlogged.ron");
chain!(seventeen, Seventeen, "chain17.ron");
chain!(seventeen_unlogged, SeventeenUnlogged, "chain17_unlogged.ron");

fn main() -> CuResult<()> {
    let folder = std::env::args().nth(1).expect("usage: chain_in_copper FOLDER (for its logs)");
    let folder = Path::new(&folder);
    println!(
        "[{{\"links\": 3, \"logged_ns\": {:.1}, \"unlogged_ns\": {:.1}}}, {{\"links\": 17, \"logged_ns\": {:.1}, \"unlogged_ns\": {:.1}}}]",
        three::time(3, folder)?,
        three_unlogged::time(3, folder)?,
        seventeen::time(17, folder)?,
        seventeen_unlogged::time(17, folder)?,
    );
    Ok(())
}

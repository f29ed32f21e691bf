//! Running many inputs: a panic is caught, what hangs is given up, what is refused has to say why.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

use crate::common::Random;

/// The longest that an input may take, also on a busy machine.
const PATIENCE: Duration = Duration::from_secs(20);

/// What became of all inputs of a kind.
#[derive(Debug, Default)]
pub struct Tally {
    pub accepted: usize,
    pub refused: usize,
}

/// Gives `run` a stream of random numbers for each input. It says that what it made of them was accepted, or why it was
/// refused. An input is found again by its kind and number.
pub fn fuzz(
    kind: &'static str,
    inputs: usize,
    run: impl Fn(usize, &mut Random) -> Result<(), String> + Send + 'static,
) -> Tally {
    let (send, receive) = channel();
    // What hangs keeps its thread until the tests end.
    std::thread::spawn(move || {
        for number in 0..inputs {
            let begun = Instant::now();
            let mut random = Random(seed(kind, number));
            let outcome = catch_unwind(AssertUnwindSafe(|| run(number, &mut random)));
            let outcome = outcome.map_err(|panic| message(panic.as_ref()));
            if send.send((outcome, begun.elapsed())).is_err() {
                return;
            }
        }
    });
    let (mut tally, mut panics) = (Tally::default(), Vec::new());
    let mut slowest = (Duration::ZERO, 0);
    for number in 0..inputs {
        let Ok((outcome, took)) = receive.recv_timeout(PATIENCE) else {
            panic!("{kind}: input {number} takes longer than {PATIENCE:?}");
        };
        slowest = slowest.max((took, number));
        match outcome {
            Ok(Ok(())) => tally.accepted += 1,
            Ok(Err(reason)) => {
                assert!(
                    reason.trim().len() > 10,
                    "{kind}: input {number} is refused without a reason: {reason:?}"
                );
                tally.refused += 1;
            }
            Err(panic) => panics.push((number, panic)),
        }
    }
    println!("{kind}: {tally:?}, the slowest is {} with {:?}", slowest.1, slowest.0);
    let first: Vec<_> = panics.iter().take(5).collect();
    assert!(panics.is_empty(), "{kind}: {} of {inputs} inputs panic, like {first:#?}", panics.len());
    tally
}

/// Other numbers for each kind and input.
fn seed(kind: &str, number: usize) -> u64 {
    let of_kind = kind.bytes().fold(0xcbf2_9ce4_8422_2325, |hash: u64, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    });
    of_kind.wrapping_add((number as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15))
}

/// What a panic said.
fn message(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_default()
}

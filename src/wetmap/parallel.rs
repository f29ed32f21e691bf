//! A loop over values on all cores, whose result does not show how many there are.

use std::num::NonZero;
use std::sync::Mutex;

/// Calls `work(first, chunk)` for chunks of `values`, `first` being the index of the first value in the
/// chunk. Which thread gets which chunk is left to chance, so `work` must only depend on the index.
pub(crate) fn fill<T: Send>(values: &mut [T], chunk: usize, work: impl Fn(usize, &mut [T]) + Sync) {
    fill_on(std::thread::available_parallelism().map_or(1, NonZero::get), values, chunk, work);
}

fn fill_on<T: Send>(threads: usize, values: &mut [T], chunk: usize, work: impl Fn(usize, &mut [T]) + Sync) {
    let threads = threads.min(values.len().div_ceil(chunk));
    let waiting = Mutex::new(values.chunks_mut(chunk).enumerate());
    // A poisoned lock is another thread's panic, which the scope passes on.
    let next = || waiting.lock().ok().and_then(|mut waiting| waiting.next());
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                while let Some((number, chunk_of_values)) = next() {
                    work(number * chunk, chunk_of_values);
                }
            });
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_is_reached_once_by_any_number_of_threads() {
        for threads in [1, 2, 7, 100] {
            for count in [0, 1, 9, 10, 11, 1000] {
                let mut values = vec![0; count];
                fill_on(threads, &mut values, 10, |first, chunk| {
                    chunk.iter_mut().enumerate().for_each(|(i, value)| *value += first + i + 1);
                });
                assert!(values.iter().enumerate().all(|(i, &value)| value == i + 1), "{threads} {count}");
            }
        }
    }
}

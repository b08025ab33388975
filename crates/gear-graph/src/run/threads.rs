//! Pools of threads, where the system may not start as many as are asked for.
//!
//! A pool that is built directly fails as a whole when one of its threads cannot be started, and the threads that were
//! started linger for a while, with their stacks, in the way of the next attempt. So threads are started first and wait
//! for their pool. Where the system refuses one, half of those before it end again: what runs needs room as well.

use std::io;
use std::sync::mpsc::{Sender, channel};
use std::thread::{Builder, JoinHandle};

use rayon::{ThreadBuilder, ThreadPool, ThreadPoolBuilder};

type Work = Box<dyn FnOnce() + Send>;
type Spawn = dyn Fn(Builder, Work) -> io::Result<JoinHandle<()>>;

/// Threads that wait for their pool.
pub struct Threads {
    /// By which each is given its place in the pool.
    places: Vec<Sender<ThreadBuilder>>,
    refused: Option<io::Error>,
}

impl Threads {
    /// Starts so many threads (at least one), or fewer if the system does not start as many.
    ///
    /// # Errors
    /// What the system says when it starts none.
    pub fn start(count: usize, name: &str, stack_bytes: Option<usize>) -> io::Result<Self> {
        Self::start_by(&|builder, work| builder.spawn(work), count, name, stack_bytes)
    }

    fn start_by(spawn: &Spawn, count: usize, name: &str, stack_bytes: Option<usize>) -> io::Result<Self> {
        let mut started = Vec::new();
        let mut refused = None;
        for i in 0..count.max(1) {
            let (place, places) = channel::<ThreadBuilder>();
            let work = move || {
                if let Ok(place) = places.recv() {
                    place.run();
                }
            };
            let mut builder = Builder::new().name(format!("{name}-{i}"));
            if let Some(bytes) = stack_bytes {
                builder = builder.stack_size(bytes);
            }
            match spawn(builder, Box::new(work)) {
                Ok(thread) => started.push((place, thread)),
                Err(error) if started.is_empty() => return Err(error),
                Err(error) => {
                    refused = Some(error);
                    break;
                }
            }
        }
        if refused.is_some() {
            for (place, thread) in started.split_off(started.len().div_ceil(2)) {
                drop(place);
                // It has done nothing that could panic, and its stack is free once it has ended.
                let _ = thread.join();
            }
        }
        Ok(Self {
            places: started.into_iter().map(|(place, _)| place).collect(),
            refused,
        })
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.places.len()
    }

    /// Why there are fewer than were asked for.
    pub fn refused(&self) -> Option<&io::Error> {
        self.refused.as_ref()
    }

    /// A pool of them.
    pub fn into_pool(self) -> io::Result<ThreadPool> {
        let builder = ThreadPoolBuilder::new().num_threads(self.count());
        let built = builder.spawn_handler(|thread| self.take_place(thread)).build();
        built.map_err(io::Error::other)
    }

    /// The pool of everything that names none. Where one is built already, that stays, and this is an error.
    pub fn into_global_pool(self) -> io::Result<()> {
        let builder = ThreadPoolBuilder::new().num_threads(self.count());
        let built = builder.spawn_handler(|thread| self.take_place(thread)).build_global();
        built.map_err(io::Error::other)
    }

    fn take_place(&self, thread: ThreadBuilder) -> io::Result<()> {
        let gone = |_| io::Error::other("a thread that waited is gone");
        self.places[thread.index()].send(thread).map_err(gone)
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    /// A system that starts so many threads in all.
    fn grudging(left: usize) -> Box<Spawn> {
        let left = Cell::new(left);
        Box::new(move |builder, work| match left.get() {
            0 => Err(io::Error::other("no more threads")),
            some => {
                left.set(some - 1);
                builder.spawn(work)
            }
        })
    }

    #[test]
    fn as_many_as_asked_for_are_a_pool() {
        let threads = Threads::start_by(&*grudging(8), 8, "test", Some(1 << 20)).unwrap();
        assert!(threads.count() == 8 && threads.refused().is_none());
        let pool = threads.into_pool().unwrap();
        assert_eq!(pool.current_num_threads(), 8);
        assert_eq!(pool.install(|| rayon::join(|| 1, || 2)), (1, 2));
    }

    #[test]
    fn where_one_is_refused_half_of_those_before_it_are_a_pool() {
        for (possible, remain) in [(1, 1), (2, 1), (7, 4)] {
            let threads = Threads::start_by(&*grudging(possible), 16, "test", None).unwrap();
            assert_eq!(threads.count(), remain);
            assert_eq!(threads.refused().unwrap().to_string(), "no more threads");
            assert_eq!(threads.into_pool().unwrap().install(|| rayon::join(|| 1, || 2)), (1, 2));
        }
    }

    #[test]
    fn none_is_an_error() {
        let error = Threads::start_by(&*grudging(0), 4, "test", None).err().unwrap();
        assert_eq!(error.to_string(), "no more threads");
    }
}

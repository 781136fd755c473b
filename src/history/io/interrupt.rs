//! Ends what a connection to the database is doing, from any thread.

use std::sync::{Arc, Mutex, PoisonError};

use duckdb::{Connection, InterruptHandle};

/// Interrupts a connection, unless that is closed. The engine's own handle is cleared only after the connection is gone, so that an
/// interruption meanwhile would reach into freed memory (duckdb 1.10506.1, `InnerConnection::close`).
pub struct Interrupt {
    handle: Arc<InterruptHandle>,
    open: Arc<Mutex<bool>>,
}

impl Interrupt {
    /// Nothing where nothing is running.
    pub fn interrupt(&self) {
        let open = self.open.lock().unwrap_or_else(PoisonError::into_inner);
        if *open {
            self.handle.interrupt();
        }
    }
}

/// That a connection is open. It stands before the connection in its owner, and so is dropped before it.
pub struct Open(Arc<Mutex<bool>>);

impl Default for Open {
    fn default() -> Open {
        Open(Arc::new(Mutex::new(true)))
    }
}

impl Open {
    /// To interrupt the connection.
    pub fn interrupt(&self, db: &Connection) -> Interrupt {
        Interrupt { handle: db.interrupt_handle(), open: Arc::clone(&self.0) }
    }
}

impl Drop for Open {
    fn drop(&mut self) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = false;
    }
}

#[cfg(test)]
mod tests {
    use std::{sync::mpsc, thread};

    use super::*;

    /// Interruptions all the time while connections come and go.
    #[test]
    fn a_connection_may_be_interrupted_while_it_closes() {
        let db = Connection::open_in_memory().expect("a database");
        let (handles, taken) = mpsc::channel::<Interrupt>();
        let interrupting = thread::spawn(move || {
            let mut count = 0_u64;
            for handle in taken {
                for _ in 0..2_000 {
                    handle.interrupt();
                    count += 1;
                }
            }
            count
        });
        for _ in 0..200 {
            let (open, other) = (Open::default(), db.try_clone().expect("a connection"));
            handles.send(open.interrupt(&other)).expect("it takes them");
            drop((open, other));
        }
        drop(handles);
        assert_eq!(interrupting.join().expect("no panic"), 400_000);
        assert!(db.execute_batch("SELECT 1").is_ok());
    }
}

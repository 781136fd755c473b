//! What the archive changes on its disk, one step after the other: before each, a test may look at the disk as a kill would
//! leave it there, or have the step fail.

use std::{fs, io, path::Path};

use crate::profile::io::atomic::sync_folder;

/// Gives a whole file its last name, lastingly.
pub fn rename(from: &Path, to: &Path) -> io::Result<()> {
    step("rename")?;
    fs::rename(from, to)?;
    step("sync of the folder")?;
    sync_folder(to)
}

/// Removes a file.
pub fn remove(path: &Path) -> io::Result<()> {
    step("remove")?;
    fs::remove_file(path)
}

/// Removes a folder if it is empty: no other can be removed.
pub fn remove_empty(folder: &Path) {
    let _ = step("remove the folder").and_then(|()| fs::remove_dir(folder));
}

/// Comes before everything else that the archive changes.
#[cfg(not(test))]
pub fn step(_: &'static str) -> io::Result<()> {
    Ok(())
}

#[cfg(test)]
pub use testing::step;

#[cfg(test)]
pub mod testing {
    //! What a test does at each step of this thread.

    use std::{cell::RefCell, io};

    type Hook = Box<dyn FnMut(&'static str) -> io::Result<()>>;

    thread_local! {
        static HOOK: RefCell<Option<Hook>> = const { RefCell::new(None) };
    }

    /// The steps of the hook itself are not seen.
    pub fn step(what: &'static str) -> io::Result<()> {
        let Some(mut hook) = HOOK.take() else { return Ok(()) };
        let done = hook(what);
        HOOK.set(Some(hook));
        done
    }

    /// Does something while each step of this thread is seen.
    pub fn seen<T>(hook: impl FnMut(&'static str) -> io::Result<()> + 'static, work: impl FnOnce() -> T) -> T {
        let before = HOOK.replace(Some(Box::new(hook)));
        let done = work();
        HOOK.set(before);
        done
    }
}

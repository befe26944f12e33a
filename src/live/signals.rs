//! SIGINT, SIGTERM and SIGHUP: counted, and looked at by the loops of every shell.

#![allow(unsafe_code)]

use std::io;
use std::sync::atomic::{AtomicU32, Ordering};

static ASKED: AtomicU32 = AtomicU32::new(0);

/// How often this process was asked to end.
pub fn asked() -> u32 {
    ASKED.load(Ordering::Relaxed)
}

extern "C" fn count(_signal: libc::c_int) {
    ASKED.fetch_add(1, Ordering::Relaxed);
}

/// From here on the process is not ended by these signals but counts them.
///
/// # Errors
/// What the kernel says.
pub fn listen() -> io::Result<()> {
    ASKED.store(0, Ordering::Relaxed);
    for signal in [libc::SIGINT, libc::SIGTERM, libc::SIGHUP] {
        // SAFETY: sigaction is plain numbers, for which zeros are valid.
        let mut action: libc::sigaction = unsafe { std::mem::zeroed() };
        action.sa_sigaction = count as extern "C" fn(libc::c_int) as libc::sighandler_t;
        action.sa_flags = libc::SA_RESTART;
        // SAFETY: the handler only adds to an atomic, which is async-signal-safe; both pointers are valid.
        if unsafe { libc::sigaction(signal, &action, std::ptr::null_mut()) } != 0 {
            return Err(io::Error::last_os_error());
        }
    }
    Ok(())
}

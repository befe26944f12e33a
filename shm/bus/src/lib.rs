//! The only code that names iceoryx2: publish, latest value, bounded open, cleanup after a crash.

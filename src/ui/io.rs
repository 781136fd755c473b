//! The terminal's loop.

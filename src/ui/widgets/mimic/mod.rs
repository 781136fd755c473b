//! The parts of the process picture.

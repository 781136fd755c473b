//! Tests of the whole terminal.

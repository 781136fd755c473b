//! Fuzzes `socket`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| sightglass_fuzz::socket::run(data));

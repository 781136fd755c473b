//! Fuzzes `decode`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| sightglass_fuzz::decode::run(data));

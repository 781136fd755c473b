//! Fuzzes `listen`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| sightglass_fuzz::listen::run(data));

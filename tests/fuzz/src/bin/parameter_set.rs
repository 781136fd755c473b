//! Fuzzes `parameter_set`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| sightglass_fuzz::parameter_set::run(data));

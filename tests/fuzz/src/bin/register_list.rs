//! Fuzzes `register_list`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| sightglass_fuzz::register_list::run(data));

//! Fuzzes the OFF reader.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    kd_fuzz::check(bytes, |bytes| kd_scene::read_off(bytes, "fuzz"));
});

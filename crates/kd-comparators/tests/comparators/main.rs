//! Both structures against brute force, on generated scenes and on hard input.

mod adversarial;
mod caps;
mod check;
mod oracle;
mod properties;
mod rays;
#[path = "../../../kd-trace/tests/trace/rng.rs"]
mod rng;
#[path = "../../../kd-trace/tests/trace/scenes.rs"]
mod scenes;
mod watertight;

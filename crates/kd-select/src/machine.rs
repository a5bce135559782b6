//! The identity of a machine.

use std::fmt;

use kd_trace::Level;
#[cfg(feature = "json")]
use serde::{Deserialize, Serialize};

/// A machine, as far as times depend on it: equal machines should take about the same times.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "json", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "json", serde(deny_unknown_fields))]
pub struct Machine {
    /// The brand name of the processor with its family, model and stepping; its architecture if it has no name.
    pub cpu: String,
    /// The level of instructions that traces rays: `avx2` or `portable`.
    pub level: String,
}

impl Machine {
    /// This machine.
    pub fn here() -> Self {
        Self {
            cpu: name_of_cpu().unwrap_or_else(|| std::env::consts::ARCH.into()),
            level: Level::detect().name().into(),
        }
    }
}

impl fmt::Display for Machine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, {}", self.cpu, self.level)
    }
}

#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
fn name_of_cpu() -> Option<String> {
    let cpu = raw_cpuid::CpuId::new();
    let brand = cpu.get_processor_brand_string()?;
    let name = brand.as_str().trim();
    // Virtual machines give several processors the same name.
    let info = cpu.get_feature_info()?;
    let (family, model, stepping) = (info.family_id(), info.model_id(), info.stepping_id());
    Some(format!("{name} ({family}, {model}, {stepping})"))
}

#[cfg(not(any(target_arch = "x86", target_arch = "x86_64")))]
fn name_of_cpu() -> Option<String> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_machine_has_one_identity() {
        let here = Machine::here();
        assert_eq!(here, Machine::here(), "the same twice");
        assert!(!here.cpu.is_empty() && !here.level.is_empty(), "{here}");
    }
}

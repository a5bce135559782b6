//! Which machine this is.

use std::fmt;

use kd_trace::Level;
use serde::{Deserialize, Serialize};

/// A machine, as far as times depend on it: two that are equal here should take about as long.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Machine {
    /// The name that the processor gives itself, with its family, model and stepping; where it gives none, its architecture.
    pub cpu: String,
    /// The instructions that rays are traced with: `avx2` or `portable`.
    pub level: String,
}

impl Machine {
    /// This one.
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
    // Virtual machines give several processors one name.
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
    fn a_machine_knows_itself() {
        let here = Machine::here();
        assert_eq!(here, Machine::here(), "the same twice");
        assert!(!here.cpu.is_empty() && !here.level.is_empty(), "{here}");
    }
}

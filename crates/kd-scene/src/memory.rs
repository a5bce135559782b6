//! How much memory is left, so that a file that does not fit is an error and not the end of the process.

use std::io;

/// Fails if `bytes` more do not fit into memory. Where the system does not say how much is left, it never fails.
pub(crate) fn check_room(bytes: u64) -> io::Result<()> {
    match available() {
        Some(available) if bytes > available => {
            let problem = format!("needs {bytes} bytes of memory, {available} are left");
            Err(io::Error::new(io::ErrorKind::OutOfMemory, problem))
        }
        _ => Ok(()),
    }
}

/// The bytes of memory that are left to the process.
#[cfg(target_os = "linux")]
fn available() -> Option<u64> {
    let of_machine = std::fs::read_to_string("/proc/meminfo").ok()?;
    let of_machine = of_meminfo(&of_machine)?;
    let number = |name: &str| -> Option<u64> {
        let path = format!("/sys/fs/cgroup/memory.{name}");
        std::fs::read_to_string(path).ok()?.trim().parse().ok()
    };
    // A container may have less. What is cached there counts as used, though it would make room.
    let of_container = number("max").zip(number("current"));
    let of_container = of_container.map(|(most, used)| most.saturating_sub(used).max(most / 2));
    Some(of_container.map_or(of_machine, |own| own.min(of_machine)))
}

#[cfg(not(target_os = "linux"))]
fn available() -> Option<u64> {
    None
}

/// The memory that can be had without swapping, by the text of `/proc/meminfo`.
#[cfg(target_os = "linux")]
fn of_meminfo(text: &str) -> Option<u64> {
    let line = text
        .lines()
        .find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let kilobytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kilobytes.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_fit_is_an_error() {
        assert!(check_room(1).is_ok(), "one byte");
        if available().is_some() {
            let error = check_room(u64::MAX).expect_err("more than any machine has");
            assert_eq!(error.kind(), io::ErrorKind::OutOfMemory);
        }
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn the_text_of_the_system_is_read() {
        let text = "MemTotal:       65 kB\nMemAvailable:   12 kB\nBuffers: 1 kB\n";
        assert_eq!(of_meminfo(text), Some(12 * 1024));
        assert_eq!(of_meminfo("MemTotal: 65 kB"), None);
    }
}

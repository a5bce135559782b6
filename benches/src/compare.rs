//! The differences of two runs. Exact values must be equal, except of rivals, which may change with their libraries; times
//! are printed for information, since they vary with the load of the machine.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use serde_json::{Map, Value};

use crate::record::{self, Record};
use crate::summary::three_digits;

/// Prints the differences; false if there is an exact one.
pub(crate) fn run(before: &Path, after: &Path) -> anyhow::Result<bool> {
    let comparison = Comparison::new(&record::read(before)?, &record::read(after)?)?;
    println!("times, for information (above ×1: the second run is faster):");
    for line in &comparison.times {
        println!("  {line}");
    }
    if comparison.changes.is_empty() {
        println!("exact: equal in all {} cells", comparison.times.len());
    } else {
        println!("exact: {} differences", comparison.changes.len());
        for change in &comparison.changes {
            println!("  {change}");
        }
    }
    Ok(comparison.changes.is_empty())
}

struct Comparison {
    /// Exact values that differ, and cells that only one run has.
    changes: Vec<String>,
    /// One line for each cell that both have.
    times: Vec<String>,
}

impl Comparison {
    fn new(before: &[Record], after: &[Record]) -> anyhow::Result<Self> {
        let (before, after) = (by_cell(before)?, by_cell(after)?);
        let mut comparison = Self {
            changes: Vec::new(),
            times: Vec::new(),
        };
        for (cell, old) in &before {
            match after.get(cell) {
                Some(new) => comparison.compare(cell, old, new)?,
                None => comparison
                    .changes
                    .push(format!("{cell}: only in the first run")),
            }
        }
        for cell in after.keys().filter(|cell| !before.contains_key(*cell)) {
            comparison
                .changes
                .push(format!("{cell}: only in the second run"));
        }
        Ok(comparison)
    }

    fn compare(&mut self, cell: &str, old: &Record, new: &Record) -> anyhow::Result<()> {
        let (old_exact, new_exact) = (exact(old)?, exact(new)?);
        let fields: BTreeSet<&String> = old_exact.keys().chain(new_exact.keys()).collect();
        for field in fields {
            let value = |exact: &Map<String, Value>| exact.get(field).cloned().unwrap_or_default();
            let (old, new) = (value(&old_exact), value(&new_exact));
            if old != new {
                self.changes.push(format!("{cell}: {field} {old} -> {new}"));
            }
        }
        let time = |name, old: &[f64], new: &[f64]| {
            let (old, new) = (record::median(old), record::median(new));
            format!(
                "{name} {} -> {} (×{:.2})",
                three_digits(old),
                three_digits(new),
                old / new
            )
        };
        let build = time("build ms", &old.timed.build_ms, &new.timed.build_ms);
        let trace = time(
            "ns/ray",
            &old.timed.trace_ns_per_ray,
            &new.timed.trace_ns_per_ray,
        );
        let mut line = format!("{cell}: {build}, {trace}");
        if old.library != new.library {
            let named = |record: &Record| match &*record.library {
                "" => "no library named".to_owned(),
                name => name.to_owned(),
            };
            line = format!("{line}, {} -> {}", named(old), named(new));
        }
        self.times.push(line);
        Ok(())
    }
}

/// The fields that are compared, of a rival only the number of triangles.
fn exact(record: &Record) -> anyhow::Result<Map<String, Value>> {
    let mut fields = Map::from_iter([("triangles".to_owned(), record.triangles.into())]);
    if !record.is_of_rival()
        && let Value::Object(exact) = serde_json::to_value(&record.exact)?
    {
        fields.extend(exact);
    }
    Ok(fields)
}

fn by_cell(records: &[Record]) -> anyhow::Result<BTreeMap<String, &Record>> {
    let mut cells = BTreeMap::new();
    for record in records {
        let cell = record.cell();
        anyhow::ensure!(
            cells.insert(cell.clone(), record).is_none(),
            "{cell} occurs twice"
        );
    }
    Ok(cells)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::example;

    fn changes(before: &[Record], after: &[Record]) -> Vec<String> {
        Comparison::new(before, after)
            .expect("distinct cells")
            .changes
    }

    #[test]
    fn times_and_machines_may_change() {
        let mut after = example();
        after.timed.build_ms = vec![1.0];
        after.timed.trace_ns_per_ray = vec![50.0];
        after.rev = "fedcba".into();
        after.threads = 2;
        let comparison = Comparison::new(&[example()], &[after]).expect("one cell each");
        assert_eq!(comparison.changes, [""; 0], "nothing exact");
        assert_eq!(
            comparison.times,
            [
                "tetra-3 kd/exact/binary primary: build ms 2.50 -> 1.00 (×2.50), ns/ray 100 -> 50.0 (×2.00)"
            ],
            "medians and how many times as fast"
        );
    }

    #[test]
    fn every_exact_change_is_named() {
        type Edit = fn(&mut Record);
        let edits: [(Edit, &str); 6] = [
            (|r| r.exact.depth = 10, "depth 9 -> 10"),
            (
                |r| r.exact.sah_cost_own = 0.5,
                "sah_cost_own 0.3333333333333333 -> 0.5",
            ),
            (|r| r.exact.hit_hash = "00".into(), "hit_hash"),
            (
                |r| r.exact.peak_build_bytes += 1,
                "peak_build_bytes 9000 -> 9001",
            ),
            (|r| r.exact.steps = None, "steps"),
            (|r| r.triangles = 65, "triangles 64 -> 65"),
        ];
        for (edit, said) in edits {
            let mut after = example();
            edit(&mut after);
            let found = changes(&[example()], &[after]);
            assert_eq!(found.len(), 1, "{found:?}");
            assert!(
                found[0].starts_with("tetra-3 kd/exact/binary primary: ")
                    && found[0].contains(said),
                "{found:?}"
            );
        }
    }

    #[test]
    fn rivals_may_change() {
        let mut before = example();
        before.exact.disagreement_ppm = Some(0.0);
        let mut after = before.clone();
        after.exact.bytes_total += 1;
        after.library = "Embree 4.4.0".into();
        let comparison = Comparison::new(&[before], &[after]).expect("one cell each");
        assert_eq!(comparison.changes, [""; 0], "it is not ours");
        let times = &comparison.times[0];
        assert!(
            times.ends_with(", no library named -> Embree 4.4.0"),
            "{times}"
        );
    }

    #[test]
    fn cells_of_only_one_run_are_changes() {
        let mut other = example();
        other.rays = "ao".into();
        assert_eq!(
            changes(&[example(), other.clone()], &[example()]),
            ["tetra-3 kd/exact/binary ao: only in the first run"],
            "gone"
        );
        assert_eq!(
            changes(&[example()], &[example(), other]),
            ["tetra-3 kd/exact/binary ao: only in the second run"],
            "new"
        );
        assert!(
            Comparison::new(&[example(), example()], &[]).is_err(),
            "one cell twice is no run"
        );
    }
}

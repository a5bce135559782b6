//! The record: one JSON line for each cell, which is one measurement of scene × structure × rays. Every command measures
//! cells and prints views of them.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context as _;
use serde::{Deserialize, Serialize};

/// Version of the format. Other versions are refused. Newer fields are optional.
pub(crate) const SCHEMA: u32 = 1;

/// A rival that answers more rays in a million differently is wrong.
const MOST_DISAGREEMENT_PPM: f64 = 100.0;

/// One cell.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Record {
    pub(crate) schema: u32,
    pub(crate) rev: String,
    pub(crate) cpu: String,
    pub(crate) rustc: String,
    /// Compiler flags, if any.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub(crate) rustflags: String,
    pub(crate) threads: usize,
    pub(crate) simd: String,
    pub(crate) scene: String,
    pub(crate) triangles: usize,
    pub(crate) structure: String,
    pub(crate) builder: String,
    pub(crate) layout: String,
    /// The kind of rays, with `-batch` or `-packets` unless they are traced one at a time. Empty for a build.
    pub(crate) rays: String,
    /// Structure, builder and layout that run before every timed repeat; also their threads if they differ.
    pub(crate) baseline: String,
    /// The name and version of Embree if it is the structure or the baseline. Records without it are of Embree 3.13. (The versions
    /// of other rivals are in the lock file of `rev`.)
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub(crate) library: String,
    pub(crate) exact: Exact,
    pub(crate) timed: Timed,
}

/// Values that are equal in every run, on any machine with the same compiler; compared with `==`.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Exact {
    pub(crate) nodes: usize,
    pub(crate) leaves: usize,
    pub(crate) empty_leaves: usize,
    pub(crate) refs: usize,
    pub(crate) depth: usize,
    pub(crate) sah_cost_15_20: f64,
    pub(crate) sah_cost_own: f64,
    pub(crate) bytes_total: usize,
    /// The peak of allocated bytes of a build on one thread, above the mesh. A rival's counts above its own form of the mesh;
    /// of the fields above, only `bytes_total` is known of a rival, the others are 0.
    pub(crate) peak_build_bytes: usize,
    /// Rays traced.
    pub(crate) rays: usize,
    /// Of these, rays that hit something.
    pub(crate) hits: usize,
    /// Hash of the triangles hit, in the order of the rays (see [`hash_of_ids`]); for any-hit rays, of hit or miss.
    pub(crate) hit_hash: String,
    /// Rays that the reference, our `balanced`, answers differently: hit or miss, and for closest hits the triangle and the
    /// bits of t. Of a rival: hit or miss, and t to one in a thousand.
    pub(crate) mismatches: usize,
    /// Of a rival, `mismatches` in parts per million of its rays.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) disagreement_ppm: Option<f64>,
    /// Rays whose answers were compared with a test of every triangle.
    pub(crate) brute_force_rays: usize,
    /// Of these, rays answered differently.
    pub(crate) brute_force_mismatches: usize,
    /// Steps of all rays together, where the query counts them (closest hits only).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) steps: Option<Steps>,
}

impl Exact {
    /// Whether answers are wrong: of ours if any is, of a rival if too many are.
    pub(crate) fn is_wrong(&self) -> bool {
        match self.disagreement_ppm {
            Some(ppm) => ppm > MOST_DISAGREEMENT_PPM,
            None => self.mismatches + self.brute_force_mismatches > 0,
        }
    }
}

/// Steps of traversals.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Steps {
    pub(crate) node_steps: u64,
    pub(crate) leaf_steps: u64,
    pub(crate) triangle_tests: u64,
}

impl std::ops::AddAssign for Steps {
    fn add_assign(&mut self, other: Self) {
        self.node_steps += other.node_steps;
        self.leaf_steps += other.leaf_steps;
        self.triangle_tests += other.triangle_tests;
    }
}

/// All samples of all times. Sample i of the baseline was taken just before sample i of the cell.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Timed {
    pub(crate) build_ms: Vec<f64>,
    pub(crate) trace_ns_per_ray: Vec<f64>,
    pub(crate) baseline_build_ms: Vec<f64>,
    pub(crate) baseline_ns_per_ray: Vec<f64>,
}

impl Record {
    /// The name of the cell in messages and comparisons.
    pub(crate) fn cell(&self) -> String {
        let Self {
            scene,
            structure,
            builder,
            layout,
            rays,
            ..
        } = self;
        format!("{scene} {structure}/{builder}/{layout} {rays}")
    }

    /// Structure, builder and layout, as [`baseline`](Self::baseline) is written.
    pub(crate) fn variant(&self) -> String {
        format!("{}/{}/{}", self.structure, self.builder, self.layout)
    }

    /// Whether it was measured in a build for this processor, as Rust rivals are where that is faster.
    pub(crate) fn is_native(&self) -> bool {
        self.rustflags.contains("target-cpu=native")
    }

    /// Whether it is of a rival library.
    pub(crate) fn is_of_rival(&self) -> bool {
        self.exact.disagreement_ppm.is_some()
    }

    /// Whether answers are wrong: of ours if any is, of a rival if too many are.
    pub(crate) fn is_wrong(&self) -> bool {
        self.exact.is_wrong()
    }

    /// Build speed over the baseline's.
    pub(crate) fn build_speed(&self) -> f64 {
        median_ratio(&self.timed.baseline_build_ms, &self.timed.build_ms)
    }

    /// Ray speed over the baseline's.
    pub(crate) fn trace_speed(&self) -> f64 {
        median_ratio(
            &self.timed.baseline_ns_per_ray,
            &self.timed.trace_ns_per_ray,
        )
    }

    /// Median build milliseconds.
    pub(crate) fn build_ms(&self) -> f64 {
        median(&self.timed.build_ms)
    }

    /// Median nanoseconds per ray.
    pub(crate) fn ns_per_ray(&self) -> f64 {
        median(&self.timed.trace_ns_per_ray)
    }

    /// Build time over the baseline's.
    pub(crate) fn build_ratio(&self) -> f64 {
        median_ratio(&self.timed.build_ms, &self.timed.baseline_build_ms)
    }

    /// Time of rays over the baseline's.
    pub(crate) fn trace_ratio(&self) -> f64 {
        median_ratio(
            &self.timed.trace_ns_per_ray,
            &self.timed.baseline_ns_per_ray,
        )
    }

    /// Mean steps of a ray in nodes and in triangle tests, where they were counted.
    pub(crate) fn steps_per_ray(&self) -> Option<[f64; 2]> {
        let steps = self.exact.steps?;
        let rays = self.exact.rays.max(1) as f64;
        Some([steps.node_steps, steps.triangle_tests].map(|count| count as f64 / rays))
    }

    /// References per triangle; 0 without triangles.
    pub(crate) fn refs_per_triangle(&self) -> f64 {
        if self.triangles == 0 {
            0.0
        } else {
            self.exact.refs as f64 / self.triangles as f64
        }
    }
}

/// The median of `above[i] / below[i]`. Pairs were taken together, so a slow moment of the machine is in both.
pub(crate) fn median_ratio(above: &[f64], below: &[f64]) -> f64 {
    let ratios: Vec<f64> = above.iter().zip(below).map(|(a, b)| a / b).collect();
    median(&ratios)
}

/// The median; the mean of the middle two for an even number of values, NaN for none.
pub(crate) fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    match sorted.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => sorted[n / 2],
        n => f64::midpoint(sorted[n / 2 - 1], sorted[n / 2]),
    }
}

/// 64-bit FNV-1a over little-endian words, as 16 hexadecimal digits. A miss is `u32::MAX`.
pub(crate) fn hash_of_ids(ids: impl IntoIterator<Item = u32>) -> String {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    for byte in ids.into_iter().flat_map(u32::to_le_bytes) {
        hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
    }
    format!("{hash:016x}")
}

/// Reads a run: a folder with `run.jsonl`, or such a file.
pub(crate) fn read(run: &Path) -> anyhow::Result<Vec<Record>> {
    let path = if run.is_dir() {
        run.join("run.jsonl")
    } else {
        run.to_owned()
    };
    let text = std::fs::read_to_string(&path)
        .with_context(|| format!("cannot read {}", path.display()))?;
    parse(&text).with_context(|| path.display().to_string())
}

fn parse(text: &str) -> anyhow::Result<Vec<Record>> {
    let mut records = Vec::new();
    for (index, line) in text
        .lines()
        .enumerate()
        .filter(|(_, line)| !line.trim().is_empty())
    {
        let place = || format!("line {}", index + 1);
        let value: serde_json::Value = serde_json::from_str(line).with_context(place)?;
        if value["schema"] != SCHEMA {
            anyhow::bail!(
                "line {} has schema {}; this program reads {SCHEMA}",
                index + 1,
                value["schema"]
            );
        }
        records.push(serde_json::from_value(value).with_context(place)?);
    }
    Ok(records)
}

/// Distinct values in order of first appearance.
pub(crate) fn distinct<'a>(values: impl IntoIterator<Item = &'a str>) -> Vec<&'a str> {
    let mut seen = Vec::new();
    for value in values {
        if !seen.contains(&value) {
            seen.push(value);
        }
    }
    seen
}

/// The library of the cells that have one: a run opens only one.
pub(crate) fn library<'a>(cells: impl IntoIterator<Item = &'a Record>) -> Option<&'a str> {
    let mut libraries = cells.into_iter().map(|cell| cell.library.as_str());
    libraries.find(|library| !library.is_empty())
}

/// One row of a table: a scene and a variant with its cells by kind of ray.
#[derive(Debug)]
pub(crate) struct Row<'a> {
    pub(crate) scene: &'a str,
    pub(crate) variant: String,
    /// Never empty.
    pub(crate) cells: BTreeMap<&'a str, &'a Record>,
}

impl<'a> Row<'a> {
    /// The variant, with a mark if it was compiled for this processor.
    pub(crate) fn label(&self) -> String {
        let native = if self.build().is_native() {
            " (native)"
        } else {
            ""
        };
        format!("{}{native}", self.variant)
    }

    /// Any cell: the build does not depend on the rays.
    pub(crate) fn build(&self) -> &'a Record {
        self.cells.values().next().expect("a row has a cell")
    }
}

/// The rows of a run, in its order.
pub(crate) fn rows(records: &[Record]) -> Vec<Row<'_>> {
    let mut rows: Vec<Row<'_>> = Vec::new();
    for record in records {
        let variant = record.variant();
        let known = rows
            .iter_mut()
            .find(|row| row.scene == record.scene && row.variant == variant);
        if let Some(row) = known {
            row.cells.insert(&record.rays, record);
        } else {
            let cells = BTreeMap::from([(record.rays.as_str(), record)]);
            rows.push(Row {
                scene: &record.scene,
                variant,
                cells,
            });
        }
    }
    rows
}

/// A record with plausible values, for tests here and in other modules.
#[cfg(test)]
pub(crate) fn example() -> Record {
    Record {
        schema: SCHEMA,
        rev: "0123456789ab".into(),
        cpu: "some CPU".into(),
        rustc: "1.89.0".into(),
        rustflags: String::new(),
        threads: 1,
        simd: "sse2".into(),
        scene: "tetra-3".into(),
        triangles: 64,
        structure: "kd".into(),
        builder: "exact".into(),
        layout: "binary".into(),
        rays: "primary".into(),
        baseline: "kd/balanced/binary".into(),
        library: String::new(),
        exact: Exact {
            nodes: 101,
            leaves: 51,
            empty_leaves: 9,
            refs: 80,
            depth: 9,
            sah_cost_15_20: 71.204_000_000_000_01,
            sah_cost_own: 1.0 / 3.0,
            bytes_total: 1500,
            peak_build_bytes: 9000,
            rays: 4096,
            hits: 1234,
            hit_hash: hash_of_ids([1, 2, u32::MAX]),
            steps: Some(Steps {
                node_steps: 9,
                leaf_steps: 3,
                triangle_tests: 7,
            }),
            ..Exact::default()
        },
        timed: Timed {
            build_ms: vec![2.0, 2.5, 4.0],
            trace_ns_per_ray: vec![100.0, 210.0, 90.0],
            baseline_build_ms: vec![4.0, 5.0, 4.0],
            baseline_ns_per_ray: vec![50.0, 100.0, 45.0],
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run_folder::json_lines;

    #[test]
    fn records_survive_a_trip_through_a_file() {
        let mut any_hit = example();
        any_hit.rays = "ao".into();
        any_hit.exact.steps = None;
        let mut over_embree = example();
        over_embree.library = "Embree 4.4.0".into();
        let records = [example(), any_hit, over_embree];
        let text = json_lines(&records).expect("plain data");
        assert_eq!(text.lines().count(), 3, "one line each");
        assert_eq!(library(&records), Some("Embree 4.4.0"), "of one cell");
        assert_eq!(library(&records[..2]), None, "ours alone");
        assert!(
            !text.lines().nth(1).expect("two").contains("steps"),
            "not counted, not written"
        );
        assert_eq!(parse(&text).expect("just written"), records, "bit for bit");
    }

    #[test]
    fn strange_lines_are_refused() {
        let line = json_lines([example()]).expect("plain data");
        let other_schema = line.replace("\"schema\":1", "\"schema\":2");
        let refused = parse(&other_schema)
            .expect_err("another schema")
            .to_string();
        assert_eq!(
            refused, "line 1 has schema 2; this program reads 1",
            "says which"
        );
        let unknown_field = line.replace("\"rev\"", "\"revision\"");
        assert!(parse(&unknown_field).is_err(), "an unknown field");
        assert!(
            parse("{}\n").is_err() && parse("nonsense\n").is_err(),
            "not records"
        );
    }

    #[test]
    fn ratios_are_medians_of_pairs() {
        let record = example();
        assert_eq!(record.build_speed(), 2.0, "of 2, 2 and 1");
        assert_eq!(record.trace_speed(), 0.5, "of 0.5, 0.476 and 0.5");
        assert_eq!(median(&[4.0, 1.0, 2.0, 3.0]), 2.5, "between the middle two");
        assert!(median(&[]).is_nan(), "no value");
    }

    #[test]
    fn hashes_depend_on_order_and_misses() {
        assert_eq!(hash_of_ids([]), "cbf29ce484222325", "FNV's offset basis");
        assert_eq!(
            hash_of_ids([u32::from_le_bytes(*b"foob")]),
            "dd120e790c2512af",
            "published test vector"
        );
        let hashes = [
            hash_of_ids([1, 2]),
            hash_of_ids([2, 1]),
            hash_of_ids([1, u32::MAX]),
            hash_of_ids([1]),
        ];
        for (i, hash) in hashes.iter().enumerate() {
            assert!(!hashes[..i].contains(hash), "{hashes:?}");
        }
    }

    #[test]
    fn rows_gather_the_cells_of_a_scene_and_variant() {
        let mut other_rays = example();
        other_rays.rays = "ao".into();
        let mut other_builder = example();
        other_builder.builder = "median".into();
        let records = [example(), other_builder, other_rays];
        let rows = rows(&records);
        let shape: Vec<(&str, usize)> = rows
            .iter()
            .map(|r| (r.variant.as_str(), r.cells.len()))
            .collect();
        assert_eq!(
            shape,
            [("kd/exact/binary", 2), ("kd/median/binary", 1)],
            "in order of appearance"
        );
    }
}

//! The table itself, the paper's averages, and both as JSON.

use std::fmt::Write as _;

use comfy_table::Table;
use kd_select::{RayScheme, Structure as Kind, Times, break_even};
use serde_json::{Value, json};

use super::measure::Measured;
use super::seed::{SeedRow, TABLE};
use super::{SCHEMES, of_scheme, rays_text};
use crate::record::median;
use crate::run_folder::json_lines;
use crate::text;
use crate::view::{arithmetic_mean, maximum, minimum};

/// The kd-tree of the table.
pub(super) const KD: Kind = Kind::Balanced;

/// By scene, with the paper's figures below ours where it has the scene.
pub(super) fn of(measured: &[Measured]) -> Table {
    let of_rays = ["t_G µs", "t_H µs", "R_C"];
    let head = ["scene", "triangles", "σ", "T_G ms", "T_H ms"].into_iter();
    let mut table = text::empty_table(head.chain(of_rays).chain(of_rays));
    for random in of_scheme(measured, RayScheme::Random) {
        let path = measured.iter().find(|other| {
            other.scene.rays == RayScheme::Path && other.scene.scene == random.scene.scene
        });
        let (grid, kd) = (random.times(Kind::Grid), random.times(KD));
        let mut cells = vec![
            random.scene.scene.clone(),
            random.triangles().to_string(),
            format!("{:.2}", random.scene.features.sigma),
            milliseconds(grid.build_seconds),
            milliseconds(kd.build_seconds),
        ];
        for of_rays in [Some(random), path].into_iter().flatten() {
            let (grid, kd) = (of_rays.times(Kind::Grid), of_rays.times(KD));
            cells.push(format!("{:.3}", 1e6 * grid.ray_seconds));
            cells.push(format!("{:.3}", 1e6 * kd.ray_seconds));
            cells.push(rays_text(critical_rays(of_rays)));
        }
        table.add_row(cells);
        if let Some(seed) = SeedRow::of(&random.scene.scene) {
            table.add_row(seed_cells(seed));
        }
    }
    text::align_right(&mut table, 1);
    table
}

fn seed_cells(seed: &SeedRow) -> Vec<String> {
    let mut cells = vec![
        format!("  paper: {}", seed.scene),
        seed.triangles.to_string(),
        format!("{:.2}", seed.sigma),
        format!("{}", seed.build_grid_ms),
        format!("{}", seed.build_kd_ms),
    ];
    for scheme in SCHEMES {
        let rays = seed.rays(scheme);
        cells.push(format!("{:.1}", rays.grid_us));
        cells.push(format!("{:.1}", rays.kd_us));
        cells.push(rays_text(rays.critical));
    }
    cells
}

fn milliseconds(seconds: f64) -> String {
    format!("{:.2}", 1e3 * seconds)
}

/// The number of rays for which the totals of both are equal, as in the paper's table.
pub(super) fn critical_rays(measured: &Measured) -> Option<f64> {
    break_even(measured.times(Kind::Grid), measured.times(KD))
}

/// The ratios of a scene.
struct Ratios {
    /// T_H / T_G and t_G / t_H.
    build: f64,
    ray: f64,
    /// R_C for each triangle, where rays of the kd-tree are faster.
    rays_each: Option<f64>,
    /// T_G / T_H: the cost of a grid that is discarded.
    slowdown: f64,
    /// The speed-up of log₂ N rays by the grid, builds included.
    speedup: f64,
}

impl Ratios {
    fn of(triangles: f64, grid: &Times, kd: &Times) -> Self {
        let few = triangles.max(2.0).log2();
        Self {
            build: kd.build_seconds / grid.build_seconds,
            ray: grid.ray_seconds / kd.ray_seconds,
            rays_each: break_even(grid, kd).map(|rays| rays / triangles),
            slowdown: grid.build_seconds / kd.build_seconds,
            speedup: kd.total(few) / grid.total(few),
        }
    }
}

/// The paper's averages and ours.
pub(super) fn averages(measured: &[Measured]) -> String {
    let mut text = String::new();
    for scheme in SCHEMES {
        let ours = of_scheme(measured, scheme).into_iter().map(|measured| {
            let triangles = measured.triangles() as f64;
            Ratios::of(triangles, measured.times(Kind::Grid), measured.times(KD))
        });
        let seed = TABLE.iter().map(|row| {
            let rays = row.rays(scheme);
            let grid = Times::new(1e-3 * row.build_grid_ms, 1e-6 * rays.grid_us);
            let kd = Times::new(1e-3 * row.build_kd_ms, 1e-6 * rays.kd_us);
            Ratios::of(row.triangles, &grid, &kd)
        });
        let lines = [
            ("ours", ours.collect::<Vec<_>>()),
            ("the paper's rows", seed.collect()),
        ];
        let _ = writeln!(text, "{} rays:", name(scheme));
        for (whose, ratios) in lines {
            let _ = writeln!(text, "  {whose}: {}", line(&ratios));
        }
    }
    text += "(The paper states 4.5 % (2.1-15.4) on average, and 28.07 (6.5-46.5).)";
    text
}

pub(super) fn name(scheme: RayScheme) -> &'static str {
    match scheme {
        RayScheme::Random => "random",
        RayScheme::Path => "path-traced",
    }
}

fn line(ratios: &[Ratios]) -> String {
    let range = |of: &dyn Fn(&Ratios) -> f64| {
        let values: Vec<f64> = ratios.iter().map(of).collect();
        (arithmetic_mean(&values), minimum(&values), maximum(&values))
    };
    let (slow, least_slow, most_slow) = range(&|ratios| 100.0 * ratios.slowdown);
    let (speed, least_speed, most_speed) = range(&|ratios| ratios.speedup);
    let critical: Vec<f64> = ratios
        .iter()
        .filter_map(|ratios| ratios.rays_each)
        .collect();
    let middle = if critical.is_empty() {
        "–".to_owned()
    } else {
        format!("{:.2}", median(&critical))
    };
    format!(
        "T_H / T_G {:.1}, t_G / t_H {:.2} on average, median R_C per triangle {middle}, {} of {} scenes have one; a discarded grid \
         slows the build by {slow:.1} % ({least_slow:.1}-{most_slow:.1}), a kept one answers log2 N rays {speed:.2} times faster \
         ({least_speed:.2}-{most_speed:.2})",
        range(&|ratios| ratios.build).0,
        range(&|ratios| ratios.ray).0,
        critical.len(),
        ratios.len(),
    )
}

/// One JSON object for each scene and kind of rays.
pub(super) fn to_lines(measured: &[Measured]) -> anyhow::Result<String> {
    json_lines(measured.iter().enumerate().map(|(row, measured)| {
        let scene = &measured.scene;
        let (grid, kd) = (measured.times(Kind::Grid), measured.times(KD));
        let seed = SeedRow::of(&scene.scene).map_or(Value::Null, |seed| {
            let rays = seed.rays(scene.rays);
            json!({
                "scene": seed.scene, "triangles": seed.triangles, "sigma": seed.sigma,
                "t_build_grid_ms": seed.build_grid_ms, "t_build_kd_ms": seed.build_kd_ms,
                "t_ray_grid_us": rays.grid_us, "t_ray_kd_us": rays.kd_us,
                "rays": scene.rays, "critical_rays": rays.critical,
            })
        });
        let gain = grid.ray_seconds - kd.ray_seconds;
        json!({
            "table": "grid-table",
            "row": row + 1,
            "seed": seed,
            "ours": {
                "scene": scene.scene, "triangles": measured.triangles(), "sigma": scene.features.sigma,
                "t_build_grid_ms": 1e3 * grid.build_seconds, "t_build_kd_ms": 1e3 * kd.build_seconds,
                "t_ray_grid_us": 1e6 * grid.ray_seconds, "t_ray_kd_us": 1e6 * kd.ray_seconds,
                "rays": scene.rays, "critical_rays": critical_rays(measured),
                "critical_rays_once_built": (gain > 0.0).then(|| kd.build_seconds / gain),
                "sample_ray_grid_us": 1e6 * measured.sampled_grid().ray_seconds,
                "all": scene.times,
            },
        })
    }))
}

//! mount: a fractal mountain by midpoint displacement, below four spheres.

use std::f64::consts::{LN_2, SQRT_2};

use glam::DVec3;

use super::{CameraAndLights, camera_and_lights};
use crate::tessellate::{MeshDraft, RESOLUTION, UnitSphere};

const FRACTAL_DIMENSION: f64 = 2.2;
/// Seed of the random heights.
const SEED: u64 = 21;

pub(super) fn make(size: u32) -> (MeshDraft, CameraAndLights) {
    let mut draft = MeshDraft::default();
    let unit = UnitSphere::new(RESOLUTION);
    // Four touching spheres, at the corners of a tetrahedron whose edge is twice the radius.
    let (center, radius) = (DVec3::new(-0.8, 0.8, 1.0), 0.17);
    for corner in [
        [1.0, 1.0, 1.0],
        [1.0, -1.0, -1.0],
        [-1.0, 1.0, -1.0],
        [-1.0, -1.0, 1.0],
    ] {
        draft.sphere(
            &unit,
            center + DVec3::from(corner) * radius / SQRT_2,
            radius,
        );
    }

    let cells = 1_usize << size;
    let side = cells + 1;
    let heights = heights(cells);
    let mut corners = Vec::with_capacity(side * side);
    for y in 0..side {
        for x in 0..side {
            let position = DVec3::new(
                coordinate(x, cells),
                coordinate(y, cells),
                heights[y * side + x],
            );
            corners.push(draft.vertex(position));
        }
    }
    for y in 0..cells {
        for x in 0..cells {
            let low = y * side + x;
            draft.quad([low, low + 1, low + side + 1, low + side].map(|corner| corners[corner]));
        }
    }
    (
        draft,
        camera_and_lights([-1.6, 1.6, 1.7], [0.0; 3], &[[-100.0, -100.0, 100.0]]),
    )
}

#[expect(
    clippy::cast_precision_loss,
    reason = "grids have at most 4096 cells a side"
)]
fn coordinate(index: usize, cells: usize) -> f64 {
    2.0 * index as f64 / cells as f64 - 1.0
}

/// The heights at the corners of `cells` × `cells` cells, row by row, over a square of side 2. `cells` is a power of two. The
/// heights at the corners of the square are 0.
fn heights(cells: usize) -> Vec<f64> {
    let side = cells + 1;
    let mut heights = vec![0.0; side * side];
    let ratio = 2.0 / libm::exp(LN_2 / (FRACTAL_DIMENSION - 1.0));
    let roughness = libm::sqrt(ratio * ratio - 1.0);
    let mut width = cells;
    let mut rise = roughness;
    while width > 1 {
        let half = width / 2;
        for y in (0..cells).step_by(width) {
            for x in (0..cells).step_by(width) {
                let at = |x: usize, y: usize| y * side + x;
                let [a, b, c, d] = [
                    (x, y),
                    (x + width, y),
                    (x + width, y + width),
                    (x, y + width),
                ]
                .map(|(x, y)| heights[at(x, y)]);
                // The midpoint of an edge between two cells is displaced twice, to the same height.
                for (x, y, mean) in [
                    (x + half, y, (a + b) / 2.0),
                    (x + width, y + half, (b + c) / 2.0),
                    (x + half, y + width, (c + d) / 2.0),
                    (x, y + half, (d + a) / 2.0),
                ] {
                    heights[at(x, y)] = mean + rise * normal(x, y, width);
                }
                let (x, y) = (x + half, y + half);
                let mean = (a + b + c + d) / 4.0;
                heights[at(x, y)] = mean + SQRT_2 * rise * normal(x, y, width);
            }
        }
        width = half;
        rise /= 2.0;
    }
    heights
}

/// A reproducible, approximately normal number for a position and a cell width: a sum of twelve uniform numbers.
fn normal(x: usize, y: usize, width: usize) -> f64 {
    let mut state = SEED;
    for word in [x, y, width] {
        state = mix(state ^ word as u64);
    }
    let mut sum = -6.0;
    for _ in 0..12 {
        state = mix(state);
        // The upper 32 bits as a number from 0 to 1.
        sum += f64::from((state >> 32) as u32) / f64::from(u32::MAX);
    }
    sum
}

/// One step of the splitmix64 generator.
fn mix(state: u64) -> u64 {
    let mut z = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_has_mean_0_and_variance_1() {
        let draws: Vec<f64> = (0..10_000).map(|i| normal(i % 100, i / 100, 2)).collect();
        let mean = draws.iter().sum::<f64>() / 1e4;
        let variance = draws.iter().map(|draw| draw * draw).sum::<f64>() / 1e4;
        assert!(mean.abs() < 0.05, "mean {mean}");
        assert!((variance - 1.0).abs() < 0.05, "variance {variance}");
    }

    #[test]
    fn only_corners_have_height_zero() {
        let heights = heights(64);
        assert_eq!(
            [
                heights[0],
                heights[64],
                heights[65 * 64],
                heights[65 * 65 - 1]
            ],
            [0.0; 4]
        );
        let moved = heights.iter().filter(|height| **height != 0.0).count();
        assert_eq!(moved, 65 * 65 - 4);
        assert!(
            heights.iter().all(|height| height.abs() < 2.5),
            "heights are bounded"
        );
    }
}

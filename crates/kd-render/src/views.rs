//! Views of the tree: heat maps, leaf depths, and the cells of a level.

use kd::glam::{DVec3, Vec3};
use kd::tree::{NodeIndex, NodeView, Tree};
use kd::{Aabb, BuildError, Hit, KdTree, Ray};
use kd_scene::{Camera, ColorSpace, View};
use rayon::prelude::*;

use crate::picture::Picture;

/// A false-color picture of one number per pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Heat {
    /// The picture, from dark (0) to bright ([`brightest`](Self::brightest) and above).
    pub picture: Picture,
    /// Mean of the numbers over all pixels.
    pub mean: f64,
    /// The number shown in the brightest color: the 99.5th percentile, at least 1.
    pub brightest: u64,
}

impl Heat {
    /// Colors `numbers`, given row by row from the top, in an image of `[width, height]` pixels.
    ///
    /// # Panics
    ///
    /// If the length of `numbers` is not `width * height`.
    pub fn new([width, height]: [u32; 2], numbers: &[u64]) -> Self {
        let mut picture = Picture::new(width, height, Vec3::ZERO, ColorSpace::Display);
        assert_eq!(numbers.len(), picture.pixels.len(), "one number per pixel");
        let mut sorted = numbers.to_vec();
        sorted.sort_unstable();
        let index = numbers.len().saturating_sub(1) * 199 / 200;
        let brightest = sorted.get(index).map_or(1, |number| (*number).max(1));
        for (pixel, number) in picture.pixels.iter_mut().zip(numbers) {
            let color = heat_color(*number as f64 / brightest as f64);
            *pixel = ColorSpace::Display.decoded(color);
        }
        Self {
            picture,
            mean: numbers.iter().sum::<u64>() as f64 / numbers.len().max(1) as f64,
            brightest,
        }
    }
}

/// The color at `share` of the scale, from 0 (dark) to 1 (bright); clamped outside of that range.
pub fn heat_color(share: f64) -> [u8; 3] {
    let colorous::Color { r, g, b } = colorous::INFERNO.eval_continuous(share.clamp(0.0, 1.0));
    [r, g, b]
}

/// The cost of the primary ray of each pixel: the sum of nodes, leaves and triangles that it visits.
pub fn heat_map(tree: &KdTree, camera: &Camera, size: [u32; 2]) -> Heat {
    by_pixel(camera, size, |ray| {
        let (_, counts) = tree.intersect_counted(ray);
        counts.nodes + counts.leaves + counts.triangles
    })
}

/// The depth of the leaf in which the primary ray of each pixel ends; 0 on a miss.
///
/// The depth is that of the kd-tree, in every layout.
///
/// # Errors
///
/// Those of [`KdTree::kd_tree`], which may build it.
pub fn leaf_depths(tree: &KdTree, camera: &Camera, size: [u32; 2]) -> Result<Heat, BuildError> {
    let kd_tree = tree.kd_tree()?;
    Ok(by_pixel(camera, size, |ray| {
        let hit = tree.intersect(ray);
        hit.map_or(0, |hit| leaf_depth(kd_tree, ray, &hit))
    }))
}

/// The depth of the leaf that holds a hit; the root has depth 0.
fn leaf_depth(tree: &Tree, ray: &Ray, hit: &Hit) -> u32 {
    let point = hit.point(ray);
    let mut node = tree.root();
    let mut depth = 0;
    while let NodeView::Interior { axis, split, first } = tree.nodes()[node.index()].view() {
        let is_above = point[axis.index()] > split;
        node = if is_above { first.sibling() } else { first };
        depth += 1;
    }
    depth
}

fn by_pixel(camera: &Camera, [width, height]: [u32; 2], of: impl Fn(&Ray) -> u32 + Sync) -> Heat {
    let view = camera.view(width as f32 / height as f32);
    let rows = (0..height).into_par_iter().flat_map_iter(|row| {
        let (view, of) = (&view, &of);
        (0..width).map(move |column| {
            let direction = view.through_pixel(column, row, width, height);
            u64::from(of(&Ray::new(view.eye, direction)))
        })
    });
    Heat::new([width, height], &rows.collect::<Vec<u64>>())
}

/// Draws over `picture` the cells of the nodes of the kd-tree at depth `level`, and of the leaves above that depth. Empty leaves are
/// skipped.
///
/// # Errors
///
/// Those of [`KdTree::kd_tree`], which may build it.
pub fn draw_boxes(
    picture: &mut Picture,
    tree: &KdTree,
    camera: &Camera,
    level: u32,
) -> Result<(), BuildError> {
    let view = camera.view(picture.width as f32 / picture.height as f32);
    let tree = tree.kd_tree()?;
    let mut cells = vec![(tree.root(), tree.bounds(), 0)];
    while let Some((node, cell, depth)) = cells.pop() {
        match tree.nodes()[node.index()].view() {
            NodeView::Interior { axis, split, first } if depth < level => {
                let (lower, upper) = cell.split(axis, split);
                let children: [(NodeIndex, Aabb); 2] = [(first, lower), (first.sibling(), upper)];
                cells.extend(children.map(|(child, cell)| (child, cell, depth + 1)));
            }
            NodeView::Leaf { count: 0, .. } => {}
            _ => {
                let hue = f64::from(depth % 12) / 12.0;
                let colorous::Color { r, g, b } = colorous::RAINBOW.eval_continuous(hue);
                let color = ColorSpace::Display.decoded([r, g, b]);
                draw_box(picture, &view, &cell, color);
            }
        }
    }
    Ok(())
}

fn draw_box(picture: &mut Picture, view: &View, cell: &Aabb, color: Vec3) {
    let ends = [cell.min.as_dvec3(), cell.max.as_dvec3()];
    let corner = |i: usize| DVec3::new(ends[i & 1].x, ends[i >> 1 & 1].y, ends[i >> 2 & 1].z);
    for from in 0..8_usize {
        for axis in [1, 2, 4] {
            if from & axis == 0 {
                draw_line(picture, view, [corner(from), corner(from | axis)], color);
            }
        }
    }
}

/// Depth of the near plane at which lines are clipped, in scene units along the view direction.
const NEAR: f64 = 1e-3;

fn draw_line(picture: &mut Picture, view: &View, ends: [DVec3; 2], color: Vec3) {
    let [forward, right, down] = [view.forward, view.right, view.down].map(|v| v.as_dvec3());
    let mut ends = ends.map(|end| end - view.eye.as_dvec3());
    let depths = ends.map(|end| end.dot(forward));
    // Clips the line at the near plane.
    for (i, other) in [(0, 1), (1, 0)] {
        if depths[i] < NEAR {
            if depths[other] < NEAR {
                return;
            }
            let fraction = (NEAR - depths[i]) / (depths[other] - depths[i]);
            ends[i] = ends[i].lerp(ends[other], fraction);
        }
    }
    let size = DVec3::new(f64::from(picture.width), f64::from(picture.height), 0.0);
    let to_pixel = |end: DVec3| {
        let depth = end.dot(forward);
        let x = end.dot(right) / right.length_squared() / depth;
        let y = end.dot(down) / down.length_squared() / depth;
        DVec3::new(0.5 + 0.5 * x, 0.5 + 0.5 * y, 0.0) * size
    };
    let [from, to] = ends.map(to_pixel);
    // At most one step per pixel, and no more steps than a visible line needs.
    let steps = (to - from)
        .abs()
        .max_element()
        .min(4.0 * size.max_element())
        .ceil()
        .max(1.0);
    let mut step = 0.0;
    while step <= steps {
        let at = from.lerp(to, step / steps);
        step += 1.0;
        if at.x >= 0.0 && at.y >= 0.0 && at.x < size.x && at.y < size.y {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "the bounds are checked above"
            )]
            let (column, row) = (at.x as u32, at.y as u32);
            let blended = picture.at(column, row).lerp(color, 0.7);
            picture.set(column, row, blended);
        }
    }
}

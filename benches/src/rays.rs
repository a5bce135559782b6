//! The five kinds of rays that every structure traces.
//!
//! Each kind is a fixed list for a scene: it depends only on the scene and its camera, since all structures must find the same
//! primary hits. Directions have unit length.

use clap::ValueEnum;
use kd::glam::Vec3;
use kd::{Hit, Mesh, Ray, offset_origin};
use kd_scene::Camera;

use crate::sampling::Random;

#[derive(Clone, Copy, Debug, Eq, PartialEq, ValueEnum)]
pub(crate) enum RayKind {
    /// Closest hit of a pinhole camera's rays, in tiles of 8 by 8 pixels
    Primary,
    /// Any hit on the open segment from each primary hit to the light
    Shadow,
    /// Any hit within a tenth of the scene's diagonal, four cosine-distributed rays from each primary hit
    Ao,
    /// Closest hit of one cosine-distributed ray from each primary hit
    Diffuse,
    /// Closest hit of rays through two random points of the scene's bounding sphere
    Random,
}

impl RayKind {
    /// Whether any hit is enough, instead of the closest.
    pub(crate) const fn is_any_hit(self) -> bool {
        matches!(self, Self::Shadow | Self::Ao)
    }

    const fn rays_per_point(self) -> usize {
        if matches!(self, Self::Ao) { 4 } else { 1 }
    }

    /// Each kind has its own random sequence, independent of the other kinds.
    const fn seed(self) -> u64 {
        self as u64
    }
}

/// Neighbors in a list are neighbors in space. Lists are thinned out in whole runs of `RUN` rays, which preserves that.
const RUN: usize = 64;
/// Pixels along the side of a tile.
const TILE: u32 = 8;
/// Length of AO rays, in diagonals of the scene.
const AO_REACH: f32 = 0.1;

/// The rays through a square image, tile by tile and row by row within each. `side` is a multiple of 8.
pub(crate) fn primary(camera: &Camera, side: u32) -> Vec<Ray> {
    picture(camera, [side, side], 1)
}

/// The rays through every `stride`th tile of an image, whose sides are multiples of 8.
pub(crate) fn picture(camera: &Camera, [width, height]: [u32; 2], stride: usize) -> Vec<Ray> {
    let view = camera.view(width as f32 / height as f32);
    let across = width / TILE;
    let tiles = (0..across * (height / TILE)).step_by(stride);
    let mut rays = Vec::with_capacity(tiles.len() * (TILE * TILE) as usize);
    for tile in tiles {
        let (left, top) = (tile % across * TILE, tile / across * TILE);
        for pixel in 0..TILE * TILE {
            let (column, row) = (left + pixel % TILE, top + pixel / TILE);
            let direction = view.through_pixel(column, row, width, height);
            rays.push(Ray::new(view.eye, direction.normalize()));
        }
    }
    rays
}

/// The origin of a further ray: just off the surface, on the side of the primary ray.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfacePoint {
    pub(crate) origin: Vec3,
    /// Of unit length, on the side of the primary ray.
    pub(crate) normal: Vec3,
}

impl SurfacePoint {
    /// `None` for a triangle that is too thin for a normal.
    pub(crate) fn new(mesh: &Mesh, ray: &Ray, hit: &Hit) -> Option<Self> {
        let normal = mesh.normal(hit.triangle).try_normalize()?;
        let normal = if normal.dot(ray.direction) > 0.0 {
            -normal
        } else {
            normal
        };
        Some(Self {
            origin: offset_origin(hit.point(ray), normal),
            normal,
        })
    }
}

/// The hits of the primary rays, in their order.
pub(crate) fn surface_points(
    mesh: &Mesh,
    primary: &[Ray],
    hits: &[Option<Hit>],
) -> Vec<SurfacePoint> {
    let pairs = primary.iter().zip(hits);
    pairs
        .filter_map(|(ray, hit)| SurfacePoint::new(mesh, ray, hit.as_ref()?))
        .collect()
}

/// The source of secondary rays.
#[derive(Debug)]
pub(crate) struct RaySource<'a> {
    pub(crate) mesh: &'a Mesh,
    pub(crate) light: Vec3,
    pub(crate) primary: &'a [Ray],
    pub(crate) points: &'a [SurfacePoint],
    /// The approximate number of secondary or random rays of a kind; 0 keeps all. The primary image is always whole.
    pub(crate) limit: usize,
}

impl RaySource<'_> {
    /// All rays of a kind.
    pub(crate) fn rays(&self, kind: RayKind) -> Vec<Ray> {
        let mut random = Random::new(kind.seed());
        let diagonal = self.mesh.bounds().diagonal();
        let points = thinned(self.points, self.limit / kind.rays_per_point());
        match kind {
            RayKind::Primary => self.primary.to_vec(),
            RayKind::Shadow => points
                .map(|point| Ray::between(point.origin, self.light))
                .collect(),
            RayKind::Ao => points
                .flat_map(|point| std::iter::repeat_n(point, kind.rays_per_point()))
                .map(|point| {
                    let direction = random.cosine_around(point.normal);
                    Ray::new(point.origin, direction).with_range(0.0, AO_REACH * diagonal)
                })
                .collect(),
            RayKind::Diffuse => points
                .map(|point| Ray::new(point.origin, random.cosine_around(point.normal)))
                .collect(),
            RayKind::Random => {
                let count = self.primary.len();
                let count = if self.limit == 0 {
                    count
                } else {
                    count.min(self.limit)
                };
                let (center, radius) = (self.mesh.bounds().center(), 0.5 * diagonal);
                let mut on_sphere = || center + radius * random.on_sphere();
                std::iter::repeat_with(|| (on_sphere(), on_sphere()))
                    .filter_map(|(from, to)| Some(Ray::new(from, (to - from).try_normalize()?)))
                    .take(if radius > 0.0 { count } else { 0 })
                    .collect()
            }
        }
    }
}

/// Every nth run of neighbors, so that about `limit` remain; all of them for a limit of 0.
fn thinned<T>(items: &[T], limit: usize) -> impl Iterator<Item = &T> {
    let stride = if limit == 0 {
        1
    } else {
        items.len().div_ceil(limit).max(1)
    };
    items.chunks(RUN).step_by(stride).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square floor at y = 0 with its camera above; the light is further up.
    fn floor() -> (Mesh, Camera, Vec3) {
        let positions = vec![
            [-4.0, 0.0, -4.0],
            [4.0, 0.0, -4.0],
            [4.0, 0.0, 4.0],
            [-4.0, 0.0, 4.0],
        ];
        let mesh = Mesh::new(positions, vec![[0, 1, 2], [0, 2, 3]]).expect("valid");
        let camera = Camera {
            eye: Vec3::new(0.0, 3.0, 0.0),
            target: Vec3::ZERO,
            up: Vec3::Z,
            fov_degrees: 60.0,
        };
        (mesh, camera, Vec3::new(0.0, 9.0, 0.0))
    }

    fn lists(limit: usize) -> Vec<(RayKind, Vec<Ray>)> {
        let (mesh, camera, light) = floor();
        let primary = primary(&camera, 32);
        let hits: Vec<Option<Hit>> = primary
            .iter()
            .map(|ray| kd_trace::brute_force::intersect(&mesh, ray))
            .collect();
        let points = surface_points(&mesh, &primary, &hits);
        assert_eq!(points.len(), 1024, "every pixel sees the floor");
        let source = RaySource {
            mesh: &mesh,
            light,
            primary: &primary,
            points: &points,
            limit,
        };
        RayKind::value_variants()
            .iter()
            .map(|kind| (*kind, source.rays(*kind)))
            .collect()
    }

    #[test]
    fn counts_match_the_limit() {
        let counts = |limit| {
            lists(limit)
                .iter()
                .map(|(_, rays)| rays.len())
                .collect::<Vec<_>>()
        };
        assert_eq!(
            counts(0),
            [1024, 1024, 4096, 1024, 1024],
            "four AO rays a hit"
        );
        assert_eq!(
            counts(256),
            [1024, 256, 256, 256, 256],
            "the image is whole, the others are thinned out"
        );
    }

    #[test]
    fn directions_are_unit_but_for_segments() {
        for (kind, rays) in lists(0) {
            for ray in rays.iter().filter(|_| kind != RayKind::Shadow) {
                assert!(
                    (ray.direction.length() - 1.0).abs() < 1e-6,
                    "{kind:?} {ray:?}"
                );
            }
        }
    }

    #[test]
    fn secondary_rays_leave_the_surface() {
        let (mesh, _, light) = floor();
        for (kind, rays) in lists(0) {
            for ray in &rays {
                let hit = kd_trace::brute_force::intersect(&mesh, ray);
                match kind {
                    RayKind::Primary => assert!(hit.is_some(), "{ray:?}"),
                    RayKind::Random => {}
                    _ => assert_eq!(hit, None, "{kind:?} {ray:?}: nothing is above the floor"),
                }
                if kind == RayKind::Shadow {
                    assert!(
                        ray.t_min > 0.0 && ray.t_max < 1.0,
                        "an open segment: {ray:?}"
                    );
                    assert!(
                        (ray.at(1.0) - light).length() < 1e-5,
                        "{ray:?} ends at the light"
                    );
                }
                if kind == RayKind::Ao {
                    let reach = ray.t_max / mesh.bounds().diagonal();
                    assert!((reach - 0.1).abs() < 1e-6, "{ray:?}");
                }
            }
        }
    }

    #[test]
    fn primary_rays_come_in_tiles() {
        let (_, camera, _) = floor();
        let rays = primary(&camera, 32);
        let view = camera.view(1.0);
        // The second tile starts at column 8, row 0; its tenth ray is one row down and one to the right.
        let expected = view.through_pixel(9, 1, 32, 32).normalize();
        assert_eq!(rays[64 + 9].direction, expected, "8 by 8 pixels");
    }

    #[test]
    fn seeded_rays_are_pinned() {
        let lists = lists(0);
        let of = |kind| {
            &lists
                .iter()
                .find(|(k, _)| *k == kind)
                .expect("all are there")
                .1
        };
        let bits = |kind| of(kind)[100].direction.to_array().map(f32::to_bits);
        let seen = [RayKind::Ao, RayKind::Diffuse, RayKind::Random].map(bits);
        assert_eq!(seen, PINNED, "{seen:#x?}");
    }

    const PINNED: [[u32; 3]; 3] = [
        [0x3f44_12d4, 0x3eeb_0956, 0x3ee6_7bb4],
        [0x3e92_515c, 0x3e6a_6a55, 0x3f6e_38a4],
        [0xbf46_dd21, 0xbe5e_0668, 0xbf17_5ad1],
    ];

    #[test]
    fn meshes_without_hits_give_no_secondary_rays() {
        let mesh = Mesh::new(vec![], vec![]).expect("valid");
        let camera = Camera::looking_at_whole(mesh.bounds(), Vec3::Y);
        let primary = primary(&camera, 8);
        let source = RaySource {
            mesh: &mesh,
            light: Vec3::Y,
            primary: &primary,
            points: &[],
            limit: 0,
        };
        let counts = RayKind::value_variants()
            .iter()
            .map(|kind| source.rays(*kind).len());
        assert_eq!(
            counts.collect::<Vec<_>>(),
            [64, 0, 0, 0, 0],
            "an empty box has no sphere"
        );
    }
}

//! A generated city in f64.

use kd::glam::{DVec2, DVec3, Vec3};
use kd_oracle::rng::Rng;

/// The coordinates of a city.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Grid {
    /// Multiples of this power of two.
    Of(f64),
    /// Numbers of f32 that are zero or above 1/16, so that f64 adds millions to them exactly.
    OfF32,
    /// Any f64.
    None,
}

impl Grid {
    pub(crate) fn snap(self, point: DVec3) -> DVec3 {
        match self {
            Self::Of(unit) => (point / unit).round() * unit,
            Self::OfF32 => {
                let point = point.as_vec3().as_dvec3();
                DVec3::select(
                    point.abs().cmplt(DVec3::splat(1.0 / 16.0)),
                    DVec3::ZERO,
                    point,
                )
            }
            Self::None => point,
        }
    }
}

/// Houses with hipped roofs over a ground of squares, around zero. Each house is closed.
pub(crate) struct City {
    pub(crate) positions: Vec<[f64; 3]>,
    pub(crate) triangles: Vec<[u32; 3]>,
    pub(crate) grid: Grid,
    /// Half of its side.
    pub(crate) reach: f32,
}

impl City {
    /// A city of `lots`² lots, each a square with sides of `lot`.
    pub(crate) fn new(lots: u16, lot: f32, grid: Grid) -> Self {
        let mut city = Self {
            positions: Vec::new(),
            triangles: Vec::new(),
            grid,
            reach: f32::from(lots) * lot / 2.0,
        };
        let (reach, lots, lot) = (f64::from(city.reach), u32::from(lots), f64::from(lot));
        let corner = |i: u32, j: u32| {
            let [x, y] = [i, j].map(|i| f64::from(i) * lot - reach);
            DVec3::new(x, y, 0.0)
        };
        let ground = (0..=lots).flat_map(|i| (0..=lots).map(move |j| corner(i, j)));
        city.add(ground);
        let mut rng = Rng(5);
        for i in 0..lots {
            for j in 0..lots {
                let at = |di: u32, dj: u32| (i + di) * (lots + 1) + j + dj;
                city.quad([at(0, 0), at(1, 0), at(1, 1), at(0, 1)]);
                city.house(
                    corner(i, j) + DVec3::new(0.5, 0.5, 0.0) * lot,
                    lot,
                    &mut rng,
                );
            }
        }
        city
    }

    fn add(&mut self, points: impl Iterator<Item = DVec3>) {
        let grid = self.grid;
        self.positions
            .extend(points.map(|point| grid.snap(point).to_array()));
    }

    fn quad(&mut self, [a, b, c, d]: [u32; 4]) {
        self.triangles.extend([[a, b, c], [a, c, d]]);
    }

    fn house(&mut self, center: DVec3, lot: f64, rng: &mut Rng) {
        let mut share = |low, high| f64::from(rng.between(low, high));
        let turn = DVec2::from_angle(share(0.0, 3.0));
        let half = DVec2::new(share(0.1, 0.3), share(0.1, 0.3)) * lot;
        let [eaves, top] = [share(0.1, 0.5) * lot, share(0.55, 1.2) * lot];
        let first = u32::try_from(self.positions.len()).expect("few");
        let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let corners = corners.map(|corner| turn.rotate(half * DVec2::from(corner)));
        for height in [0.0, eaves] {
            let ring = corners.iter();
            self.add(ring.map(|corner| center + corner.extend(height)));
        }
        self.add([center + DVec3::Z * top].into_iter());
        let apex = first + 8;
        self.quad([first, first + 1, first + 2, first + 3]);
        for k in 0..4 {
            let next = (k + 1) % 4;
            let (low, high) = ([first + k, first + next], [first + 4 + k, first + 4 + next]);
            self.quad([low[0], low[1], high[1], high[0]]);
            self.triangles.push([high[0], high[1], apex]);
        }
    }

    /// The vertices in f32.
    pub(crate) fn rounded(&self) -> Vec<[f32; 3]> {
        let positions = self.positions.iter();
        positions
            .map(|position| DVec3::from(*position).as_vec3().to_array())
            .collect()
    }

    pub(crate) fn shifted(&self, by: DVec3) -> Vec<[f64; 3]> {
        let positions = self.positions.iter();
        positions
            .map(|position| (DVec3::from(*position) + by).to_array())
            .collect()
    }

    /// The start of a ray, on the grid, and a direction: from above, in a street, from a vertex, along an axis, or past the city.
    pub(crate) fn ray(&self, rng: &mut Rng) -> (DVec3, [f32; 3]) {
        let vertex = DVec3::from(rng.pick(&self.positions));
        let mut somewhere = |height: f32| {
            let point = rng.vec3() * self.reach;
            DVec3::new(
                point.x.into(),
                point.y.into(),
                rng.between(0.0, height).into(),
            )
        };
        let (above, below) = (somewhere(self.reach), somewhere(0.1 * self.reach));
        let random = rng.direction();
        let (start, direction) = match rng.below(6) {
            0 => (above, (vertex - above).as_vec3()),
            1 => (below, (vertex - below).as_vec3()),
            2 => (below, (0.1 * random.with_z(rng.between(-0.1, 0.1)))),
            3 => (vertex, random),
            4 => (vertex.with_z(above.z), Vec3::NEG_Z),
            _ => (above, random),
        };
        (self.grid.snap(start), direction.to_array())
    }
}

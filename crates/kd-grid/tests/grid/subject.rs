//! A grid with its mesh, as tests ask it.

use kd_core::{Hit, Mesh, Ray};
use kd_grid::{GridOptions, Overlap, UniformGrid};
use kd_oracle::Answers;

pub(crate) struct Subject<'a> {
    pub(crate) mesh: &'a Mesh,
    pub(crate) grid: UniformGrid,
}

impl<'a> Subject<'a> {
    pub(crate) fn new(mesh: &'a Mesh, options: &GridOptions) -> Self {
        let grid = UniformGrid::build(mesh, options).expect("valid options");
        Self { mesh, grid }
    }

    /// Grids of few cells and of many, by box and exact.
    pub(crate) fn several(mesh: &'a Mesh) -> Vec<Self> {
        let options = [
            GridOptions::new(),
            GridOptions::new().with_density(40.0),
            GridOptions::new().with_density(100.0),
            GridOptions::new()
                .with_density(0.3)
                .with_overlap(Overlap::Box),
            GridOptions::new()
                .with_density(7.0)
                .with_overlap(Overlap::Box),
        ];
        options
            .iter()
            .map(|options| Self::new(mesh, options))
            .collect()
    }

    /// Axis and place of borders between cells.
    pub(crate) fn borders(&self) -> Vec<(usize, f32)> {
        let bounds = self.mesh.bounds();
        let along = |axis: usize| {
            let cells = self.grid.resolution()[axis];
            (0..=cells).map(move |i| {
                let share = i as f32 / cells as f32;
                (
                    axis,
                    bounds.min[axis] * (1.0 - share) + bounds.max[axis] * share,
                )
            })
        };
        (0..3).flat_map(along).collect()
    }
}

impl Answers for Subject<'_> {
    fn closest(&self, ray: &Ray) -> Option<Hit> {
        self.grid.intersect(self.mesh, ray)
    }

    fn any(&self, ray: &Ray) -> bool {
        self.grid.occluded(self.mesh, ray)
    }

    fn first(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
        self.grid.hits(self.mesh, ray, max, out);
    }

    fn planes(&self) -> Vec<(usize, f32)> {
        self.borders()
    }
}

/// As what tests of several structures ask for.
pub(crate) fn all<'a>(subjects: &'a [Subject<'_>]) -> Vec<&'a dyn Answers> {
    subjects
        .iter()
        .map(|subject| subject as &dyn Answers)
        .collect()
}

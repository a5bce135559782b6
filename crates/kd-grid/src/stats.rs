//! Statistics of the cells of a grid.

use std::fmt;

use crate::grid::UniformGrid;

/// Statistics of the numbers of references in cells: those by which Havran, Přikryl and Purgathofer (2000) compare scenes, in the
/// form of Hapala, Karlík and Havran (2011, equations 1 to 6).
///
/// `Display` is the text form of reports and snapshots.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct GridStats {
    /// Triangles of the mesh.
    pub triangles: usize,
    /// Triangles of zero area among them, if counted: see [`with_zero_area`](Self::with_zero_area).
    pub zero_area: Option<usize>,
    /// Cells along each axis.
    pub resolution: [u32; 3],
    /// Cells in all.
    pub cells: usize,
    /// Cells without references.
    pub empty_cells: usize,
    /// References in all cells; a triangle in several cells counts several times.
    pub references: usize,
    /// Largest number of references in a cell (equation 2).
    pub max_refs: u32,
    /// References per cell (equation 3).
    pub mean: f64,
    /// Variance of references per cell (equation 4); 0 for a single cell.
    pub variance: f64,
    /// Skewness of references per cell (equation 5); 0 if all cells have the same number.
    pub skewness: f64,
    /// Excess kurtosis of references per cell (equation 6), 0 for a normal distribution; 0 if all cells have the same number.
    pub kurtosis: f64,
    /// Number of times that the resolution was halved for the limit of references: see
    /// [`with_max_refs`](crate::GridOptions::with_max_refs).
    pub halvings: u32,
    /// Bytes of cells and references.
    pub bytes: usize,
}

impl GridStats {
    pub(crate) fn of(grid: &UniformGrid) -> Self {
        let cells = grid.lattice().cells();
        let references = grid.refs().len();
        let count = cells as f64;
        let mean = references as f64 / count;
        let (mut empty_cells, mut max_refs) = (0, 0);
        // Sums of powers of the differences from the mean.
        let [mut squares, mut cubes, mut fourths] = [0.0; 3];
        for refs in grid.counts() {
            empty_cells += usize::from(refs == 0);
            max_refs = max_refs.max(refs);
            let more = f64::from(refs) - mean;
            let square = more * more;
            squares += square;
            cubes += square * more;
            fourths += square * square;
        }
        let variance = if cells > 1 {
            squares / (count - 1.0)
        } else {
            0.0
        };
        let (skewness, kurtosis) = if variance > 0.0 {
            let deviation = variance.sqrt();
            let skewness = cubes / (count * variance * deviation);
            (skewness, fourths / (count * variance * variance) - 3.0)
        } else {
            (0.0, 0.0)
        };
        Self {
            triangles: grid.triangles() as usize,
            zero_area: None,
            resolution: grid.resolution(),
            cells,
            empty_cells,
            references,
            max_refs,
            mean,
            variance,
            skewness,
            kurtosis,
            halvings: grid.halvings(),
            bytes: grid.bytes(),
        }
    }

    /// The same statistics with the count of triangles of zero area, from
    /// [`Mesh::zero_area_count`](kd_core::Mesh::zero_area_count), which is linear in the number of triangles.
    #[must_use]
    pub fn with_zero_area(mut self, zero_area: usize) -> Self {
        self.zero_area = Some(zero_area);
        self
    }

    /// The share of empty cells (equation 1, which prints N for the number of cells).
    pub fn sparseness(&self) -> f64 {
        self.empty_cells as f64 / self.cells as f64
    }

    /// The square root of the [`variance`](Self::variance). Below about 2, a grid is the better structure for any number of rays
    /// (Hapala et al. 2011, section 3, on the figures of Havran et al.).
    pub fn standard_deviation(&self) -> f64 {
        self.variance.sqrt()
    }

    /// References per triangle; 0 without triangles.
    pub fn refs_per_triangle(&self) -> f64 {
        if self.triangles == 0 {
            0.0
        } else {
            self.references as f64 / self.triangles as f64
        }
    }
}

impl fmt::Display for GridStats {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "triangles        {}", self.triangles)?;
        if let Some(zero_area) = self.zero_area {
            write!(f, " ({zero_area} of zero area)")?;
        }
        let [x, y, z] = self.resolution;
        write!(f, "\ncells            {} ({x} x {y} x {z})", self.cells)?;
        if self.halvings > 0 {
            write!(
                f,
                ", halved {} times for the limit of references",
                self.halvings
            )?;
        }
        let (share, each) = (100.0 * self.sparseness(), self.refs_per_triangle());
        writeln!(f, "\nempty            {} ({share:.1} %)", self.empty_cells)?;
        writeln!(
            f,
            "references       {} ({each:.2} per triangle)",
            self.references
        )?;
        writeln!(
            f,
            "in a cell        {:.3} on average, at most {}",
            self.mean, self.max_refs
        )?;
        writeln!(f, "deviation        {:.3}", self.standard_deviation())?;
        writeln!(f, "skewness         {:.2}", self.skewness)?;
        writeln!(f, "kurtosis         {:.1}", self.kurtosis)?;
        write!(f, "bytes            {}", self.bytes)
    }
}

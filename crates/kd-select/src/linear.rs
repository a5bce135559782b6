//! Linear models of few terms.

/// Number of features.
pub(crate) const TERMS: usize = 7;

/// The features of a scene.
pub(crate) type Row = [f64; TERMS];

/// A linear function of features: a mean, and for each feature a weight per standard deviation from the feature's mean.
///
/// Fitted by least squares with a penalty on the weights (A. Hoerl and R. Kennard, *Ridge Regression*, 1970): with few scenes, a
/// feature that explains little gets a small weight.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Linear {
    mean: f64,
    features: [Feature; TERMS],
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Feature {
    mean: f64,
    deviation: f64,
    weight: f64,
}

/// Features are clamped to this number of standard deviations: the calibration has no scenes beyond.
const FURTHEST: f64 = 3.0;

impl Linear {
    /// Fits one value per row. `None` without rows. A penalty of 1 weighs as much as one row.
    pub(crate) fn fit(rows: &[Row], values: &[f64], penalty: f64) -> Option<Self> {
        if rows.is_empty() {
            return None;
        }
        let count = rows.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let mut features = [Feature::default(); TERMS];
        for (term, feature) in features.iter_mut().enumerate() {
            feature.mean = rows.iter().map(|row| row[term]).sum::<f64>() / count;
            let squares = rows.iter().map(|row| (row[term] - feature.mean).powi(2));
            feature.deviation = (squares.sum::<f64>() / count).sqrt();
        }
        let mut linear = Self { mean, features };
        let mut matrix = [[0.0; TERMS]; TERMS];
        let mut right = [0.0; TERMS];
        for (row, value) in rows.iter().zip(values) {
            let row = linear.standard(row);
            for i in 0..TERMS {
                right[i] += row[i] * (value - mean);
                for j in 0..TERMS {
                    matrix[i][j] += row[i] * row[j];
                }
            }
        }
        for (i, row) in matrix.iter_mut().enumerate() {
            row[i] += penalty;
        }
        let weights = solved(matrix, right);
        for (feature, weight) in linear.features.iter_mut().zip(weights) {
            feature.weight = weight;
        }
        Some(linear)
    }

    pub(crate) fn at(&self, row: &Row) -> f64 {
        let terms = self.standard(row).into_iter().zip(&self.features);
        self.mean + terms.map(|(x, feature)| x * feature.weight).sum::<f64>()
    }

    /// A row in standard deviations from the mean; 0 for a constant feature.
    fn standard(&self, row: &Row) -> Row {
        let mut standard = *row;
        for (x, feature) in standard.iter_mut().zip(&self.features) {
            *x = if feature.deviation > 0.0 {
                ((*x - feature.mean) / feature.deviation).clamp(-FURTHEST, FURTHEST)
            } else {
                0.0
            };
        }
        standard
    }
}

/// Gaussian elimination. The matrix is symmetric and positive definite, so the diagonal serves as pivots.
fn solved(mut matrix: [Row; TERMS], mut right: Row) -> Row {
    for pivot in 0..TERMS {
        let pivot_row = matrix[pivot];
        for row in (0..TERMS).filter(|row| *row != pivot) {
            let factor = matrix[row][pivot] / pivot_row[pivot];
            for (value, above) in matrix[row].iter_mut().zip(pivot_row) {
                *value -= factor * above;
            }
            right[row] -= factor * right[pivot];
        }
    }
    for (i, value) in right.iter_mut().enumerate() {
        *value /= matrix[i][i];
    }
    right
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows() -> Vec<Row> {
        let x = |i: u32, k: u32| f64::from((i * (2 * k + 3) + i * i * (k + 1)) % 17);
        (0..40)
            .map(|i| [x(i, 0), x(i, 1), x(i, 2), x(i, 3), x(i, 4), x(i, 5), 7.0])
            .collect()
    }

    #[test]
    fn a_linear_function_is_found() {
        let value = |row: &Row| 3.0 + 2.0 * row[0] - 0.5 * row[2] + 0.25 * row[3];
        let rows = rows();
        let values: Vec<f64> = rows.iter().map(value).collect();
        let linear = Linear::fit(&rows, &values, 1e-9).expect("rows");
        for row in &rows {
            assert!(
                (linear.at(row) - value(row)).abs() < 1e-6,
                "{row:?} {linear:?}"
            );
        }
    }

    #[test]
    fn a_penalty_pulls_towards_the_mean() {
        let rows = rows();
        let values: Vec<f64> = rows.iter().map(|row| row[0]).collect();
        let spread = |penalty: f64| {
            let linear = Linear::fit(&rows, &values, penalty).expect("rows");
            (linear.at(&rows[3]) - linear.mean).abs()
        };
        let spreads = [0.0, 1.0, 100.0, 1e9].map(|penalty| spread(penalty + 1e-9));
        assert!(spreads.is_sorted_by(|a, b| a > b), "{spreads:?}");
        assert!(spreads[3] < 1e-6, "{spreads:?}");
        assert_eq!(Linear::fit(&[], &[], 1.0), None, "of nothing");
    }

    #[test]
    fn features_far_from_the_mean_are_clamped() {
        let rows = rows();
        let values: Vec<f64> = rows.iter().map(|row| row[0]).collect();
        let linear = Linear::fit(&rows, &values, 1e-9).expect("rows");
        let at = |x: f64| linear.at(&[x, 8.0, 8.0, 8.0, 8.0, 8.0, 7.0]);
        assert_eq!(at(1e3), at(1e9), "both are clamped");
        let one = Linear::fit(&rows[..1], &values[..1], 1.0).expect("one row");
        assert_eq!(one.at(&rows[7]), values[0], "the only value");
    }
}

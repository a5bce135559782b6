//! Non-negative least squares, for a handful of unknowns.

/// The number of unknowns: a constant and the counted steps.
pub(super) const TERMS: usize = 5;

/// One equation: the counts of all terms, and their total cost. Positive.
#[derive(Clone, Copy, Debug)]
pub(super) struct Equation {
    pub(super) counts: [f64; TERMS],
    pub(super) total: f64,
}

/// The costs of the best fit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fit {
    pub(super) costs: [f64; TERMS],
    /// The explained share of the variance of the totals, of the kept equations.
    pub(super) r_squared: f64,
    /// The median and the ninth decile of |predicted / total - 1| over all equations.
    pub(super) median_error: f64,
    pub(super) ninth_decile_error: f64,
    pub(super) kept: usize,
}

/// One of this number of equations, those of greatest error, is left out of the second pass: an interrupted measurement says
/// nothing about costs.
const OUTLIERS: usize = 20;

/// Least squares of relative errors without negative costs, in two passes: the second without the outliers of the first.
///
/// `None` without equations.
pub(super) fn fit(equations: &[Equation]) -> Option<Fit> {
    let first = non_negative(equations)?;
    let mut kept = equations.to_vec();
    kept.sort_by(|a, b| error(a, &first).total_cmp(&error(b, &first)));
    kept.truncate(equations.len() - equations.len() / OUTLIERS);
    let costs = non_negative(&kept)?;
    let mut errors: Vec<f64> = equations.iter().map(|e| error(e, &costs)).collect();
    errors.sort_by(f64::total_cmp);
    Some(Fit {
        costs,
        r_squared: r_squared(&kept, &costs),
        median_error: errors[errors.len() / 2],
        ninth_decile_error: errors[errors.len() * 9 / 10],
        kept: kept.len(),
    })
}

fn predicted(equation: &Equation, costs: &[f64; TERMS]) -> f64 {
    let terms = equation.counts.iter().zip(costs);
    terms.map(|(count, cost)| count * cost).sum()
}

fn error(equation: &Equation, costs: &[f64; TERMS]) -> f64 {
    (predicted(equation, costs) / equation.total - 1.0).abs()
}

fn r_squared(equations: &[Equation], costs: &[f64; TERMS]) -> f64 {
    let mean = equations.iter().map(|e| e.total).sum::<f64>() / equations.len() as f64;
    let squares =
        |of: &dyn Fn(&Equation) -> f64| -> f64 { equations.iter().map(|e| of(e).powi(2)).sum() };
    1.0 - squares(&|e| predicted(e, costs) - e.total) / squares(&|e| e.total - mean)
}

/// Upper limit of passes over the terms, and the relative change of a cost in the last pass.
const PASSES: usize = 1_000_000;
const CHANGE: f64 = 1e-13;

/// Least squares of relative errors without negative costs: each cost in turn gets its best value at the present others, or 0
/// (the projected Gauss-Seidel method on the normal equations; C. Cryer: *The Solution of a Quadratic Programming Problem Using
/// Systematic Overrelaxation*, 1971).
fn non_negative(equations: &[Equation]) -> Option<[f64; TERMS]> {
    let mut matrix = [[0.0; TERMS]; TERMS];
    let mut right = [0.0; TERMS];
    for equation in equations {
        let row = equation.counts.map(|count| count / equation.total);
        for i in 0..TERMS {
            right[i] += row[i];
            for j in 0..TERMS {
                matrix[i][j] += row[i] * row[j];
            }
        }
    }
    let mut costs = [0.0; TERMS];
    for _ in 0..PASSES {
        let before = costs;
        // A term that never occurs costs nothing.
        for i in (0..TERMS).filter(|i| matrix[*i][*i] > 0.0) {
            let product: f64 = matrix[i].iter().zip(&costs).map(|(a, b)| a * b).sum();
            costs[i] = f64::max(0.0, costs[i] + (right[i] - product) / matrix[i][i]);
        }
        let mut pairs = costs.iter().zip(before);
        if pairs.all(|(cost, before)| (cost - before).abs() <= CHANGE * cost) {
            break;
        }
    }
    (!equations.is_empty()).then_some(costs)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn equations(costs: [f64; TERMS], noise: impl Fn(usize) -> f64) -> Vec<Equation> {
        let equation = |i: usize| {
            let of = |step: usize, most: usize| (i * step % most) as f64;
            let counts = [1.0, of(7, 31), of(5, 13), of(11, 17), of(3, 5)];
            let exact = Equation { counts, total: 0.0 };
            let total = predicted(&exact, &costs) * (1.0 + noise(i));
            Equation { counts, total }
        };
        (0..400).map(equation).collect()
    }

    #[test]
    fn known_costs_come_back() {
        let costs = [30.0, 4.0, 3.0, 9.0, 25.0];
        let fit = fit(&equations(costs, |_| 0.0)).expect("equations");
        for (found, cost) in fit.costs.iter().zip(costs) {
            assert!((found - cost).abs() < 1e-6, "{fit:?}");
        }
        assert!(
            fit.r_squared > 0.999_999 && fit.median_error < 1e-6,
            "{fit:?}"
        );
    }

    #[test]
    fn interrupted_measurements_do_not_count() {
        let costs = [30.0, 4.0, 3.0, 9.0, 25.0];
        let sometimes = |i: usize| if i.is_multiple_of(30) { 4.0 } else { 0.0 };
        let fit = fit(&equations(costs, sometimes)).expect("equations");
        assert!((fit.costs[1] - 4.0).abs() < 0.01, "{fit:?}");
        assert_eq!(fit.kept, 380, "one in twenty is left out");
    }

    #[test]
    fn no_cost_is_negative() {
        let costs = [30.0, 4.0, -1.0, 9.0, 25.0];
        let fit = fit(&equations(costs, |_| 0.0)).expect("equations");
        assert_eq!(fit.costs[2], 0.0, "{fit:?}");
        assert!(fit.costs.iter().all(|cost| *cost >= 0.0), "{fit:?}");
        assert!(super::fit(&[]).is_none(), "nothing to fit");
    }
}

//! Least squares: Gauss and Newton's method for a handful of parameters.

/// Steps after which no better parameters are looked for.
const MOST_STEPS: usize = 50;

/// Steps that change the sum of squares by less than this share have arrived.
const ENOUGH: f64 = 1e-14;

/// How far off a model is at one place (pixels), and the derivatives of that by its parameters.
pub(super) type ResidualRow<const N: usize> = (f64, [f64; N]);

/// The parameters from `start` on at which the squares of all `rows` have the least sum; `None` when
/// they do not tell the parameters apart.
pub(super) fn least_squares<const N: usize>(
    start: [f64; N],
    rows: impl Fn(&[f64; N]) -> Vec<ResidualRow<N>>,
) -> Option<[f64; N]> {
    let mut at = start;
    let mut here = rows(&at);
    let mut sum = sum_of_squares(&here);
    for _ in 0..MOST_STEPS {
        let step = step(&here)?;
        // Where a whole step is too far, the half of it may do.
        let tried = (0..20).find_map(|halvings| {
            let share = 0.5_f64.powi(halvings);
            let next: [f64; N] = std::array::from_fn(|i| at[i] - share * step[i]);
            let there = rows(&next);
            let other = sum_of_squares(&there);
            (other <= sum).then_some((next, there, other))
        });
        let Some((next, there, other)) = tried else { break };
        let gained = sum - other;
        (at, here, sum) = (next, there, other);
        if gained <= ENOUGH * sum {
            break;
        }
    }
    at.iter().all(|x| x.is_finite()).then_some(at)
}

fn sum_of_squares<const N: usize>(rows: &[ResidualRow<N>]) -> f64 {
    rows.iter().map(|(off, _)| off * off).sum()
}

/// The solution of the normal equations, by Cholesky's factors of a matrix with a diagonal of 1.
fn step<const N: usize>(rows: &[ResidualRow<N>]) -> Option<[f64; N]> {
    let mut matrix = [[0.0; N]; N];
    let mut right = [0.0; N];
    for (off, by) in rows {
        for i in 0..N {
            right[i] += by[i] * off;
            for k in 0..=i {
                matrix[i][k] += by[i] * by[k];
            }
        }
    }
    let scale: [f64; N] = std::array::from_fn(|i| matrix[i][i].sqrt());
    for i in 0..N {
        right[i] /= scale[i];
        for k in 0..=i {
            matrix[i][k] /= scale[i] * scale[k];
        }
    }
    for i in 0..N {
        for k in 0..=i {
            let known: f64 = (0..k).map(|j| matrix[i][j] * matrix[k][j]).sum();
            let rest = matrix[i][k] - known;
            matrix[i][k] = if i == k { rest.sqrt() } else { rest / matrix[k][k] };
        }
        // A parameter that the others stand for has nothing left of its own.
        if matrix[i][i].is_nan() || matrix[i][i] < 1e-7 {
            return None;
        }
    }
    for i in 0..N {
        let known: f64 = (0..i).map(|j| matrix[i][j] * right[j]).sum();
        right[i] = (right[i] - known) / matrix[i][i];
    }
    for i in (0..N).rev() {
        let known: f64 = (i + 1..N).map(|j| matrix[j][i] * right[j]).sum();
        right[i] = (right[i] - known) / matrix[i][i];
    }
    Some(std::array::from_fn(|i| right[i] / scale[i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_through_points_is_that_of_the_closed_form() {
        let points = [[0.0, 1.0], [1.0, 3.5], [2.0, 4.0], [3.0, 7.5]];
        let rows = |&[a, b]: &[f64; 2]| points.map(|[x, y]| (a + b * x - y, [1.0, x])).to_vec();
        let [a, b] = least_squares([10.0, -3.0], rows).unwrap();
        // b = Σ (x − x̄)(y − ȳ) / Σ (x − x̄)² = 10/5, a = ȳ − b x̄ = 4 − 3.
        assert!((a - 1.0).abs() < 1e-12 && (b - 2.0).abs() < 1e-12, "{a} {b}");
    }

    #[test]
    fn a_bent_model_is_found_from_afar() {
        let rows = |&[a, b]: &[f64; 2]| -> Vec<ResidualRow<2>> {
            let row = |i: u32| {
                let x = f64::from(i) / 10.0;
                let model = a * (b * x).exp();
                (model - 2.0 * (-1.3 * x).exp(), [(b * x).exp(), x * model])
            };
            (0..20).map(row).collect()
        };
        let [a, b] = least_squares([1.0, 0.0], rows).unwrap();
        assert!((a - 2.0).abs() < 1e-10 && (b + 1.3).abs() < 1e-10, "{a} {b}");
    }

    #[test]
    fn parameters_that_cannot_be_told_apart_are_none() {
        let rows = |&[a, b]: &[f64; 2]| vec![(a + b - 1.0, [1.0, 1.0]), (a + b - 2.0, [1.0, 1.0])];
        assert_eq!(least_squares([0.0, 0.0], rows), None);
    }
}

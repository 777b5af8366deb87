//! Curves and residual statistics for the report of a diagnosis.

use crate::diagnose::DiagnosisResult;
use crate::diagnosis_json::Verdict;
use stylet_identify::fit::Fit;
use stylet_stats::linear_algebra::dot;
use stylet_tissue::Slab;

/// Curves of one recording, one value per block.
#[derive(Clone, Debug, Default)]
pub struct RecordingCurves {
    /// Time in s.
    pub time_s: Vec<f64>,
    /// Position in m.
    pub position_m: Vec<f64>,
    /// Velocity in m/s.
    pub velocity_mps: Vec<f64>,
    /// Measured force in N.
    pub force_n: Vec<f64>,
    /// Residual (N) of the fitted base law, with ruptures at fitted times.
    pub base_residual_n: Vec<f64>,
    /// Residual (N) of the extended model, with ruptures at fitted times.
    pub extended_residual_n: Vec<f64>,
    /// Whether the block is compared.
    pub used: Vec<bool>,
    /// Times in s at which layers ruptured.
    pub ruptures_s: Vec<f64>,
    /// Layer of the tip in every block, 1-based; 0 before the surface.
    pub layer: Vec<usize>,
}

/// Fit shown in the report: the base law for the verdict `unknown` without a cause or partial model, else the extended model.
#[must_use]
pub fn reported_fit(examined: &DiagnosisResult) -> &Fit {
    let d = &examined.diagnosis;
    if d.verdict == Verdict::Unknown && d.causes.is_empty() && d.partial.is_none() {
        &examined.search.base
    } else {
        &examined.search.best
    }
}

/// Curves of every recording.
#[must_use]
pub fn recording_curves(examined: &DiagnosisResult) -> Vec<RecordingCurves> {
    let search = &examined.search;
    let best = reported_fit(examined);
    search
        .data
        .recordings
        .iter()
        .enumerate()
        .map(|(r, b)| {
            let t: Vec<f64> = (0..b.len()).map(|k| b.mid_s(k)).collect();
            let (position_m, velocity_mps) = t.iter().map(|t| b.motion.at(*t)).unzip();
            let ruptures = &best.model.rupture_times_s[r];
            // In retraction the tip comes back through the layers that it has passed.
            let layer_at = |t: &f64| {
                let position_m = b.motion.at(*t).0;
                let is_passed = |r: &&f64| **r <= *t && b.motion.at(**r).0 <= position_m;
                let passed = ruptures.iter().filter(is_passed).count();
                if passed == 0 && position_m < best.model.tissue.surface_m { 0 } else { 1 + passed }
            };
            RecordingCurves {
                force_n: b.force_n.clone(),
                base_residual_n: search.base.residuals.residual_n[r].clone(),
                extended_residual_n: best.residuals.residual_n[r].clone(),
                used: b.used.clone(),
                ruptures_s: ruptures.iter().copied().filter(|r| r.is_finite()).collect(),
                layer: t.iter().map(layer_at).collect(),
                time_s: t,
                position_m,
                velocity_mps,
            }
        })
        .collect()
}

/// RMS of a residual (N) by layer (rows; first: before the surface, last: behind the last layer) and phase (insertion, hold, retraction);
/// NaN for fewer than 20 blocks.
#[must_use]
pub fn rms_by_layer_and_phase(
    curves: &[RecordingCurves],
    pick: fn(&RecordingCurves) -> &[f64],
    layers: usize,
) -> Vec<[f64; 3]> {
    let mut sums = vec![[(0.0, 0.0_f64); 3]; layers + 2];
    for c in curves {
        for (i, e) in pick(c).iter().enumerate().filter(|(i, _)| c.used[*i]) {
            let v = c.velocity_mps[i];
            let phase = if v > 1e-5 { 0 } else { 1 + usize::from(v < -1e-5) };
            let row = c.layer[i].min(layers + 1);
            sums[row][phase].0 += e * e;
            sums[row][phase].1 += 1.0;
        }
    }
    sums.iter().map(|row| row.map(|(s, n)| if n < 20.0 { f64::NAN } else { (s / n).sqrt() })).collect()
}

/// Centres and means of a residual in equal bins of `x`, for bins with at least five values.
#[must_use]
pub fn binned_means(x: &[f64], e: &[f64], used: &[bool], bins: usize) -> (Vec<f64>, Vec<f64>) {
    let (low, high) = stylet_stats::extremes(x);
    let wide = (high - low) / bins as f64;
    if wide.is_nan() || wide <= 0.0 {
        return (Vec::new(), Vec::new());
    }
    let mut sums = vec![(0.0, 0.0); bins];
    for ((x, e), _) in x.iter().zip(e).zip(used).filter(|(_, u)| **u) {
        let k = (((x - low) / wide) as usize).min(bins - 1);
        sums[k].0 += e;
        sums[k].1 += 1.0;
    }
    sums.iter()
        .enumerate()
        .filter(|(_, s)| s.1 >= 5.0)
        .map(|(k, s)| (low + (k as f64 + 0.5) * wide, s.0 / s.1))
        .unzip()
}

/// Pearson correlations of a residual with time, motion and force: name and coefficient.
#[must_use]
pub fn correlations(
    curves: &[RecordingCurves],
    pick: fn(&RecordingCurves) -> &[f64],
    slabs: &[Slab],
) -> Vec<(&'static str, f64)> {
    let mut columns: Vec<Vec<f64>> = vec![Vec::new(); 7];
    let mut e = Vec::new();
    for c in curves {
        for i in (0..c.time_s.len()).filter(|i| c.used[*i]) {
            let (z, v) = (c.position_m[i], c.velocity_mps[i]);
            let inside: f64 = slabs.iter().map(|s| s.length_inside_m(z)).sum();
            let sign = stylet_tissue::effect::sgn(v);
            for (column, x) in
                columns.iter_mut().zip([c.time_s[i], z, v, sign, inside * v, inside * sign, c.force_n[i]])
            {
                column.push(x);
            }
            e.push(pick(c)[i]);
        }
    }
    let centred = |x: &[f64]| {
        let mean = x.iter().sum::<f64>() / x.len().max(1) as f64;
        x.iter().map(|x| x - mean).collect::<Vec<_>>()
    };
    let e = centred(&e);
    [
        "time",
        "depth",
        "velocity",
        "direction",
        "length inside x velocity",
        "length inside x direction",
        "force",
    ]
    .into_iter()
    .zip(&columns)
    .map(|(name, x)| {
        let x = centred(x);
        (name, dot(&x, &e) / (dot(&x, &x) * dot(&e, &e)).sqrt().max(1e-300))
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::{RecordingCurves, binned_means, correlations, rms_by_layer_and_phase};
    use stylet_tissue::Slab;

    /// A regressor and its values.
    type Named<'a> = (&'a str, Box<dyn Fn(usize) -> f64 + 'a>);

    fn curve(layer: usize, z: f64, v: f64, n: usize, e: f64) -> RecordingCurves {
        RecordingCurves {
            time_s: (0..n).map(|k| 0.1 * k as f64).collect(),
            position_m: vec![z; n],
            velocity_mps: vec![v; n],
            force_n: vec![1.0; n],
            base_residual_n: (0..n).map(|k| if k % 2 == 0 { e } else { -e }).collect(),
            used: vec![true; n],
            layer: vec![layer; n],
            ..RecordingCurves::default()
        }
    }

    #[test]
    fn rms_by_layer_and_phase_needs_twenty_blocks() {
        let mut all = vec![
            curve(1, 0.01, 0.002, 20, 0.3),
            curve(1, 0.01, 0.0, 19, 0.5),
            curve(0, -0.01, -0.002, 30, 0.7),
            curve(2, 0.02, -2e-5, 25, 1.1),
            curve(3, 0.03, 5e-6, 40, 1.3),
            curve(9, 0.09, 2e-5, 22, 1.9),
            curve(2, -0.02, 0.003, 21, 0.2),
        ];
        // Blocks that are not compared do not count.
        all[0].base_residual_n.push(99.0);
        all[0].used.push(false);
        let rows = rms_by_layer_and_phase(&all, |c| &c.base_residual_n, 2);
        assert_eq!(rows.len(), 4);
        let wanted = [
            [f64::NAN, f64::NAN, 0.7],
            [0.3, f64::NAN, f64::NAN],
            [0.2, f64::NAN, 1.1],
            [1.9, 1.3, f64::NAN],
        ];
        for (row, wanted) in rows.iter().zip(wanted) {
            for (x, w) in row.iter().zip(wanted) {
                assert!((x - w).abs() < 1e-12 || (x.is_nan() && w.is_nan()), "{rows:?}");
            }
        }
        // Below 10 µm/s it is a hold; the surface belongs to the first layer.
        let ties = [curve(1, 0.0, 1e-5, 20, 0.4), curve(1, 0.0, -1e-5, 20, 0.4)];
        for tie in ties {
            assert!((rms_by_layer_and_phase(&[tie], |c| &c.base_residual_n, 1)[1][1] - 0.4).abs() < 1e-12);
        }
        // Two recordings together: the root of their mean square.
        let two = [curve(1, 0.01, 0.002, 10, 0.3), curve(1, 0.01, 0.002, 30, 0.5)];
        let result = rms_by_layer_and_phase(&two, |c| &c.base_residual_n, 1)[1][0];
        assert!((result - ((10.0 * 0.09 + 30.0 * 0.25) / 40.0_f64).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn binned_means_need_five_values() {
        // From 2 to 6 in four bins of one: five values in the first, four in the second, six in the third, the last
        // includes the end.
        let mut x = vec![2.0, 2.1, 2.3, 2.5, 2.9];
        x.extend([3.0, 3.2, 3.5, 3.9]);
        x.extend([4.0, 4.1, 4.2, 4.3, 4.4, 4.9]);
        x.extend([5.0, 5.5, 5.9, 5.95, 5.99, 6.0]);
        let e: Vec<f64> = (0..x.len()).map(|k| 0.7 * k as f64 - 3.0).collect();
        let mut used = vec![true; x.len()];
        used[10] = false;
        let (at, mean) = binned_means(&x, &e, &used, 4);
        assert_eq!(at, [2.5, 4.5, 5.5]);
        let of = |k: &[usize]| k.iter().map(|k| e[*k]).sum::<f64>() / k.len() as f64;
        for (m, w) in
            mean.iter().zip([of(&[0, 1, 2, 3, 4]), of(&[9, 11, 12, 13, 14]), of(&[15, 16, 17, 18, 19, 20])])
        {
            assert!((m - w).abs() < 1e-12, "{mean:?}");
        }
        // The same in bins of a quarter.
        let quarter: Vec<f64> = x.iter().map(|x| 0.25 * x).collect();
        let (at, small) = binned_means(&quarter, &e, &used, 4);
        assert_eq!((at, small), (vec![0.625, 1.125, 1.375], mean));
        assert_eq!(binned_means(&[1.0; 9], &[1.0; 9], &[true; 9], 4), (vec![], vec![]));
        assert_eq!(binned_means(&[], &[], &[], 4), (vec![], vec![]));
    }

    #[test]
    fn correlations_are_pearson_coefficients() {
        let n = 40;
        let mut c = curve(1, 0.0, 0.0, n, 0.0);
        for k in 0..n {
            let x = k as f64;
            c.position_m[k] = 0.01 * (0.21 * x).sin() + 0.012;
            c.velocity_mps[k] = 0.004 * (0.37 * x + 0.4).cos();
            c.force_n[k] = 1.0 + (0.11 * x * x).sin();
            c.base_residual_n[k] = 0.3 * (0.19 * x).sin() + 0.5 * (0.61 * x).cos() + 0.01 * x;
        }
        c.used[7] = false;
        // At rest there is no direction.
        c.velocity_mps[11] = 0.0;
        let slab = |front_m, thickness_m| Slab {
            front_m,
            thickness_m,
            stiffness_n_per_m: 1.0,
            friction_ns_per_m2: 1.0,
            puncture_n: 1.0,
            reach_m: 0.0,
            kappa_per_m: 0.0,
            replaced_friction_share: 0.0,
            curvature_n_per_m2: 0.0,
            foundation_compliance_m_per_n: 0.0,
            release_m: 0.0,
        };
        let slabs = [slab(0.005, 0.007), slab(0.012, 0.038)];
        let result = correlations(&[c.clone()], |c| &c.base_residual_n, &slabs);
        let kept: Vec<usize> = (0..n).filter(|k| *k != 7).collect();
        let inside = |k: usize| (c.position_m[k].clamp(0.005, 0.05) - 0.005).max(0.0);
        let sign = |k: usize| if k == 11 { 0.0 } else { c.velocity_mps[k].signum() };
        let of: [Named; 7] = [
            ("time", Box::new(|k| c.time_s[k])),
            ("depth", Box::new(|k| c.position_m[k])),
            ("velocity", Box::new(|k| c.velocity_mps[k])),
            ("direction", Box::new(sign)),
            ("length inside x velocity", Box::new(|k| inside(k) * c.velocity_mps[k])),
            ("length inside x direction", Box::new(|k| inside(k) * sign(k))),
            ("force", Box::new(|k| c.force_n[k])),
        ];
        assert_eq!(result.len(), of.len());
        for ((name, r), (wanted, x)) in result.iter().zip(&of) {
            assert_eq!(name, wanted);
            let (x, e): (Vec<f64>, Vec<f64>) = kept.iter().map(|k| (x(*k), c.base_residual_n[*k])).unzip();
            let (mx, me) = (stylet_stats::mean(&x), stylet_stats::mean(&e));
            let sum = x.iter().zip(&e).map(|(x, e)| (x - mx) * (e - me)).sum::<f64>() / (x.len() - 1) as f64;
            let wanted = sum / (stylet_stats::sd(&x) * stylet_stats::sd(&e));
            assert!((r - wanted).abs() < 1e-9, "{name}: {r} for {wanted}");
        }
        let none = correlations(&[], |c| &c.base_residual_n, &slabs);
        assert!(none.iter().all(|c| c.1 == 0.0));
    }
}

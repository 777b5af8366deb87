//! Detection of recordings with the same samples.

use crate::error::RecordError;
use crate::recording::Recording;

/// Samples are equal within this share of the range of force and position: files are rounded, and noise differs by more.
const EQUAL_SHARE: f64 = 1e-4;
/// Least number of equal samples in a row.
const MIN_EQUAL: usize = 50;

/// Rejects a recording given twice, also under another name, with a shifted clock, rounded or cut: it would be both fitted
/// and held out.
///
/// # Errors
/// [`RecordError::Copies`] with the names of all copies.
pub fn check_distinct(recordings: &[(&str, &Recording)]) -> Result<(), RecordError> {
    let mut copies: Vec<String> = Vec::new();
    for (i, (name, recording)) in recordings.iter().enumerate() {
        if let Some((first, _)) = recordings[..i].iter().find(|(_, r)| are_copies(r, recording)) {
            copies.push(format!("{name} holds the samples of {first}"));
        }
    }
    if copies.is_empty() { Ok(()) } else { Err(RecordError::Copies { copies }) }
}

/// Whether the shorter recording is a part of the longer one.
fn are_copies(a: &Recording, b: &Recording) -> bool {
    let (long, short) = if a.len() >= b.len() { (a, b) } else { (b, a) };
    let n = short.len();
    if n < MIN_EQUAL {
        return false;
    }
    let tolerance = |x: &[f64]| {
        let (low, high) =
            x.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
        EQUAL_SHARE * (high - low)
    };
    let (force_n, position_m) = (tolerance(&long.force_n), tolerance(&long.position_m));
    let equal = |i: usize, k: usize| {
        let (f, g) = (long.force_n[i], short.force_n[k]);
        let (y, z) = (long.position_m[i], short.position_m[k]);
        ((f - g).abs() <= force_n || (f.is_nan() && g.is_nan()))
            && ((y - z).abs() <= position_m || (y.is_nan() && z.is_nan()))
    };
    (0..=long.len() - n).any(|start| (0..n).all(|k| equal(start + k, k)))
}

#[cfg(test)]
mod tests {
    use super::check_distinct;
    use crate::error::RecordError;
    use crate::recording::Recording;
    use crate::test_noise::uniform;

    fn recording(seed: u64) -> Result<Recording, RecordError> {
        let mut uniform = uniform(seed);
        let t: Vec<f64> = (0..400).map(|i| f64::from(i) * 0.005).collect();
        let z: Vec<f64> = t.iter().map(|t| 0.004 * t).collect();
        let f = z.iter().map(|z| 50.0 * z + 0.02 * (uniform() - 0.5)).collect();
        Recording::new(t, z, f)
    }

    #[test]
    fn a_recording_given_twice_is_refused_also_shifted_rounded_or_cut() -> Result<(), RecordError> {
        let a = recording(1)?;
        let shifted = Recording::new(
            a.time_s.iter().map(|t| t + 7.0).collect(),
            a.position_m.clone(),
            a.force_n.clone(),
        )?;
        let rounded = a.force_n.iter().map(|f| (f * 1e5).round() / 1e5).collect();
        let rounded = Recording::new(a.time_s.clone(), a.position_m.clone(), rounded)?;
        let part = |x: &[f64]| x[50..350].to_vec();
        let cut = Recording::new(part(&a.time_s), part(&a.position_m), part(&a.force_n))?;
        let other = recording(2)?;
        for copy in [&a, &shifted, &rounded, &cut] {
            let error = check_distinct(&[("a.csv", &a), ("other.csv", &other), ("b.csv", copy)]);
            let message = error.expect_err("a copy").to_string();
            assert!(message.contains("b.csv holds the samples of a.csv"), "{message}");
        }
        assert!(check_distinct(&[("a.csv", &a), ("b.csv", &other)]).is_ok());
        Ok(())
    }

    #[test]
    fn every_copy_is_named() -> Result<(), RecordError> {
        let a = recording(1)?;
        let message =
            check_distinct(&[("a", &a), ("b", &a), ("c", &a), ("d", &a)]).expect_err("copies").to_string();
        for name in ["b holds", "c holds", "d holds"] {
            assert!(message.contains(name), "{message}");
        }
        Ok(())
    }
}

//! Promise: every function agrees with SciPy. Reference values: `reference/reference.csv`, made by `reference/make.py`.

#![allow(clippy::panic, reason = "a test may")]

use std::collections::BTreeMap;
use stylet_stats::{normal, quantile_of, spearman, special_functions, student_t, wilson_at};

/// Largest relative error against SciPy, per function (absolute where the reference is below one, for those named).
fn allowed(name: &str) -> f64 {
    match name {
        // Limited by the reference (SciPy's continued fractions).
        "student_sf" | "chi_square_sf" => 1e-10,
        "student_quantile" => 1e-9,
        _ => 1e-12,
    }
}

fn ours(name: &str, x: &[f64]) -> f64 {
    match name {
        "normal_cdf" => normal::cdf(x[0]),
        "normal_sf" => normal::sf(x[0]),
        "normal_ln_pdf" => normal::ln_pdf(x[0]),
        "normal_quantile" => normal::quantile(x[0]),
        "student_quantile" => student_t::quantile(x[0], x[1]),
        "student_sf" => student_t::sf(x[0], x[1]),
        "chi_square_sf" => special_functions::chi_square_sf(x[0], x[1]),
        "wilson_low" => wilson_at(x[0], x[1], x[2]).low,
        "wilson_high" => wilson_at(x[0], x[1], x[2]).high,
        "quantile" => quantile_of(x[1..].iter().copied(), x[0]),
        "spearman" => spearman(&x[..x.len() / 2], &x[x.len() / 2..]).map_or(f64::NAN, |s| s.0),
        _ => panic!("no function for `{name}`"),
    }
}

#[test]
fn every_function_agrees_with_scipy() {
    let mut worst: BTreeMap<&str, (f64, usize)> = BTreeMap::new();
    for line in include_str!("reference/reference.csv").lines() {
        let mut fields = line.split(',');
        let name = fields.next().expect("a name");
        let numbers: Vec<f64> = fields.map(|f| f.parse().expect("a number")).collect();
        let (want, found) = (numbers[0], ours(name, &numbers[1..]));
        let size = if want.abs() < 1e-300 || name == "wilson_low" { 1.0 } else { want.abs() };
        let error = if want == found { 0.0 } else { (found - want).abs() / size };
        assert!(error <= allowed(name), "{line}: {found}, off by {error:e}");
        let entry = worst.entry(name).or_default();
        *entry = (entry.0.max(error), entry.1 + 1);
    }
    for (name, (error, count)) in &worst {
        println!("{name}: {count} numbers, worst relative error {error:.1e}");
    }
    assert_eq!(worst.len(), 11, "a function without reference numbers");
}

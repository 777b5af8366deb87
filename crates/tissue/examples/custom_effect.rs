//! An effect defined in Rust: friction that grows with the time since the last change of direction.
//!
//! `cargo run -p stylet-tissue --example custom_effect`

use stylet_tissue::effect::sgn;
use stylet_tissue::{
    Custom, CustomText, Equation, EquationSample, ForceLaw, ForceLawState, NamedList, ParameterText, Prior,
    Tissue,
};

/// Dry friction with ageing: `+ c sgn(v) L (1 + travel/l)`.
#[derive(Debug)]
struct Ageing;

impl Equation for Ageing {
    fn value(&self, sample: &EquationSample, parameters: &[f64], _states: &[f64]) -> f64 {
        let [c_n_per_m, length_m] = *parameters else { return f64::NAN };
        c_n_per_m * sgn(sample.v_mps) * sample.inserted_m * (1.0 + sample.travel_m / length_m)
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let c_n_per_m = ParameterText {
        start: 3.0,
        unit: "N/m".into(),
        inactive: Some(0.0),
        meaning: "dry friction per metre of needle inside".into(),
        ..ParameterText::default()
    };
    let length_m = ParameterText {
        start: 0.02,
        unit: "m".into(),
        prior: Some(Prior::LogNormal { median: 0.02, factor: 3.0 }),
        meaning: "travel after which the friction has doubled".into(),
        ..ParameterText::default()
    };
    let text = CustomText {
        name: "ageing_friction".into(),
        parameters: NamedList(vec![("c_n_per_m".into(), c_n_per_m), ("length_m".into(), length_m)]),
        ..CustomText::default()
    };
    let effect = Custom::define(&text, Box::new(Ageing))?;
    let law = ForceLaw::new(&Tissue::three_gels(), &[effect.into()])?;
    let mut state = ForceLawState::default();
    for k in 0..=8 {
        let (time_s, z_m) = (f64::from(k), 0.002 * f64::from(k));
        println!("{:5.1} mm  {:.3} N", 1e3 * z_m, law.step(&mut state, time_s, z_m, 0.002, |_| {}).total_n);
    }
    Ok(())
}

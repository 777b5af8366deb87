//! An effect defined in Rust: friction that grows with the time since the last change of direction.
//!
//! `cargo run -p stylet-tissue --example custom_effect`

use stylet_tissue::effect::sgn;
use stylet_tissue::{
    Custom, CustomDefinition, EffectInfo, Equation, EquationSample, ForceLaw, ForceLawState, ParameterInfo,
    Place, Tissue,
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

const PARAMETERS: &[ParameterInfo] = &[
    ParameterInfo::strength("c_n_per_m", "N/m", "dry friction per metre of needle inside")
        .search(3.0, 0.3, 30.0),
    ParameterInfo::shape("length_m", "m", "travel after which the friction has doubled")
        .inactive(0.02)
        .search(0.02, 0.002, 0.2)
        .log(),
];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let info = EffectInfo {
        id: "ageing_friction",
        equation: "+ c sgn(v) L (1 + travel/l)",
        parameters: PARAMETERS,
        ..EffectInfo::DEFAULTS
    };
    let definition = CustomDefinition {
        place: Place::Friction,
        states: 0,
        uses_travel: true,
        equation: Box::new(Ageing),
        text: None,
    };
    let effect = Custom::define(info, definition)?;
    let law = ForceLaw::new(&Tissue::three_gels(), &[effect.into()])?;
    let mut state = ForceLawState::default();
    for k in 0..=8 {
        let (time_s, z_m) = (f64::from(k), 0.002 * f64::from(k));
        println!("{:5.1} mm  {:.3} N", 1e3 * z_m, law.step(&mut state, time_s, z_m, 0.002, |_| {}).total_n);
    }
    Ok(())
}

//! Prints how long one sample of the force law takes: the base law, each effect alone, three at once.
//!
//! `cargo run --release -p stylet-tissue --example force_law_cost`

use std::hint::black_box;
use std::time::Instant;
use stylet_tissue::*;

/// Advance with ripple, hold, retract: 10 000 samples at 200 Hz.
fn motion() -> Vec<(f64, f64, f64)> {
    let mut z = -0.005;
    (0..10_000)
        .map(|k| {
            let t = f64::from(k) / 200.0;
            let v = match k {
                0..6000 => 0.003 + 0.002 * (2.0 * t).sin(),
                6000..7000 => 0.0,
                _ => -0.004,
            };
            z += v / 200.0;
            (t, z, v)
        })
        .collect()
}

/// Nanoseconds per call of the fastest of many runs over the motion.
fn fastest(mut run: impl FnMut(&[(f64, f64, f64)]) -> f64) -> f64 {
    let motion = motion();
    let mut best = f64::INFINITY;
    for _ in 0..60 {
        let start = Instant::now();
        black_box(run(black_box(&motion)));
        best = best.min(start.elapsed().as_secs_f64());
    }
    best / motion.len() as f64 * 1e9
}

fn law_ns(effects: &[AnyEffect]) -> Result<f64, TooManyEffects> {
    let law = ForceLaw::new(&Tissue::three_gels(), effects)?;
    Ok(fastest(|motion| {
        let mut sum = 0.0;
        replay(&law, motion.iter().copied(), |_| {}, |force| sum += force.total_n);
        sum
    }))
}

fn chain_ns(effects: &[AnyEffect]) -> f64 {
    let chain = MeasurementChain::new(effects);
    fastest(|motion| {
        let mut state = chain.start(200.0);
        let mut sum = 0.0;
        for &(time_s, z, velocity_mps) in motion {
            let reading = SensorInput { time_s, velocity_mps, tissue_n: 30.0 * z, ..SensorInput::default() };
            sum += chain.step(&mut state, &reading);
        }
        sum
    })
}

/// Three effects of the library as formulas.
fn twins() -> [(&'static str, CustomText); 3] {
    let parameter = |start: f64, unit: &str, inactive: Option<f64>| ParameterText {
        start,
        value: None,
        prior: None,
        unit: unit.into(),
        inactive,
        meaning: String::new(),
    };
    let text = |place, force: &str, parameters, state| CustomText {
        name: "twin".into(),
        place,
        force: Some(force.into()),
        parameters: NamedList(parameters),
        state: NamedList(state),
        source: String::new(),
    };
    let kappa = vec![("kappa".into(), parameter(10.0, "1/m", Some(0.0)))];
    let c = vec![("c".into(), parameter(3.0, "N/m", Some(0.0)))];
    let relaxing =
        vec![("g".into(), parameter(0.3, "", Some(0.0))), ("tau".into(), parameter(2.0, "s", None))];
    let q = vec![("q".into(), "dq/dt = (g*elastic - q)/tau".into())];
    [
        ("nonlinear_elasticity", text(Place::Elastic, "elastic * kappa * max(0, z_layer)", kappa, vec![])),
        ("coulomb_friction", text(Place::Friction, "c * sgn(v) * inserted", c, vec![])),
        ("stress_relaxation", text(Place::Elastic, "-q", relaxing, q)),
    ]
}

fn main() -> Result<(), TooManyEffects> {
    println!("{:<36} {:>8}", "", "ns/sample");
    println!("{:<36} {:>8.1}", "base law", law_ns(&[])?);
    for entry in general_effects() {
        let mut variant = Some(entry);
        while let Some(info) = variant {
            let start: Vec<f64> = info.parameters.iter().map(|p| p.start).collect();
            let effect = AnyEffect::from_parameters(info.id, &start);
            let effects = effect.as_slice();
            let ns = if info.stage < ChainStage::Tool { law_ns(effects)? } else { chain_ns(effects) };
            let where_ = if info.stage < ChainStage::Tool { "" } else { " (chain alone)" };
            println!("{:<36} {ns:>8.1}", format!("{} x{}{where_}", info.id, info.parameters.len()));
            variant = info.extended;
        }
    }
    for (twin, text) in twins() {
        let Ok(effect) = Custom::from_text(&text) else { continue };
        println!("{:<36} {:>8.1}", format!("{twin} as a formula"), law_ns(&[effect.into()])?);
    }
    let three = ["stress_relaxation", "coulomb_friction", "incomplete_release"];
    let three: Vec<AnyEffect> = three
        .iter()
        .filter_map(|id| effect_info(id))
        .filter_map(|info| {
            let start: Vec<f64> = info.parameters.iter().map(|p| p.start).collect();
            AnyEffect::from_parameters(info.id, &start)
        })
        .collect();
    println!("{:<36} {:>8.1}", "relaxation + coulomb + release", law_ns(&three)?);
    Ok(())
}

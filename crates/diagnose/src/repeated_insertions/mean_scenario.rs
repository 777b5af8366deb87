//! Converts the fitted model of repeated recordings to a scenario of their mean insertion, for simulation.

use super::instrument_faults::InstrumentReport;
use super::segmented_recording::SegmentedRecording;
use stylet_identify::model::{EffectTerm, Model};
use stylet_scenario::{ForceTorque, Motion, Robot, Scenario, Segment, Sensor};

/// Shortest hold (s) of the scenario's motion.
const MIN_HOLD_S: f64 = 0.1;
/// Sensor noise (N) if there is no recording in air.
const DEFAULT_NOISE_N: f64 = 0.01;

/// Scenario of the model at the mean of its random effects, with the motion of the middle recording.
pub fn mean_scenario(
    name: &str,
    model: &Model,
    recordings: &[&SegmentedRecording],
    instrument: &InstrumentReport,
) -> Scenario {
    let run = recordings[recordings.len() / 2];
    let r = &run.recording;
    let (start, deepest) = (r.position_m[0], r.position_m[run.phases.deepest]);
    let speed = run.speed_mps.max(1e-5);
    let t = |i: usize| r.time_s.get(i).copied().unwrap_or(r.time_s[r.len() - 1]);
    let hold = (t(run.phases.retraction) - t(run.phases.deepest)).max(MIN_HOLD_S);
    let mut segments = vec![
        Segment::Move { velocity_mps: speed, duration_s: (deepest - start) / speed },
        Segment::Hold { duration_s: hold },
    ];
    if run.phases.retraction < r.len() {
        segments.push(Segment::Move { velocity_mps: -speed, duration_s: (deepest - start) / speed });
    }
    let found = model.effects.iter().filter_map(EffectTerm::effect);
    Scenario {
        source: "fitted to measured recordings by stylet diagnose".to_owned(),
        effects: model
            .assumed
            .known_effects
            .iter()
            .cloned()
            .chain(found)
            .chain(instrument.correctable_effects())
            .collect(),
        robot: Robot::Replay,
        sensor: Sensor::ForceTorque(ForceTorque {
            noise_n: instrument.noise_n.unwrap_or(DEFAULT_NOISE_N),
            ar1: instrument.ar1.unwrap_or(0.0).clamp(-0.99, 0.99),
            ..ForceTorque::default()
        }),
        sample_hz: 100.0,
        ..Scenario::new(
            format!("{name}: mean insertion"),
            model.tissue.clone(),
            Motion::Program { start_m: start, segments },
        )
    }
}

#[cfg(test)]
mod tests {
    use super::mean_scenario;
    use crate::repeated_insertions::SegmentedRecording;
    use crate::repeated_insertions::instrument_faults::InstrumentReport;
    use crate::test_fixtures::assumed_layers;
    use stylet_identify::model::{EffectTerm, Model};
    use stylet_record::Recording;
    use stylet_scenario::{Motion, Segment, Sensor};
    use stylet_tissue::{CoulombFriction, Effect};

    /// Advance from 3 mm for 4 s, hold, and retraction if `back`.
    fn run(speed: f64, rest_s: f64, back: bool) -> SegmentedRecording {
        let n = ((4.0 + rest_s + if back { 4.0 } else { 0.0 }) * 50.0) as usize;
        let t: Vec<f64> = (0..n).map(|k| 0.02 * k as f64).collect();
        let z = t.iter().map(|t| {
            0.003
                + if *t < 4.0 {
                    speed * t
                } else if *t < 4.0 + rest_s {
                    4.0 * speed
                } else {
                    4.0 * speed - speed * (t - 4.0 - rest_s)
                }
        });
        let z = z.collect();
        SegmentedRecording::new("a".to_owned(), Recording::new(t, z, vec![0.0; n]).expect("clean columns"), 1)
    }

    #[test]
    fn the_mean_insertion_has_the_motion_of_the_middle_recording() {
        let belief = assumed_layers(&[[0.05, 100.0, 1000.0]]);
        let mut model = Model::base(belief, 3);
        model.effects = vec![EffectTerm::new(CoulombFriction { c_n_per_m: 3.0 }.info(), &[3.0])];
        let (a, b, c) = (run(0.002, 1.0, true), run(0.004, 2.0, true), run(0.009, 1.0, false));
        let s = mean_scenario(
            "gel",
            &model,
            &[&a, &b, &c],
            &InstrumentReport { noise_n: Some(0.03), ar1: Some(2.0), ..InstrumentReport::default() },
        );
        let Motion::Program { start_m, segments } = &s.motion else { unreachable!("a program") };
        let r = &b.recording;
        let (deepest, back) = (b.phases.deepest, b.phases.retraction);
        assert_eq!(*start_m, 0.003);
        let way = r.position_m[deepest] - 0.003;
        let wanted = [
            Segment::Move { velocity_mps: b.speed_mps, duration_s: way / b.speed_mps },
            Segment::Hold { duration_s: r.time_s[back] - r.time_s[deepest] },
            Segment::Move { velocity_mps: -b.speed_mps, duration_s: way / b.speed_mps },
        ];
        assert_eq!(segments.as_slice(), wanted);
        assert!((b.speed_mps - 0.004).abs() < 1e-6 && (way - 0.016).abs() < 2e-4);
        assert_eq!(s.effects.len(), 1);
        assert_eq!(s.name, "gel: mean insertion");
        let Sensor::ForceTorque(f) = &s.sensor else { unreachable!("a force sensor") };
        assert_eq!((f.noise_n, f.ar1), (0.03, 0.99));
        // Without a retraction: hold until the end, at least 0.1 s.
        let s = mean_scenario(
            "gel",
            &model,
            &[&c],
            &InstrumentReport { ar1: Some(-2.0), ..InstrumentReport::default() },
        );
        let Motion::Program { segments, .. } = &s.motion else { unreachable!("a program") };
        let end = c.recording.time_s[c.recording.len() - 1] - c.recording.time_s[c.phases.deepest];
        assert_eq!(segments[1..], [Segment::Hold { duration_s: end }]);
        let short = run(0.004, 0.0, false);
        let s = mean_scenario("gel", &model, &[&short], &InstrumentReport::default());
        let Motion::Program { segments, .. } = &s.motion else { unreachable!("a program") };
        assert_eq!(segments[1], Segment::Hold { duration_s: 0.1 });
        let Sensor::ForceTorque(f) = &s.sensor else { unreachable!("a force sensor") };
        assert_eq!((f.noise_n, f.ar1), (0.01, 0.0));
    }
}

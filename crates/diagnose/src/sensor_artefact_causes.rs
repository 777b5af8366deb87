//! Reports sensor artefacts in the raw samples (saturation, quantisation, spikes) as causes.

use crate::diagnosis_json::{Cause, Estimate};
use stylet_record::sensor_artefacts::SensorArtefacts;
use stylet_stats::Z95;
use stylet_tissue::{AnyEffect, Effect, ForceSpikes, Quantisation, Saturation};

/// Sensor artefacts as causes; `noise_n` is the noise of a sample in N.
pub(crate) fn sensor_artefact_causes(raw: &SensorArtefacts, noise_n: f64) -> Vec<Cause> {
    let mut causes = Vec::new();
    let mut add = |effect: AnyEffect, intervals: &[(f64, f64)]| {
        let info = effect.info();
        let parameters = info
            .parameters
            .iter()
            .zip(effect.parameters())
            .zip(intervals)
            .map(|((p, value), (low, high))| {
                (p.path.to_owned(), Estimate { value, low: low.max(0.0), high: *high })
            })
            .collect();
        causes.push(Cause { effect: info.id.to_owned(), confidence: 0.99, parameters, ..Cause::default() });
    };
    let about = |value: f64, sd: f64| (value - Z95 * sd, value + Z95 * sd);
    if let Some(limit_n) = raw.limit_n {
        // A quantised force saturates at the step next to the limit.
        let half_n = 0.5 * raw.step_n.unwrap_or(0.0) + 1e-6 * limit_n;
        add(Saturation { limit_n }.into(), &[(limit_n - half_n, limit_n + half_n)]);
    }
    if let Some(step_n) = raw.step_n.filter(|s| *s > 0.3 * noise_n) {
        add(Quantisation { step_n }.into(), &[about(step_n, 1e-4 * step_n)]);
    }
    if let Some(s) = &raw.spikes {
        let effect = ForceSpikes { rate_hz: s.rate_hz(), size_n: s.size_n };
        add(effect.into(), &[s.rate_interval_hz(), s.size_interval_n()]);
    }
    causes
}

#[cfg(test)]
mod tests {
    use super::sensor_artefact_causes;
    use stylet_record::sensor_artefacts::{SensorArtefacts, Spikes};

    #[test]
    fn sensor_artefacts_have_intervals_and_small_steps_are_ignored() {
        let z = stylet_stats::Z95;
        let spikes = Spikes { count: 9, size_n: 0.1, size_sd_n: 0.9, observed_s: 45.0 };
        let raw = SensorArtefacts {
            limit_n: Some(2.5),
            step_n: Some(0.031),
            spikes: Some(spikes),
            ..SensorArtefacts::default()
        };
        let causes = sensor_artefact_causes(&raw, 0.1);
        assert_eq!(
            causes.iter().map(|c| c.effect.as_str()).collect::<Vec<_>>(),
            ["saturation", "quantisation", "force_spikes"]
        );
        let limit = causes[0].parameters["limit_n"];
        let half = 0.5 * 0.031 + 2.5e-6;
        assert!((limit.low - 2.5 + half).abs() < 1e-12 && (limit.high - 2.5 - half).abs() < 1e-12);
        let search_step = causes[1].parameters["step_n"];
        assert!(
            (search_step.low - 0.031 * (1.0 - z * 1e-4)).abs() < 1e-12
                && (search_step.high - 0.031 * (1.0 + z * 1e-4)).abs() < 1e-12
        );
        let (rate, size) = (causes[2].parameters["rate_hz"], causes[2].parameters["size_n"]);
        assert_eq!(
            (rate.value, rate.low, rate.high),
            (0.2, spikes.rate_interval_hz().0, spikes.rate_interval_hz().1)
        );
        // Sizes are not negative.
        assert!(
            spikes.size_interval_n().0 < 0.0 && size.low == 0.0 && size.high == spikes.size_interval_n().1
        );
        // Steps below 0.3 of the noise are not reported.
        assert_eq!(
            sensor_artefact_causes(
                &SensorArtefacts { step_n: Some(0.029), ..SensorArtefacts::default() },
                0.1
            )
            .len(),
            0
        );
        assert_eq!(sensor_artefact_causes(&raw, 0.2).len(), 2);
    }
}

//! Identifies mains hum by its frequency, including aliased frequencies.

/// Mains frequencies in Hz.
const MAINS_HZ: [f64; 2] = [50.0, 60.0];
/// Largest harmonic that is identified: rectifiers and drives emit little power above it.
const MAX_HARMONIC: u32 = 5;
/// Largest deviation (Hz) of the mains from its nominal frequency, per harmonic.
const MAINS_DEVIATION_HZ: f64 = 0.15;

/// Apparent frequency (Hz) of a tone of `hz` sampled at `sample_hz`.
pub fn aliased_hz(hz: f64, sample_hz: f64) -> f64 {
    (hz - sample_hz * (hz / sample_hz).round()).abs()
}

/// Remark on a tone at `hz` in samples at `sample_hz`, resolved to `resolution_hz`: the lowest mains harmonic that appears there, if any.
pub fn mains_remark(hz: f64, sample_hz: f64, resolution_hz: f64) -> Option<String> {
    (1..=MAX_HARMONIC).find_map(|harmonic| {
        let order = f64::from(harmonic);
        let near = |mains: &&f64| {
            let apparent = aliased_hz(order * **mains, sample_hz);
            apparent > 0.0 && (apparent - hz).abs() < order * MAINS_DEVIATION_HZ + resolution_hz
        };
        let mains = MAINS_HZ.iter().filter(near).min_by(|a, b| {
            let off = |mains: f64| (aliased_hz(order * mains, sample_hz) - hz).abs();
            off(**a).total_cmp(&off(**b))
        })?;
        let true_hz = order * mains;
        let name = match harmonic {
            1 => format!("{mains} Hz mains"),
            _ => format!("harmonic {harmonic} of {mains} Hz mains, {true_hz} Hz"),
        };
        let folded = true_hz > 0.5 * sample_hz * (1.0 + 1e-9);
        let alias = || format!(", aliased to {} Hz", stylet_stats::number_format::significant(hz, 3));
        Some(if folded { name + &alias() } else { name })
    })
}

#[cfg(test)]
mod tests {
    use super::{aliased_hz, mains_remark};

    #[test]
    fn a_tone_above_half_the_sampling_rate_appears_folded() {
        for (hz, sample_hz, apparent) in [
            (50.0, 200.0, 50.0),
            (50.0, 80.0, 30.0),
            (60.0, 100.0, 40.0),
            (180.0, 200.0, 20.0),
            (50.0, 20.0, 10.0),
        ] {
            assert!((aliased_hz(hz, sample_hz) - apparent).abs() < 1e-12, "{hz} at {sample_hz}");
        }
    }

    #[test]
    fn mains_and_its_harmonics_are_recognised_at_any_rate_and_other_tones_are_not() {
        let remark = |hz, sample_hz| mains_remark(hz, sample_hz, 0.05);
        assert_eq!(remark(50.1, 200.0).as_deref(), Some("50 Hz mains"));
        assert_eq!(remark(30.0, 80.0).as_deref(), Some("50 Hz mains, aliased to 30 Hz"));
        assert_eq!(remark(40.0, 100.0).as_deref(), Some("60 Hz mains, aliased to 40 Hz"));
        assert_eq!(remark(100.0, 200.0).as_deref(), Some("harmonic 2 of 50 Hz mains, 100 Hz"));
        assert_eq!(
            remark(20.0, 200.0).as_deref(),
            Some("harmonic 3 of 60 Hz mains, 180 Hz, aliased to 20 Hz")
        );
        for hz in [5.0, 33.0, 47.0, 49.0, 51.0, 52.0] {
            assert_eq!(remark(hz, 200.0), None, "{hz}");
        }
        // Folded to a constant, it is no tone.
        assert_eq!(remark(0.0, 50.0), None);
    }
}

//! Matching of detections to true ruptures.

use serde::{Deserialize, Serialize};
use stylet_core::Detection;
use stylet_record::TrueRupture;

/// Earliest matching detection relative to the rupture, in s.
pub const MATCH_EARLIEST_S: f64 = -0.05;
/// Latest matching detection relative to the rupture, in s.
pub const MATCH_LATEST_S: f64 = 1.0;

/// A true rupture and its detection.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RuptureScore {
    /// Layer, 1-based.
    pub layer: usize,
    /// True time in s.
    pub true_s: f64,
    /// True tip position in m.
    pub true_m: f64,
    /// The puncture force was reached; otherwise the far face.
    pub by_force: bool,
    /// Time of the detection in s; `null` when missed.
    pub detected_s: Option<f64>,
    /// Detected minus true time in s.
    pub delay_s: Option<f64>,
    /// Travel of the tip between the true rupture and the detection in mm.
    pub delay_mm: Option<f64>,
    /// Number of the detection, 1-based.
    pub detection: Option<usize>,
}

/// Matches each true rupture, in order, to the first detection within [[`MATCH_EARLIEST_S`], [`MATCH_LATEST_S`]] that no
/// earlier rupture has taken. Returns the scores of the ruptures and which detections are false.
#[must_use]
pub fn match_ruptures(truth: &[TrueRupture], detections: &[Detection]) -> (Vec<RuptureScore>, Vec<bool>) {
    let mut is_false = vec![true; detections.len()];
    let scores = truth
        .iter()
        .map(|rupture| {
            let hit = detections.iter().enumerate().find(|(i, d)| {
                let delay_s = d.time_s - rupture.time_s;
                is_false[*i] && (MATCH_EARLIEST_S..=MATCH_LATEST_S).contains(&delay_s)
            });
            if let Some((i, _)) = hit {
                is_false[i] = false;
            }
            RuptureScore {
                layer: rupture.layer,
                true_s: rupture.time_s,
                true_m: rupture.position_m,
                by_force: rupture.by_force,
                detected_s: hit.map(|(_, d)| d.time_s),
                delay_s: hit.map(|(_, d)| d.time_s - rupture.time_s),
                delay_mm: hit.map(|(_, d)| 1e3 * (d.position_m - rupture.position_m)),
                detection: hit.map(|(i, _)| i + 1),
            }
        })
        .collect();
    (scores, is_false)
}

#[cfg(test)]
mod tests {
    use super::*;
    use stylet_core::Cause;

    fn rupture(layer: usize, time_s: f64) -> TrueRupture {
        TrueRupture { layer, time_s, position_m: time_s * 0.002, by_force: false }
    }

    fn detection(time_s: f64) -> Detection {
        Detection {
            layer: 1,
            time_s,
            position_m: time_s * 0.002,
            located_s: time_s,
            located_m: time_s * 0.002,
            cause: Cause::Cusum,
            drop_n: 0.0,
            drop_sd_n: 0.0,
            confidence: 0.0,
        }
    }

    #[test]
    fn a_detection_counts_from_fifty_milliseconds_before_to_one_second_after_the_rupture() {
        for (delay_s, hit) in [(-0.051, false), (-0.049, true), (0.0, true), (0.999, true), (1.001, false)] {
            let (scores, is_false) = match_ruptures(&[rupture(1, 10.0)], &[detection(10.0 + delay_s)]);
            assert_eq!(scores[0].detected_s.is_some(), hit, "delay {delay_s}");
            assert_eq!(is_false, [!hit], "delay {delay_s}");
        }
    }

    #[test]
    fn two_ruptures_cannot_share_one_detection() {
        let (scores, is_false) = match_ruptures(&[rupture(1, 10.0), rupture(2, 10.2)], &[detection(10.3)]);
        assert_eq!(scores[0].detection, Some(1));
        assert_eq!(scores[1].detection, None);
        assert_eq!(is_false, [false]);
    }

    #[test]
    fn a_second_detection_of_the_same_rupture_is_false() {
        let (scores, is_false) = match_ruptures(&[rupture(1, 10.0)], &[detection(10.1), detection(10.4)]);
        assert!((scores[0].delay_s.unwrap_or(f64::NAN) - 0.1).abs() < 1e-12);
        assert!((scores[0].delay_mm.unwrap_or(f64::NAN) - 0.2).abs() < 1e-9);
        assert_eq!(is_false, [false, true]);
    }
}

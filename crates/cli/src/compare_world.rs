//! `stylet compare --world`: the referee's insertions, heard by several algorithms. The only place where its drawn cases and the
//! online core meet; neither knows of the other.

use crate::args::{CompareArgs, Which};
use crate::compare::{Row, Scored};
use crate::exit::Failure;
use crate::progress::Progress;
use rayon::prelude::*;
use stylet_core::EnhanceConfig;
use stylet_examine::{Case, CaseId, Grade, Hide, Plan, Size, World, Wrong};
use stylet_record::TrueRupture;
use stylet_score::{Trace, match_ruptures};

/// Cases of one kind: a row per algorithm.
pub struct Kind {
    name: String,
    cases: Vec<CaseId>,
}

/// The rows that the arguments ask for, of cases in which nothing that is believed is wrong.
///
/// # Errors
/// A word that there is not, with those that there are.
pub fn rows(args: &CompareArgs) -> Result<Vec<Kind>, Failure> {
    let Some(word) = &args.world else { return Ok(Vec::new()) };
    let unknown = |what: &str, word: &str, known: Vec<&str>| {
        Failure::Argument(format!("{what}: there is no `{word}`; there are {}", known.join(", ")))
    };
    let world = World::parse(word)
        .ok_or_else(|| unknown("--world", word, World::ALL.iter().map(|w| w.word()).collect()))?;
    args.hide
        .iter()
        .map(|word| {
            let hide = Hide::parse(word)
                .ok_or_else(|| unknown("--hide", word, Hide::ALL.iter().map(|h| h.word()).collect()))?;
            let plan = Plan {
                world,
                wrong: vec![Wrong::Nothing],
                grades: vec![Grade::Large],
                hide: vec![hide],
                size: Size::Strong,
                cases: args.seeds,
                seed: 1,
            };
            Ok(Kind { name: format!("{world} world, {hide}"), cases: plan.cases() })
        })
        .collect()
}

impl Kind {
    /// Draws each case once and lets every algorithm hear it.
    ///
    /// # Errors
    /// When a case cannot be drawn, which is a mistake of the referee.
    pub fn listen(&self, algorithms: &[Which], progress: &Progress) -> Result<Vec<Row>, Failure> {
        // In the order of the cases, whatever the threads: the same bytes.
        let heard: Vec<Vec<Scored>> = self
            .cases
            .par_iter()
            .map(|id| {
                let case =
                    stylet_examine::case(id).map_err(|e| Failure::Internal(format!("{}: {e}", id.name())))?;
                let scored = algorithms.iter().map(|a| listen(&case, *a)).collect();
                progress.advance(algorithms.len() as u64);
                Ok(scored)
            })
            .collect::<Result<_, Failure>>()?;
        let row = |(k, algorithm): (usize, &Which)| {
            let mut all = Scored { missed: 0, false_alarms: 0, delays_s: Vec::new(), ruptures: 0 };
            for one in heard.iter().filter_map(|of| of.get(k)) {
                all.missed += one.missed;
                all.false_alarms += one.false_alarms;
                all.ruptures += one.ruptures;
                all.delays_s.extend(&one.delays_s);
            }
            Row::new(&self.name, algorithm.name(), self.cases.len() as u64, &all)
        };
        Ok(algorithms.iter().enumerate().map(row).collect())
    }
}

/// What an algorithm makes of all recordings of a case.
fn listen(case: &Case, algorithm: Which) -> Scored {
    let config = EnhanceConfig { algorithm: algorithm.algorithm(), ..EnhanceConfig::default() };
    let surface_m = case.setup.believed.surface_m;
    let mut all = Scored { missed: 0, false_alarms: 0, delays_s: Vec::new(), ruptures: 0 };
    for (named, there) in case.question.recordings.iter().zip(&case.there) {
        let recording = &named.recording;
        let trace = Trace::record(recording, &recording.force_n, &config, surface_m, |_, _| {});
        let last_s = recording.time_s.last().copied().unwrap_or(0.0);
        let truth: Vec<TrueRupture> = there
            .ruptures_s
            .iter()
            .filter(|t| **t < last_s)
            .enumerate()
            .map(|(i, &time_s)| TrueRupture { layer: i + 1, time_s, position_m: 0.0, by_force: false })
            .collect();
        let (ruptures, is_false) = match_ruptures(&truth, &trace.detections);
        all.ruptures += ruptures.len();
        all.missed += ruptures.iter().filter(|r| r.detected_s.is_none()).count();
        all.false_alarms += is_false.iter().filter(|f| **f).count();
        all.delays_s.extend(ruptures.iter().filter_map(|r| r.delay_s));
    }
    all
}

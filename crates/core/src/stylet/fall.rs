//! A fall of the force: whether it is a rupture, and what a rupture does.

use super::gaussian::{at_least, at_most};
use super::local::{MEMORY_M, Step};
use super::motion::SPEED_S;
use super::{LONGEST_DROP_S, Stylet, WORK_RUPTURE};
use crate::config::EnhanceConfig;
use crate::sample::{Cause, Detection, Sample};

/// Samples that the level of a fall is averaged over at most.
const MOST_AVERAGED: f64 = 16.0;

/// Standard deviations that a fall below the law has to have: whatever else set off the alarm, noise makes it so low once in 30 000 looks.
const SURE_SDS: f64 = 4.0;

/// Where it does not hold: a drop below its own interval is none.
const LIKELY_SDS: f64 = 2.0;

/// A place is not known better than to a micrometre, in m².
const TINY_M2: f64 = 1e-12;

fn square(x: f64) -> f64 {
    x * x
}

/// A fall of the force that may become a rupture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fall {
    from_n: f64,
    mean_n: f64,
    /// What the law of layers said before it began, less what is measured.
    missing_n: f64,
    since_s: f64,
    count: f64,
}

/// How large a fall is, its standard deviation, and the least that is a rupture, in N.
struct Size {
    fall_n: f64,
    sd_n: f64,
    least_n: f64,
}

impl Stylet {
    /// Follows a fall from where it began: anew where this sample alone says more than all before.
    #[inline(always)]
    pub(super) fn fall(&mut self, step: &Step, sample: &Sample, outweighs: bool) {
        if outweighs {
            // What was summed up before was noise.
            (self.fall, self.last_level_n) = (None, self.local.level_n());
        }
        let fall = self.fall.get_or_insert(Fall {
            from_n: self.last_level_n,
            mean_n: sample.force_n,
            missing_n: 0.0,
            since_s: 0.0,
            count: 0.0,
        });
        if self.rough == 0.0 {
            // A change of speed changes the friction: what was measured before counts as it would be at this speed.
            let change_n = self.before.friction(sample.position_m) * step.dv_mps;
            fall.from_n += change_n;
            fall.mean_n += change_n;
        }
        fall.since_s += step.dt_s;
        fall.count += 1.0;
        // As many samples as it takes to know the force to a quarter of the drop that counts.
        let most = if self.least_n > 0.0 {
            16.0 * self.noise.marginal() / (self.least_n * self.least_n)
        } else {
            MOST_AVERAGED
        };
        let most = most.clamp(1.0, MOST_AVERAGED);
        let share = 1.0 / fall.count.min(most);
        fall.mean_n += share * (sample.force_n - fall.mean_n);
        let missing_n = self.before.says(sample.position_m, self.drive) - sample.force_n;
        fall.missing_n += share * (missing_n - fall.missing_n);
        let over = fall.since_s > LONGEST_DROP_S && (self.least_n > 0.0 || self.rough == 0.0);
        if over && self.size().is_none_or(|size| size.fall_n < size.least_n) {
            // Too slow, or too small: not a rupture.
            self.fall = None;
            self.alarm.rest();
            self.was_quiet = true;
        }
    }

    /// Whether the fall so far is a drop: larger than what the noise may feign, and than texture.
    pub(super) fn is_a_drop(&mut self, config: &EnhanceConfig) -> bool {
        // As long as the law has not been seen to hold, the first travel after contact is no layer.
        if self.rough > 0.0 && self.deepest_m - self.first_m < config.guard.blind_travel_m {
            return false;
        }
        let Some(size) = self.size() else { return false };
        self.drop = (size.fall_n, size.sd_n);
        size.fall_n >= size.least_n
    }

    /// Size of the fall so far, how well it is known, and what it would have to be.
    fn size(&self) -> Option<Size> {
        let fall = self.fall?;
        let effective = (fall.count.min(MOST_AVERAGED) / libm::sqrt(self.noise.slow())).max(1.0);
        let sd_n = libm::sqrt(self.noise.marginal() / effective);
        let fallen_n = fall.from_n - fall.mean_n;
        // A free tip has nothing to lose, but where friction stops to grow the force is below what the predictor's memory makes of the growth.
        let growth_n = if self.layers.free { self.layers.growth(self.steady) * MEMORY_M } else { 0.0 };
        let sure_sds = SURE_SDS + self.rough * (LIKELY_SDS - SURE_SDS);
        let sure_n = sure_sds * sd_n + (1.0 - self.rough) * growth_n;
        if self.rough > 0.0 {
            return Some(Size { fall_n: fallen_n, sd_n, least_n: at_least(self.least_n, sure_n) });
        }
        // Where the law of layers holds it knows what the force would be; and the force has to have fallen, too.
        let (fall_n, least_n) = (at_most(fall.missing_n, fallen_n), sure_n);
        Some(Size { fall_n, sd_n, least_n })
    }

    pub(super) fn go_on_falling(&mut self, step: &Step, sample: &Sample, sd: f64) {
        let force = (sample.force_n - self.noise.bias_n()).abs().max(sd);
        self.local.renew(sample.force_n, force, &self.noise, step.speed_mps, false);
        self.alarm.rest();
        self.was_quiet = true;
        self.fall = None;
        if let Some(fallen) = self.fallen {
            self.layers = fallen;
        }
        self.before = self.layers;
        self.before_m = sample.position_m;
        self.shaft.rupture(sample.position_m, sample.force_n - self.noise.bias_n());
    }

    #[cold]
    pub(super) fn rupture(&mut self, step: &Step, sample: &Sample, evidence: f64) {
        if self.report_at < u32::MAX {
            self.report(sample);
        }
        let bias = self.noise.bias_n();
        let span = (sample.position_m - self.before_m).max(0.0);
        // One sample that says it all lies half a step behind the rupture; a sum over many began where it left zero, give or take
        // a step.
        let first = span.min(step.dz_m.max(0.0));
        let at_m = self.before_m + 0.5 * first;
        let place_m = if span > 1.5 * first { first.max(0.5 * span) } else { first / libm::sqrt(12.0) };
        let drive = self.steady.max(1e-6);
        let predicted = self.local.level_n();
        self.layers = self.before;
        self.work += WORK_RUPTURE;
        self.layers.rupture(at_m, place_m, drive, &self.noise, &mut self.behind);
        self.fallen = Some(self.layers);
        self.since_s = 0.0;
        (self.lasting, self.fell_s) = (None, f64::INFINITY);
        (self.intact, self.fell_m, self.located_m) = (self.before, sample.position_m, at_m);
        self.layers.take(sample.position_m, self.drive, sample.force_n, step.rho);
        let force = (sample.force_n - bias).abs().max((predicted - sample.force_n).abs());
        self.local.renew(sample.force_n, force, &self.noise, step.speed_mps, false);
        self.alarm.rest();
        self.was_quiet = true;
        self.fall = None;
        self.before = self.layers;
        self.before_m = sample.position_m;
        self.since = 0;
        self.report_at = 16;
        if self.out.ruptures == 0 {
            self.out.contact_m = Some(self.layers.start_m - self.layers.previous_m);
        }
        self.out.ruptures += 1;
        self.shaft.rupture(sample.position_m, sample.force_n - bias);
        // Before the sum passed its threshold a rupture was as likely as a false alarm; what is above it counts.
        let confidence = 1.0 / (1.0 + libm::exp(-(evidence + core::f64::consts::LN_2)));
        let (drop_n, drop_sd_n) = self.drop;
        self.out.detection = Some(Detection {
            layer: self.out.ruptures,
            time_s: sample.time_s,
            position_m: sample.position_m,
            located_s: sample.time_s,
            located_m: at_m,
            cause: Cause::Cusum,
            drop_n,
            drop_sd_n,
            confidence,
        });
    }

    /// Whether the drop still goes on; once it is over, that is settled.
    pub(super) fn settle(&mut self, step: &Step, sample: &Sample) -> bool {
        // How the speed changes: by as much as it is away from its low-passed self.
        let accel_mps2 = (sample.velocity_mps - step.speed_mps) / SPEED_S;
        let friction = self.layers.behind(sample.position_m, &self.noise).0;
        let (rate, variance) = self.local.rate(step.speed_mps, accel_mps2, friction);
        let sd = libm::sqrt(variance * self.noise.variance);
        let falling = rate < -3.0 * sd;
        self.fell_s = if falling { 0.0 } else { self.fell_s + step.dt_s };
        if self.falling && !falling {
            // The slope of a fall that may be over is not that of what follows.
            let force = (sample.force_n - self.noise.bias_n()).abs().max(sd * step.dt_s);
            self.local.renew(sample.force_n, force, &self.noise, step.speed_mps, false);
        }
        if self.since_s > LONGEST_DROP_S {
            if falling {
                self.trace_back(step, sample, rate, sd);
            } else if rate > -2.0 * sd && self.fell_s > LONGEST_DROP_S {
                self.fallen = None;
                self.fall_anew();
            }
        }
        falling
    }

    /// A drop that lasts began where the straight line of the force that falls meets what the law says: the best known of what its samples say.
    fn trace_back(&mut self, step: &Step, sample: &Sample, rate_n_per_s: f64, sd_n_per_s: f64) {
        let steep = self.intact.slope(self.drive) - rate_n_per_s / step.speed_mps;
        let back_m = (self.intact.says(sample.position_m, self.drive) - self.local.level_n()) / steep;
        // Level and slope are wrong together: what makes the one too high makes the line less steep.
        let (level, both) = self.local.level_doubt(step.speed_mps);
        let (by_m, noise_n2) = (back_m / step.speed_mps, self.noise.variance);
        let line_n2 = level * noise_n2 + by_m * (by_m * sd_n_per_s * sd_n_per_s - 2.0 * both * noise_n2);
        let variance = at_least(TINY_M2, line_n2 / (steep * steep));
        let began_m = sample.position_m - back_m;
        self.lasting = match self.lasting {
            None if steep > 0.0 => Some((began_m, variance)),
            // A line that does not lead to where it led before is not that of the fall any more.
            Some((best_m, best))
                if steep > 0.0 && variance < best && square(began_m - best_m) < 16.0 * best =>
            {
                Some((began_m, variance))
            }
            kept => kept,
        };
    }

    /// What was taken for a sudden drop began before: the belief of before moves on from there.
    fn fall_anew(&mut self) {
        let Some((began_m, variance)) = self.lasting.take() else { return };
        let span_m = self.fell_m - self.located_m;
        let began_m = began_m.clamp(self.located_m - span_m.max(MEMORY_M), self.fell_m);
        self.work += WORK_RUPTURE;
        self.layers = self.intact;
        let drive = self.steady.max(1e-6);
        self.layers.rupture(began_m, libm::sqrt(variance).min(span_m), drive, &self.noise, &mut self.behind);
    }
}

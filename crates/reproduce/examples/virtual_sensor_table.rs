//! What the virtual sensor costs: ruptures found, false alarms and delays by force/torque sensor and by
//! virtual sensor, at the clean setting and with the joint friction measured on a Panda, in shares of
//! it, zeroed in motion just before contact and zeroed at rest before the motion.
//!
//! `cargo run --release -p stylet-reproduce --example virtual_sensor_table [SEEDS]` (20 without it; about two minutes)

use std::path::Path;
use std::sync::Mutex;
use stylet_scenario::{ArmFriction, Robot, Scenario, Sensor, ZeroWindow};
use stylet_score::{Score, score_run};
use stylet_stats::{median_of, wilson};
use stylet_testbed::simulate;

/// Shares of the measured joint friction.
const SCALES: [f64; 5] = [0.0, 0.1, 0.25, 0.5, 1.0];

type Failure = Box<dyn std::error::Error + Send + Sync>;
/// A sensor's name and its score.
type Scored = (&'static str, Score);

/// One line of the table: a scenario with its friction and the seeds' scores per sensor.
struct Setting {
    scenario: Scenario,
    label: String,
    scores: Vec<Scored>,
    off_n: Vec<f64>,
}

fn setting(base: &Scenario, scale: f64, zero: ZeroWindow, label: &str) -> Setting {
    let mut scenario = base.clone();
    if let Robot::Arm(arm) = &mut scenario.robot {
        arm.joint_friction = ArmFriction::MeasuredDirectional;
        arm.friction_scale = scale;
    }
    if let Sensor::Both { virtual_sensor, .. } = &mut scenario.sensor {
        virtual_sensor.zero = zero;
    }
    Setting { scenario, label: format!("{scale:<5} {label}"), scores: Vec::new(), off_n: Vec::new() }
}

/// Simulates one seed and scores both sensors.
fn one(scenario: &Scenario, seed: u64) -> Result<(Vec<Scored>, f64), Failure> {
    let simulation = simulate(scenario, seed)?;
    let layers = simulation.true_layers();
    let scores = simulation.readings.iter().map(|reading| {
        let config = match reading.sensor {
            "virtual" => scenario.enhance_for_virtual(),
            _ => &scenario.enhance,
        };
        let (recording, truth) = (&simulation.recording, &simulation.truth);
        (reading.sensor, score_run(recording, &reading.force_n, truth, &layers, config).1)
    });
    Ok((scores.collect(), simulation.virtual_sensor_accuracy.map_or(f64::NAN, |e| e.lag_corrected_rms_n)))
}

/// A rate's 95 % interval in per cent.
fn rate(hits: usize, of: usize) -> String {
    let rate = wilson(hits, of);
    format!("{:.0}-{:.0} %", 100.0 * rate.low, 100.0 * rate.high)
}

fn print_row(label: &str, sensor: &str, off_n: Option<f64>, scores: &[&Score]) {
    let ruptures: usize = scores.iter().map(|s| s.ruptures.len()).sum();
    let missed: usize = scores.iter().map(|s| s.missed).sum();
    let alarms: usize = scores.iter().map(|s| s.false_alarms).sum();
    let disturbed = scores.iter().filter(|s| s.false_alarms > 0).count();
    let delay = median_of(scores.iter().flat_map(|s| s.ruptures.iter().filter_map(|r| r.delay_s)));
    let delay = if delay.is_nan() { "-".to_owned() } else { format!("{:.0}", delay * 1e3) };
    println!(
        "  {sensor:<8} {label:<16} {:>8}  {missed:>3} of {ruptures:<3} {:>9}  {alarms:>3} in {disturbed:>2} of {:<2} runs {:>9}  {delay:>5}",
        off_n.map_or("-".to_owned(), |off| format!("{:.0}", off * 1e3)),
        rate(missed, ruptures),
        scores.len(),
        rate(disturbed, scores.len()),
    );
}

fn main() -> Result<(), Failure> {
    let seeds: u64 = match std::env::args().nth(1) {
        Some(text) => text.parse()?,
        None => 20,
    };
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
    for file in ["bovine_liver_constant_virtual.ron", "abdomen_sinusoidal_virtual.ron"] {
        let base = Scenario::load(&folder.join(file))?;
        let mut settings: Vec<Setting> =
            SCALES.iter().map(|&s| setting(&base, s, ZeroWindow::default(), "in motion")).collect();
        let at_rest = ZeroWindow::AtRest { average_s: 0.5 };
        settings.extend(SCALES.iter().skip(1).map(|&s| setting(&base, s, at_rest, "at rest")));

        let settings: Vec<Mutex<Setting>> = settings.into_iter().map(Mutex::new).collect();
        let next = Mutex::new(0..settings.len());
        let work = || -> Result<(), Failure> {
            loop {
                let Some(index) = next.lock().map_err(|e| e.to_string())?.next() else { return Ok(()) };
                let mut setting = settings[index].lock().map_err(|e| e.to_string())?;
                for seed in 1..=seeds {
                    let (scores, off_n) = one(&setting.scenario, seed)?;
                    setting.scores.extend(scores);
                    setting.off_n.push(off_n);
                }
            }
        };
        std::thread::scope(|scope| {
            let threads = [scope.spawn(work), scope.spawn(work)];
            threads.into_iter().try_for_each(|t| t.join().map_err(|_| "a thread has panicked")?)
        })?;

        println!("\n{}, {seeds} seeds\n", base.name);
        println!(
            "  sensor   friction, zeroed  off mN  missed      95 %       false alarms       95 %    delay ms"
        );
        for setting in &settings {
            let setting = setting.lock().map_err(|e| e.to_string())?;
            let of = |sensor: &str| -> Vec<&Score> {
                setting.scores.iter().filter(|(s, _)| *s == sensor).map(|(_, score)| score).collect()
            };
            if setting.label.starts_with("0 ") {
                print_row("", "F/T", None, &of("force_torque"));
            }
            print_row(
                &setting.label,
                "virtual",
                (!setting.off_n.is_empty()).then(|| median_of(setting.off_n.iter().copied())),
                &of("virtual"),
            );
        }
    }
    println!(
        "\nfriction: share of the joint friction measured on a Panda. off: RMS after correction for the observer's lag, from the\n\
         instant of zeroing, median over the seeds. missed, false alarms, delay: median over what was found."
    );
    Ok(())
}

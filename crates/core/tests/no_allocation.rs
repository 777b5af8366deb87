//! Promise: the core does not allocate after construction, over a million steps with ruptures, replays and compensation.

#[path = "promises/support/mod.rs"]
mod support;

use stylet_core::{EnhanceConfig, Enhancer, Sample};

#[test]
fn a_million_steps_with_ruptures_allocate_nothing() {
    let data = support::constant(0.02, 1);
    let mut steps = 0u64;
    let mut ruptures = 0usize;
    let mut estimates = 0u64;
    for _ in 0..100 {
        let mut core = Enhancer::new(EnhanceConfig::paper(), 0.0, vec![Sample::default(); 8192]);
        let counted = allocation_counter::measure(|| {
            for sample in &data.samples {
                let out = core.step(*sample);
                steps += 1;
                estimates += u64::from(out.estimate.is_some());
                ruptures += usize::from(out.detection.is_some());
            }
        });
        assert_eq!(counted.count_total, 0, "allocations in {} steps", data.samples.len());
    }
    println!("{steps} steps, {ruptures} ruptures, {estimates} re-estimated layers: 0 allocations");
    assert_eq!(steps, 1_000_000);
    assert_eq!((ruptures, estimates), (300, 300), "the run must have ruptures");
}

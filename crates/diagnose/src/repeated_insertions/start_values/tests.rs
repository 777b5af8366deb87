use super::{StartValues, base_law_prior, indentation_prior, layer_geometry, shaft_slip_start};
use crate::repeated_insertions::segmented_recording::SegmentedRecording;
use crate::repeated_insertions::segmented_recording::tests::{assumed, run};
use stylet_identify::model::{NO_RUPTURE, TiedParameter};

#[test]
fn a_rupture_without_a_drop_starts_where_the_force_reaches_the_plateau() {
    let mut silent = run("a", 0.002, 0.028);
    (silent.ruptures_s, silent.loads_n) = (vec![NO_RUPTURE; 2], vec![None; 2]);
    let (shown, none) = (run("b", 0.002, 0.028), StartValues { rupture_depth_m: None, ..guess() });
    let recordings = [&silent, &shown];
    let m = shaft_slip_start(&assumed(), &recordings, &guess());
    let load = shown.loads_n[0].expect("a drop");
    let held = guess().hold_ratio * load;
    let at = m.rupture_times_s[0][0];
    let k = silent.recording.time_s.partition_point(|t| *t < at);
    let f = &silent.recording.force_n;
    assert!(f[k] >= held && f[..k].iter().all(|f| *f < held), "{at} {held}");
    assert!(
        m.rupture_times_s[0][1] > at && m.rupture_times_s[0][1] < NO_RUPTURE,
        "{:?}",
        m.rupture_times_s[0]
    );
    assert_eq!(m.rupture_times_s[1][0], shown.ruptures_s[0]);
    assert_eq!(shaft_slip_start(&assumed(), &recordings, &none).rupture_times_s[0], vec![NO_RUPTURE; 2]);
    let weak = shaft_slip_start(&assumed(), &recordings, &StartValues { hold_ratio: 1e3, ..guess() });
    assert_eq!(weak.rupture_times_s[0], vec![NO_RUPTURE; 2]);
}

#[test]
fn the_frame_has_limits_without_recordings_or_depth() {
    let f = layer_geometry(&assumed(), &[], 0.0);
    assert_eq!(f.fronts_m[0], 0.001);
    assert!((f.indented_m[0] - 0.01).abs() < 1e-12, "{:?}", f.indented_m);
    let shallow = SegmentedRecording { stroke_m: 0.005, ..run("a", 0.005, 0.026) };
    let f = layer_geometry(&assumed(), &[&shallow], 0.0);
    assert!((f.fronts_m[1] - f.fronts_m[0] - 2e-3).abs() < 1e-12, "{:?}", f.fronts_m);
    let mut r = run("a", 0.005, 0.026);
    let place = r.recording.position_m.clone();
    for (t, wanted) in [(r.recording.time_s[150], place[150]), (1e3, place[place.len() - 1])] {
        r.ruptures_s[0] = t;
        let f = layer_geometry(&assumed(), &[&r], 0.0);
        assert!(
            (f.indented_m[0] - (wanted - f.fronts_m[0]).max(2e-3)).abs() < 1e-12,
            "{t}: {:?}",
            f.indented_m
        );
    }
}

#[test]
fn the_frame_uses_medians_over_recordings() {
    let all = [run("a", 0.005, 0.026), run("b", 0.005, 0.026), run("c", 0.004, 0.026)];
    let refs: Vec<&SegmentedRecording> = all.iter().collect();
    let f = layer_geometry(&assumed(), &refs, 2e-4);
    let contact = stylet_stats::median_of(all.iter().map(|r| r.contact_m));
    assert_eq!(f.fronts_m[0], contact + 2e-4);
    assert_eq!(f.tissue.surface_m, f.fronts_m[0]);
    let release = stylet_stats::median_of(all.iter().filter_map(|r| r.releases_m[1]));
    assert!((f.fronts_m[1] - (release - 5e-4)).abs() < 1e-12);
    assert!((f.tissue.layers[0].thickness_m - (f.fronts_m[1] - f.fronts_m[0])).abs() < 1e-12);
    assert!((f.tissue.layers[1].thickness_m - 0.03).abs() < 1e-12);
    let load = |l: usize| stylet_stats::median_of(all.iter().filter_map(|r| r.loads_n[l]));
    assert!((f.loads_n[0] - load(0)).abs() < 1e-12 && (f.loads_n[1] - 0.6 * load(1)).abs() < 1e-12);
    assert!((f.indented_m[0] - (0.010 - f.fronts_m[0])).abs() < 2e-4, "{:?}", f.indented_m);
    assert!((f.indented_m[1] - (0.022 - f.fronts_m[1])).abs() < 2e-4, "{:?}", f.indented_m);

    // Without releases the assumed thickness gives the boundary; without ruptures the deepest point and
    // the largest force are used.
    let mut blank = all.to_vec();
    for r in &mut blank {
        (r.releases_m, r.ruptures_s, r.loads_n) = (vec![None; 2], vec![NO_RUPTURE; 2], vec![None; 2]);
    }
    let refs: Vec<&SegmentedRecording> = blank.iter().collect();
    let f = layer_geometry(&assumed(), &refs, 0.0);
    assert!((f.fronts_m[1] - (contact + 0.009)).abs() < 1e-12);
    let largest = blank.iter().flat_map(|r| &r.recording.force_n).fold(0.0_f64, |m, x| m.max(x.abs()));
    assert!((f.loads_n[0] - largest).abs() < 1e-12 && (f.loads_n[1] - 0.6 * largest).abs() < 1e-12);
    assert!((f.indented_m[0] - (0.026 - contact)).abs() < 1e-9);
    // Boundaries are at least 1 mm behind the previous one and 1 mm before the deepest point.
    let mut thin = assumed();
    thin.layers[0].thickness_m = 2e-4;
    assert!((layer_geometry(&thin, &refs, 0.0).fronts_m[1] - (contact + 1e-3)).abs() < 1e-12);
    thin.layers[0].thickness_m = 0.08;
    let f = layer_geometry(&thin, &refs, 0.0);
    assert!(
        (f.fronts_m[1] - 0.025).abs() < 1e-9 && (f.indented_m[1] - 2e-3).abs() < 1e-9,
        "{:?}",
        f.fronts_m
    );
    // The last layer reaches at least 20 mm beyond the deepest point, unless the needle leaves it.
    thin.layers[1].thickness_m = 1e-3;
    let f = layer_geometry(&thin, &refs, 0.0);
    assert!((f.tissue.layers[1].thickness_m - 0.021).abs() < 1e-9 && !f.leaves, "{:?}", f.tissue);
    thin.layers[0].thickness_m = 0.01;
    let f = layer_geometry(&thin, &refs, 0.0);
    assert!(f.tissue.layers[1].thickness_m == 1e-3 && f.leaves, "{:?}", f.tissue);
    // Loads have a lower limit of 5 % of the largest force.
    blank[0].loads_n = vec![Some(0.01), None];
    let refs: Vec<&SegmentedRecording> = blank.iter().collect();
    assert!((layer_geometry(&assumed(), &refs, 0.0).loads_n[0] - 0.05 * largest).abs() < 1e-12);
}

#[test]
fn the_base_law_prior_has_a_puncture_force_where_most_recordings_rupture() {
    let mut all =
        [run("a", 0.005, 0.026), run("b", 0.005, 0.026), run("c", 0.005, 0.026), run("d", 0.005, 0.026)];
    all[0].ruptures_s[1] = NO_RUPTURE;
    all[1].ruptures_s[1] = NO_RUPTURE;
    let refs: Vec<&SegmentedRecording> = all.iter().collect();
    let f = layer_geometry(&assumed(), &refs, 0.0);
    let b = base_law_prior(&assumed(), &refs);
    for l in 0..2 {
        let layer = &b.tissue.layers[l];
        assert!((layer.stiffness_n_per_m - f.loads_n[l] / f.indented_m[l]).abs() < 1e-9);
        let friction = 0.3 * f.loads_n[l] / (refs[0].speed_mps * f.indented_m[l]);
        assert!((layer.friction_ns_per_m2 / friction - 1.0).abs() < 1e-9);
        assert_eq!(layer.puncture_n, Some(f.loads_n[l]));
    }
    assert_eq!(
        (b.tolerance, b.thickness_tolerance, b.surface_tolerance_m),
        (vec![4.0; 2], vec![0.2, 0.0], 1.5e-3)
    );
    // Ruptures in less than half of the recordings: the assumed puncture force, if there is one.
    all[2].ruptures_s[1] = NO_RUPTURE;
    let refs: Vec<&SegmentedRecording> = all.iter().collect();
    let mut other = assumed();
    for puncture_n in [Some(7.0), None] {
        other.layers[1].puncture_n = puncture_n;
        assert_eq!(base_law_prior(&other, &refs).tissue.layers[1].puncture_n, puncture_n);
    }
    let six = [&refs[..], &[&all[3], &all[3]]].concat();
    assert!(base_law_prior(&assumed(), &six).tissue.layers[1].puncture_n.is_some());
    let p = indentation_prior(&assumed(), &all[3]);
    let f = layer_geometry(&assumed(), &[&all[3]], 0.0);
    for l in 0..2 {
        let layer = &p.tissue.layers[l];
        assert!((layer.stiffness_n_per_m - f.loads_n[l] / f.indented_m[l]).abs() < 1e-9);
        assert_eq!((layer.friction_ns_per_m2, layer.puncture_n), (0.0, None));
    }
    assert_eq!(p.surface_tolerance_m, 2e-3);
}

fn guess() -> StartValues {
    StartValues {
        linear_share: 0.4,
        hold_ratio: 0.55,
        pull_ratio: 0.7,
        kept_share: 0.8,
        exponent: 9.0,
        wear_per_m: [11.0, 23.0],
        rate: -0.2,
        fractions: [0.1, 0.2],
        time_constants_s: [0.5, 7.0],
        delay_exponent: 13.0,
        surface_m: 3e-4,
        rupture_depth_m: Some(2e-3),
    }
}

#[test]
fn the_start_model_has_slip_delay_and_release_in_every_layer() {
    let all = [run("a", 0.005, 0.026), run("b", 0.003, 0.026), run("c", 0.005, 0.026)];
    let refs: Vec<&SegmentedRecording> = all.iter().collect();
    let g = guess();
    let f = layer_geometry(&assumed(), &refs, g.surface_m);
    let m = shaft_slip_start(&assumed(), &refs, &g);
    assert_eq!(
        m.effects.iter().map(|e| e.info.id).collect::<Vec<_>>(),
        ["shaft_slip", "delayed_puncture", "release_depth"].repeat(2)
    );
    let of = |e: usize, path: &str| {
        let k = m.effects[e].info.parameters.iter().position(|p| p.path == path).expect("a parameter");
        m.effects[e].values[k]
    };
    for l in 0..2 {
        let (load, x) = (f.loads_n[l], f.indented_m[l]);
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-9 * (1.0 + b.abs()), "layer {l}: {a} for {b}");
        near(m.tissue.layers[l].stiffness_n_per_m, 0.4 * load / x);
        near(of(3 * l, "push_n"), 0.55 * load);
        near(of(3 * l, "pull_n"), 0.7 * 0.55 * load);
        near(of(3 * l, "curvature_n_per_m2"), 0.6 * load / (x * x));
        near(of(3 * l, "wear_per_m"), [11.0, 23.0][l]);
        near(of(3 * l, "rate"), -0.2);
        near(of(3 * l + 1, "force_n"), load);
        near(of(3 * l + 1, "exponent"), 13.0);
        let z = stylet_stats::median_of(all.iter().filter_map(|r| r.releases_m[l]));
        near(of(3 * l + 2, "depth_m"), z - f.fronts_m[l]);
        assert_eq!(
            (of(3 * l, "layer"), of(3 * l + 1, "layer"), of(3 * l + 2, "layer")),
            (l as f64 + 1.0, l as f64 + 1.0, l as f64 + 1.0)
        );
    }
    // Shaft parameters are tied between layers; with two speeds nothing else is.
    let mut wanted = vec![TiedParameter { effect: 4, parameter: 2, tied_to: Some(1) }];
    wanted.extend([3, 4, 6, 8, 9, 10, 11].map(|parameter| TiedParameter {
        effect: 3,
        parameter,
        tied_to: Some(0),
    }));
    assert_eq!(m.tied, wanted);
    // Days are groups, slowest first.
    assert_eq!(
        (m.day_of.as_slice(), m.days.len(), m.free.day_surface, m.free.day_friction),
        (&[1, 0, 1][..], 2, true, true)
    );
    assert!(
        m.fixed_scatter && m.free.recording_surface && m.free.recording_friction && m.free.recording_effects
    );
    // The second layer ruptures 2 mm behind its front, not at the drop.
    for (r, run) in all.iter().enumerate() {
        assert_eq!(m.rupture_times_s[r][0], run.ruptures_s[0]);
        let k =
            run.recording.position_m.iter().position(|z| *z > f.fronts_m[1] + 2e-3).expect("it gets there");
        assert_eq!(m.rupture_times_s[r][1], run.recording.time_s[k]);
    }
    for (k, (e, p)) in m.varying_parameters().enumerate() {
        for (r, run) in all.iter().enumerate() {
            if let Some(z) = run.releases_m.get(k).copied().flatten() {
                let range = m.effects[e].info.parameters[p];
                let own = (z - f.fronts_m[k.min(1)]).clamp(range.low, range.high) - m.effects[e].values[p];
                assert!((m.per_recording[r].varying[k] - own).abs() < 1e-12, "{k} {r}");
            }
        }
    }
}

#[test]
fn one_speed_fixes_rate_and_delay_exponent() {
    let all = [run("a", 0.005, 0.026), run("b", 0.0052, 0.026)];
    let refs: Vec<&SegmentedRecording> = all.iter().collect();
    let m = shaft_slip_start(&assumed(), &refs, &StartValues { rupture_depth_m: None, ..guess() });
    assert_eq!(
        m.tied[..2],
        [
            TiedParameter { effect: 0, parameter: 6, tied_to: None },
            TiedParameter { effect: 1, parameter: 2, tied_to: None }
        ]
    );
    assert_eq!(m.effects[0].values[6], 0.0);
    assert!(!m.free.day_surface && !m.free.day_friction && m.days.len() == 1);
    // Ruptures are strictly behind the given depth.
    let front = layer_geometry(&assumed(), &refs, 3e-4).fronts_m[1];
    let place = &all[0].recording.position_m;
    let exact = |z: &f64| *z > front + 1e-3 && front + (z - front) == *z;
    let k = place.iter().position(exact).expect("a sample whose depth is a sum");
    let at = shaft_slip_start(
        &assumed(),
        &refs,
        &StartValues { rupture_depth_m: Some(place[k] - front), ..guess() },
    );
    assert_eq!(at.rupture_times_s[0][1], all[0].recording.time_s[k + 1]);
    assert_eq!(m.rupture_times_s, all.iter().map(|r| r.ruptures_s.clone()).collect::<Vec<_>>());
    // A layer cannot rupture before the one above: two samples later.
    let m = shaft_slip_start(&assumed(), &refs, &StartValues { rupture_depth_m: Some(-8e-3), ..guess() });
    for (r, run) in all.iter().enumerate() {
        let wanted = run.ruptures_s[0] + 2.0 * run.recording.median_interval_s();
        assert!(m.rupture_times_s[r][1] >= wanted - 1e-12, "{:?}", m.rupture_times_s[r]);
    }
}

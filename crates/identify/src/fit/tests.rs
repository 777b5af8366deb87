use super::kinks::{freed, trusting};
use super::step::in_order;
use super::*;
use crate::blocks::{BLOCK_S, Blocks};
use crate::events::Event;
use crate::model::{Belief, Own};
use crate::model::{NEVER, Number, Role};
use crate::noise::Noise;
use crate::objective::{Trail, nats, replay};
use std::sync::Arc;
use stylet_record::Recording;
use stylet_tissue::{Layer, Tissue};

fn near(told: f64, wanted: f64) {
    assert!((told - wanted).abs() <= 1e-9 * wanted.abs().max(1e-9), "{told} for {wanted}");
}

/// Two layers from 4 mm on, the first of which gives way by its force after 5 mm of 12 mm.
fn model(recordings: usize) -> Model {
    let layer = |thickness_m: f64, k: f64, puncture_n: Option<f64>| Layer {
        thickness_m,
        stiffness_n_per_m: k,
        friction_ns_per_m2: 3000.0,
        puncture_n,
        name: String::new(),
    };
    let belief = Belief {
        tissue: Tissue {
            surface_m: 0.004,
            layers: vec![layer(0.012, 200.0, Some(1.0)), layer(0.03, 80.0, None)],
        },
        given: Vec::new(),
        tolerance: vec![0.3; 2],
        thickness_tolerance: vec![0.0; 2],
        surface_tolerance_m: 0.002,
    };
    let mut model = Model::base(Arc::new(belief), recordings);
    model.free.own_surface = true;
    model.free.own_friction = true;
    model
}

/// What a model gives for a needle that goes in by 4 mm/s and a ripple, with a little of something else.
fn data(truth: &Model, rough_n: f64) -> Data {
    let recorded = |r: usize| {
        let t: Vec<f64> = (0..1000).map(|k| f64::from(k) * 0.005).collect();
        let z = t.iter().map(|t| 0.004 * t + 4e-4 * ((2.0 + r as f64) * t).sin()).collect();
        let mut b = Blocks::new(&Recording::new(t, z, vec![0.0; 1000]).expect("a recording"), &[], BLOCK_S);
        let silent = Data::new(Arc::new(vec![b.clone(); truth.own.len()]), Noise::white(0.01), 0.0);
        let mut f = replay(truth, &silent, r).expect("a replay").f;
        f.iter_mut()
            .enumerate()
            .for_each(|(k, f)| *f += rough_n * (1.7 * (k * k % (89 + 12 * r)) as f64).sin());
        b.f = f;
        b
    };
    let blocks = (0..truth.own.len()).map(recorded).collect();
    Data::new(Arc::new(blocks), Noise::white(0.01), 0.0)
}

fn column(w: &[&[f64]], rows: &[&[f64]]) -> Column {
    let of = |x: &[&[f64]]| x.iter().map(|x| x.to_vec()).collect();
    Column { w: of(w), rows: of(rows) }
}

#[test]
fn columns_are_multiplied_recording_by_recording() {
    let a = column(&[&[1.0, 2.0], &[3.0]], &[&[0.5], &[4.0, 1.0]]);
    let b = column(&[&[2.0, -1.0], &[5.0]], &[&[4.0], &[1.0, 2.0]]);
    assert_eq!((a.dot(&b, 0), a.dot(&b, 1), a.dot(&b, 2), a.dot_all(&b)), (2.0, 21.0, 0.0, 23.0));
}

#[test]
fn what_is_left_is_measured_at_the_blocks_that_are_compared() {
    let (m, d) = (model(1), data(&model(1), 0.0));
    let mut blocks = (*d.blocks).clone();
    blocks[0].used = (0..blocks[0].len()).map(|k| k < 2).collect();
    let e = vec![(0..blocks[0].len()).map(|k| [3.0, 5.0, 100.0][k.min(2)]).collect()];
    let fit = Fit { model: m, residuals: Residuals { e, nats: 7.5, ..Residuals::default() } };
    near(fit.rms_n(&d.on(blocks)), 17.0_f64.sqrt());
    assert_eq!((fit.nats(), fit.rms_n(&d.on(Vec::new()))), (7.5, 0.0));
}

#[test]
fn instants_are_put_in_order_inside_the_recording() {
    let of = |mut instants: Vec<f64>| {
        in_order(&mut instants, (1.0, 9.0));
        instants
    };
    assert_eq!(of(vec![0.5, 4.0, 3.0, 12.0]), [1.0, 4.0, 4.0, 9.0]);
    assert_eq!(of(vec![2.0, NEVER, NEVER]), [2.0, NEVER, NEVER]);
}

#[test]
fn numbers_are_brought_within_what_is_believed() {
    let mut m = model(1);
    m.tissue.layers[0].stiffness_n_per_m = 500.0;
    m.tissue.layers[1].stiffness_n_per_m = 10.0;
    m.tissue.surface_m = 0.0045;
    clamp(&mut m);
    near(m.tissue.layers[0].stiffness_n_per_m, 260.0);
    near(m.tissue.layers[1].stiffness_n_per_m, 56.0);
    near(m.tissue.surface_m, 0.0045);
}

/// No layer gave way: all is smooth.
fn smooth() -> (Model, Data) {
    let mut m = model(2);
    m.instants = vec![vec![NEVER; 2]; 2];
    m.scatter.force = 0.1;
    m.scatter.place_m = 2e-3;
    let d = data(&m, 0.02);
    // A law that is off, each recording by something of its own.
    m.tissue.layers[0].stiffness_n_per_m = 196.0;
    m.own = [2e-4, -1e-4]
        .map(|surface_m| Own { surface_m, friction: 10.0 * surface_m, ..Own::default() })
        .to_vec();
    (m, d)
}

#[test]
fn downhill_is_where_the_nats_fall() {
    let (m, d) = smooth();
    let at = residuals(&m, &d).expect("a replay");
    // Some residuals are beyond what counts as a square, some are not.
    let rough = at.w.iter().flatten().filter(|w| w.abs() > 2.5).count();
    assert!(rough > 5 && rough < 400, "{rough}");
    let t = Tangent::new(&m, &d, &at);
    let nats = |role: Role, r: usize, by: f64| {
        let mut moved = m.clone();
        moved.set(role, r, m.get(role, r) + by);
        residuals(&moved, &d).expect("a replay").nats
    };
    let falls = |n: &Number, r: usize| (nats(n.role, r, -n.step) - nats(n.role, r, n.step)) / (2.0 * n.step);
    let is = |told: f64, n: &Number, r: usize| {
        let wanted = falls(n, r);
        assert!((told - wanted).abs() < 0.01 * wanted.abs() + 1e-3, "{told} for {wanted}, {:?}", n.role);
    };
    assert!(t.shared.len() >= 5);
    for (k, n) in t.shared.iter().enumerate() {
        is(t.slope[k], n, 0);
    }
    for r in 0..2 {
        for (o, n) in t.own.iter().enumerate().filter(|(_, n)| !matches!(n.role, Role::Instant(_))) {
            assert_eq!(t.place(o, r), t.shared.len() + r * t.own.len() + o);
            is(t.slope[t.place(o, r)], n, r);
        }
    }
}

#[test]
fn the_normal_matrix_is_that_of_all_columns_and_priors() {
    let (m, d) = smooth();
    let at = residuals(&m, &d).expect("a replay");
    let t = Tangent::new(&m, &d, &at);
    let (ns, no) = (t.shared.len(), t.own.len());
    // The number at a place of the matrix, and the recording whose own it is.
    let number = |i: usize| if i < ns { (i, None) } else { (ns + (i - ns) % no, Some((i - ns) / no)) };
    for i in 0..ns + 2 * no {
        for j in 0..=i {
            let ((a, ra), (b, rb)) = (number(i), number(j));
            let products = |r: usize| t.columns[a].dot(&t.columns[b], r);
            let mut wanted: f64 = (0..2)
                .filter(|r| ra.is_none_or(|a| a == *r) && rb.is_none_or(|b| b == *r))
                .map(products)
                .sum();
            let sd = if a < ns { t.shared[a].sd } else { t.own[a - ns].sd };
            if i == j && sd.is_finite() {
                wanted += 1.0 / (sd * sd);
            }
            let told = t.matrix.at(i, j);
            assert!((told - wanted).abs() <= 1e-9 * wanted.abs(), "{told} for {wanted} at {i} {j}");
        }
    }
    let against = t.against(&t.columns[0], 2);
    near(against[1], t.columns[0].dot_all(&t.columns[1]));
    near(against[ns + no], t.columns[ns].dot(&t.columns[0], 1));
    assert_eq!(against.len(), ns + 2 * no);
}

#[test]
fn a_derivative_costs_half_a_replay() {
    let (m, d) = smooth();
    let at = residuals(&m, &d).expect("a replay");
    let before = d.work();
    let t = Tangent::new(&m, &d, &at);
    let blocks = d.blocks[0].len() as u64;
    assert_eq!(d.work() - before, 2 * blocks + (t.shared.len() + t.own.len()) as u64 * 2 * (blocks / 2));
}

#[test]
fn a_wide_step_is_half_of_what_it_changes_both_ways() {
    let (m, d) = smooth();
    let at = residuals(&m, &d).expect("a replay");
    let surface = |n: &Number| (n.role == Role::Surface).then_some(1e-3);
    let plain = Tangent::new(&m, &d, &at);
    let wide = Tangent::new(&m, &d, &at).widened(&m, &d, &at, &surface);
    let moved = |by: f64| {
        let mut other = m.clone();
        other.set(Role::Surface, 0, m.get(Role::Surface, 0) + by);
        plain.difference(&m, &d, &at, &other).expect("a column")
    };
    let (up, down) = (moved(1e-3), moved(-1e-3));
    for (k, n) in wide.shared.iter().enumerate() {
        if n.role != Role::Surface {
            assert_eq!(wide.columns[k].w, plain.columns[k].w);
            continue;
        }
        for r in 0..2 {
            for i in 0..up.w[r].len() {
                let wanted = (up.w[r][i] - down.w[r][i]) / 2e-3;
                assert!((wide.columns[k].w[r][i] - wanted).abs() < 1e-6 * wanted.abs().max(1.0));
            }
        }
        near(wide.matrix.at(k, k), wide.columns[k].dot_all(&wide.columns[k]) + 1.0 / (n.sd * n.sd));
        assert_ne!(wide.matrix.at(k, k), plain.matrix.at(k, k));
    }
}

#[test]
fn a_fit_finds_the_law_that_gave_the_force() {
    let mut truth = model(2);
    truth.tissue.layers[0].stiffness_n_per_m = 215.0;
    truth.tissue.layers[1].friction_ns_per_m2 = 2700.0;
    truth.tissue.surface_m = 0.0043;
    truth.own = [4e-4, -4e-4].map(|surface_m| Own { surface_m, ..Own::default() }).to_vec();
    // Where the law itself has them.
    truth.instants = vec![vec![NEVER; 2]; 2];
    let own = |r: usize| Trail::new(&truth, &data(&truth, 0.0), r).expect("a trail").own_instants();
    truth.instants = vec![own(0), own(1)];
    let d = data(&truth, 0.002);
    let mut m = model(2);
    m.instants = [(0, -0.021), (1, 0.027)].map(|(r, by)| vec![truth.instants[r][0] + by, NEVER]).to_vec();
    let found = fit(&m, &d, Effort::FULL).expect("a fit");
    let is =
        |told: f64, wanted: f64, within: f64| assert!((told - wanted).abs() < within, "{told} for {wanted}");
    let tissue = &found.model.tissue;
    is(tissue.layers[0].stiffness_n_per_m, 215.0, 2.0);
    is(tissue.layers[1].friction_ns_per_m2, 2700.0, 200.0);
    for (r, own) in found.model.own.iter().enumerate() {
        is(tissue.surface_m + own.surface_m, 0.0043 + truth.own[r].surface_m, 3e-5);
        is(found.model.instants[r][0], truth.instants[r][0], 1e-3);
        assert_eq!(found.model.instants[r][1], NEVER);
    }
    assert!(found.rms_n(&d) < 0.003, "{}", found.rms_n(&d));
    // Given up where it gains too little for what is wanted; never worse than where it began.
    let least = fit_below(&m, &d, Effort::FULL, -1e9).expect("a fit").nats();
    assert!(least >= found.nats() && least < residuals(&m, &d).expect("a replay").nats);
    // Beyond what is believed a number stays at the bound.
    let mut far = truth.clone();
    far.tissue.layers[0].stiffness_n_per_m = 300.0;
    let bound = fit(&m, &data(&far, 0.002), Effort::FULL).expect("a fit");
    near(bound.model.tissue.layers[0].stiffness_n_per_m, 260.0);
}

/// A number whose neighbour cannot be replayed.
#[test]
fn a_column_that_is_not_there_is_nothing() {
    let (m, d) = smooth();
    let at = residuals(&m, &d).expect("a replay");
    let mut t = Tangent::new(&m, &d, &at);
    let first = t.columns[1].clone();
    t.columns[0] = Column::default();
    t.assemble(&m, 2);
    near(t.matrix.at(0, 0), 1.0 / (t.shared[0].sd * t.shared[0].sd));
    assert_eq!((t.matrix.at(1, 0), t.against(&first, 2)[0]), (0.0, 0.0));
    near(t.against(&first, 2)[1], first.dot_all(&first));
    assert!(t.against(&Column::default(), 2).iter().all(|x| *x == 0.0));
}

#[test]
fn a_step_goes_on_to_where_the_parabola_of_its_gain_is_lowest() {
    let (m, d) = smooth();
    let at = residuals(&m, &d).expect("a replay");
    let t = Tangent { slope: vec![2.0, 4.0], ..Tangent::new(&m, &d, &at) };
    // It falls by ten; a step that stands at the lowest place has gained half of that.
    let share = |gained: f64| further(&t, &[1.0, 2.0], gained);
    assert_eq!(share(5.0), None);
    assert_eq!(share(6.1), None);
    near(share(7.5).expect("further"), 2.0);
    near(share(8.5).expect("further"), 10.0 / 3.0);
    assert_eq!([share(9.0), share(10.0), share(12.0)], [Some(4.0); 3]);
}

/// A law that lacks something leaves blocks far off by the thousand. Each counts by a straight line, and the tangent takes
/// it for a square.
#[test]
fn a_fit_among_blocks_far_off_is_at_its_end_after_a_few_steps() {
    let (mut m, _) = smooth();
    m.own = vec![Own::default(); 2];
    let d = data(&m, 0.15);
    m.tissue.layers[0].stiffness_n_per_m = 170.0;
    m.tissue.layers[0].friction_ns_per_m2 = 3600.0;
    let to = |turns: usize| fit(&m, &d, Effort { turns, enough: 1e-6 }).expect("a fit").nats();
    let (end, few) = (to(100), to(4));
    assert!(few - end < 1.0 && to(1) - end > 100.0, "{few} {end} {}", to(1));
}

/// A tangent that was taken across a kink tells the wrong way of one number; the others go on.
#[test]
fn numbers_whose_own_steps_gain_go_on_without_one_whose_tangent_lies() {
    let (mut m, d) = smooth();
    m.tissue.layers[0].stiffness_n_per_m = 190.0;
    m.tissue.layers[0].friction_ns_per_m2 = 3300.0;
    let at = Fit { residuals: residuals(&m, &d).expect("a replay"), model: m.clone() };
    let mut t = Tangent::new(&m, &d, &at.residuals);
    let stiff = t.shared.iter().position(|n| n.role == Role::Stiffness(0)).expect("free");
    t.slope[stiff] *= -1e3;
    let along = step(&m, &d, &t, FIRST_DAMPING, |_| true).expect("a step");
    let left = residuals(&moved(&m, &d, &t, &along, 1.0), &d).expect("a replay");
    assert!(left.nats > at.nats());
    let next = trusting(&at, &d, &t).expect("the others gain");
    assert_eq!(next.tissue.layers[0].stiffness_n_per_m, 190.0);
    assert!(next.tissue.layers[0].friction_ns_per_m2 != 3300.0);
    assert!(residuals(&next, &d).expect("a replay").nats < at.nats() - 1.0);
    // Where it is level nothing is freed, and the fit is the plain one.
    let plain = fit(&m, &d, Effort::FULL).expect("a fit");
    assert!(freed(&plain, &d).is_none());
    let past = fit_past_kinks(&m, &d, Effort::FULL).expect("a fit");
    assert_eq!(past.nats(), plain.nats());
}

#[test]
fn an_instant_moves_by_a_block_and_a_half_at_most() {
    let mut truth = model(1);
    truth.instants = vec![vec![2.513, NEVER]];
    let d = data(&truth, 0.0);
    let mut m = truth.clone();
    m.instants = vec![vec![2.39, NEVER]];
    m.tissue.layers[0].stiffness_n_per_m = 180.0;
    let at = residuals(&m, &d).expect("a replay");
    let t = Tangent::new(&m, &d, &at);
    let next = moved(&m, &d, &t, &step(&m, &d, &t, 1e-4, |_| true).expect("a step"), 1.0);
    let by = next.instants[0][0] - 2.39;
    assert!(by.abs() <= 0.03 + 1e-12, "{by}");
    // Nothing moves where nothing says so.
    assert!(
        step(&m, &d, &Tangent { slope: vec![0.0; t.slope.len()], ..Tangent::new(&m, &d, &at) }, 1e-4, |_| {
            true
        })
        .is_none()
    );
}

#[test]
fn spreads_are_those_of_the_recordings_own_numbers() {
    let (mut m, d) = smooth();
    m.own = [(3e-4, 0.03), (-4e-4, 0.04)]
        .map(|(surface_m, friction)| Own { surface_m, friction, ..Own::default() })
        .to_vec();
    let mut at = residuals(&m, &d).expect("a replay");
    let mut told = m.clone();
    rescatter(&mut told, &mut at);
    near(told.scatter.surface_m, (0.5_f64 * 25e-8).sqrt());
    near(told.scatter.friction, (0.5_f64 * 25e-4).sqrt());
    near(at.nats, nats(&told, &at));
    // Never nothing; as they are where somebody else tells them, or where nobody asks.
    let mut alike = m.clone();
    alike.own = vec![Own::default(); 2];
    rescatter(&mut alike, &mut at);
    assert_eq!((alike.scatter.surface_m, alike.scatter.friction), (1e-6, 1e-4));
    let mut steady = Model { steady: true, ..m.clone() };
    rescatter(&mut steady, &mut at);
    near(at.nats, nats(&steady, &at));
    assert_eq!(
        (steady.scatter.surface_m, steady.scatter.friction),
        (m.scatter.surface_m, m.scatter.friction)
    );
    m.free.own_surface = false;
    m.free.own_friction = false;
    let mut bound = m.clone();
    rescatter(&mut bound, &mut at);
    assert_eq!((bound.scatter.surface_m, bound.scatter.friction), (m.scatter.surface_m, m.scatter.friction));
}

/// Two layers in four recordings: the force shows where the first gives way, nothing shows where the second does.
#[test]
fn a_layer_whose_ruptures_nothing_shows_does_not_say_that_none_scatters() {
    let (m, d) = smooth();
    let at = residuals(&m, &d).expect("a replay");
    let event = |force: f64| Event { force, place_m: -0.01, ruptured: true, step_s: 0.01, ..Event::UNSEEN };
    let told = |events: Vec<Vec<Event>>, steady: bool| {
        let layers = events[0].len();
        let mut at = Residuals { events, ..at.clone() };
        let mut belief = (*m.belief).clone();
        belief.tissue.layers.resize(layers, belief.tissue.layers[0].clone());
        belief.tolerance.resize(layers, 0.3);
        belief.thickness_tolerance.resize(layers, 0.1);
        let mut model = Model { steady, ..Model::base(Arc::new(belief), 4) };
        rescatter(&mut model, &mut at);
        model.scatter.force
    };
    let forces = [-0.2, -0.1, 0.1, 0.2];
    let (first, both): (Vec<_>, Vec<_>) =
        forces.map(|f| (vec![event(f)], vec![event(f), event(1e-6)])).into_iter().unzip();
    let alone = told(first.clone(), true);
    assert!((0.09..0.3).contains(&alone), "{alone}");
    assert_eq!((told(first, false), told(both, true)), (alone, alone));
}

//! Promise: `read(write(x)) == x`, bit for bit. A simulated recording is scored from its file as in memory.

use std::path::Path;

use proptest::prelude::*;
use stylet_record::{JOINTS, ReadOptions, RecordError, Recording, Truth, read_csv_bytes, write_csv};

fn written(
    recording: &Recording,
    truth: Option<&Truth>,
    extra: &[(&str, &[f64])],
) -> Result<Vec<u8>, RecordError> {
    let mut bytes = Vec::new();
    write_csv(recording, truth, extra, &mut bytes)?;
    Ok(bytes)
}

fn bits(recording: &Recording) -> Vec<u64> {
    let columns = [&recording.time_s, &recording.position_m, &recording.force_n, &recording.velocity_mps];
    let numbers = columns.into_iter().flatten().chain(recording.force_virtual_n.iter().flatten());
    numbers.chain(recording.joint_torque_nm.iter().flatten()).map(|value| value.to_bits()).collect()
}

/// Any finite number: denormal, huge, negative zero.
fn finite() -> impl Strategy<Value = f64> {
    use prop::num::f64::{NEGATIVE, NORMAL, POSITIVE, SUBNORMAL, ZERO};
    POSITIVE | NEGATIVE | NORMAL | SUBNORMAL | ZERO
}

fn recordings() -> impl Strategy<Value = Recording> {
    let row = (finite(), finite(), finite(), finite(), finite(), prop::array::uniform7(finite()));
    (prop::collection::vec(row, 2..30), any::<[bool; 3]>()).prop_filter_map(
        "two time stamps",
        |(mut rows, [measured, virtual_force, arm])| {
            rows.sort_by(|a, b| a.0.total_cmp(&b.0));
            rows.dedup_by(|a, b| a.0 == b.0);
            let time_s: Vec<f64> = rows.iter().map(|row| row.0).collect();
            let force_n: Vec<f64> = rows.iter().map(|row| row.2).collect();
            let recording = if measured {
                let position_m = rows.iter().map(|row| row.1).collect();
                Recording::with_velocity(time_s, position_m, rows.iter().map(|row| row.3).collect(), force_n)
            } else {
                // Positions and time stamps with a finite slope.
                let even_s = (0..rows.len()).map(|i| i as f64 * 0.013).collect();
                Recording::new(even_s, rows.iter().map(|row| row.1.sin() * 0.1).collect(), force_n)
            };
            let mut recording = recording.ok()?;
            recording.force_virtual_n = virtual_force.then(|| rows.iter().map(|row| row.4).collect());
            recording.joint_torque_nm = if arm { rows.iter().map(|row| row.5).collect() } else { vec![] };
            Some(recording)
        },
    )
}

fn truth_for(samples: usize) -> Truth {
    Truth {
        tip_force_n: vec![0.25; samples],
        elastic_n: vec![0.125; samples],
        friction_n: vec![0.1; samples],
        tissue_force_n: vec![0.2; samples],
        cumulative_friction_ns_per_m: vec![3.0; samples],
        active_layer: vec![2; samples],
        surface_contact_s: None,
        ruptures: vec![],
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn written_recordings_are_read_back_bit_for_bit(recording in recordings(), with_truth: bool) {
        let truth = truth_for(recording.len());
        let extra = vec![f64::NAN; recording.len()];
        let bytes = written(&recording, with_truth.then_some(&truth), &[("estimate_n", &extra)])?;
        let (again, _) = read_csv_bytes(&bytes, Path::new("written.csv"), &ReadOptions::default())?;
        prop_assert_eq!(bits(&again), bits(&recording));
        prop_assert_eq!(again, recording);
    }
}

#[test]
fn the_header_names_everything_that_was_given() -> Result<(), RecordError> {
    let mut recording =
        Recording::with_velocity(vec![0.0, 0.1], vec![0.0, 1e-7], vec![0.0, 2.5], vec![-0.0, 1.0])?;
    recording.joint_torque_nm = vec![[0.5; JOINTS]; 2];
    let estimate = [f64::NAN, 7.0];
    let text = String::from_utf8(written(&recording, Some(&truth_for(2)), &[("f_enh_n", &estimate)])?);
    assert_eq!(
        text.as_deref(),
        Ok("time_s,position_m,force_n,velocity_mps,joint_torque_1_nm,joint_torque_2_nm,joint_torque_3_nm,\
            joint_torque_4_nm,joint_torque_5_nm,joint_torque_6_nm,joint_torque_7_nm,true_tip_force_n,true_elastic_n,\
            true_friction_n,true_active_layer,f_enh_n\n\
            0.0,0.0,-0.0,0.0,0.5,0.5,0.5,0.5,0.5,0.5,0.5,0.25,0.125,0.1,2,\n\
            0.1,1e-7,1.0,2.5,0.5,0.5,0.5,0.5,0.5,0.5,0.5,0.25,0.125,0.1,2,7.0\n")
    );
    Ok(())
}

#[test]
fn invalid_data_are_not_written() -> Result<(), RecordError> {
    let sound = Recording::new(vec![0.0, 0.1], vec![0.0, 0.1], vec![0.0, 1.0])?;
    let mut torn = sound.clone();
    torn.force_n.pop();
    let mut bytes = Vec::new();
    let refusal = |result: Result<(), RecordError>| result.expect_err("must be refused").to_string();
    assert!(refusal(write_csv(&torn, None, &[], &mut bytes)).contains("force_n has 1 values"));
    assert!(
        refusal(write_csv(&sound, Some(&truth_for(3)), &[], &mut bytes))
            .contains("true_active_layer has 3 values")
    );
    assert!(refusal(write_csv(&sound, None, &[("e", &[1.0])], &mut bytes)).contains("column e has 1 values"));
    for name in ["", "a,b", "force_n", "velocity_mps", "joint_torque_1_nm", "x\n", " x"] {
        let message = refusal(write_csv(&sound, None, &[(name, &[1.0, 2.0])], &mut bytes));
        assert!(message.contains("choose another name"), "{message}");
    }
    assert!(bytes.is_empty());
    Ok(())
}

#[test]
fn a_full_disk_is_reported() -> Result<(), RecordError> {
    struct Full;
    impl std::io::Write for Full {
        fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
            Err(std::io::Error::other("no space left"))
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }
    let recording = Recording::new(vec![0.0, 0.1], vec![0.0, 0.1], vec![0.0, 1.0])?;
    let message = write_csv(&recording, None, &[], Full).expect_err("full").to_string();
    assert!(message.contains("cannot be written (no space left)"), "{message}");
    Ok(())
}

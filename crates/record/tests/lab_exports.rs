//! Promise: tables as instruments and laboratory software write them are read, or refused with what to do; no column is taken silently where
//! name and unit do not decide.

use std::fmt::Write;
use std::path::Path;
use stylet_record::inspect::{InspectOptions, Inspection, Role, inspect_bytes};
use stylet_record::{ReadOptions, RecordError, Recording, read_csv_bytes};

const ROWS: usize = 200;

/// Time (s), position (mm) and force (N) of a row.
fn sample(k: usize) -> [f64; 3] {
    let t = 0.01 * k as f64;
    [t, 10.0 * t - 2.0, f64::max(0.0, 1.5 * (t - 0.2))]
}

/// A head and rows.
fn text(head: &str, row: impl Fn(usize, [f64; 3]) -> String) -> String {
    let mut out = head.to_owned();
    for k in 0..ROWS {
        let _ = writeln!(out, "{}", row(k, sample(k)));
    }
    out
}

fn read(text: &str, options: &ReadOptions) -> Result<Recording, RecordError> {
    read_csv_bytes(text.as_bytes(), Path::new("log.csv"), options).map(|(recording, _)| recording)
}

fn inspected(text: &str) -> Inspection {
    inspect_bytes(text.as_bytes(), Path::new("log.csv"), &InspectOptions::default()).expect("a table")
}

/// Reads with the map that the inspection proposes.
fn read_as_proposed(text: &str) -> Recording {
    let options = ReadOptions { columns: Some(inspected(text).map), repair: false };
    read(text, &options).expect("the proposed map fits")
}

fn assert_is_the_insertion(r: &Recording) {
    assert_eq!(r.len(), ROWS);
    for k in 0..ROWS {
        let [t, z, f] = sample(k);
        let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
        assert!(near(r.time_s[k] - r.time_s[0], t), "row {k}: {}", r.time_s[k]);
        assert!(near(r.position_m[k], 1e-3 * z) && near(r.force_n[k], f), "row {k}");
    }
}

fn refusal(text: &str) -> String {
    read(text, &ReadOptions::default()).expect_err("a refusal").to_string()
}

#[test]
fn a_labview_measurement_is_read_with_the_map_of_its_inspection() {
    let head = "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDate\t2023/11/14\nTime\t14:03:11.12\n***End_of_Header***\t\n\t\n\
                Channels\t2\t\t\nSamples\t200\t200\t\nDate\t2023/11/14\t2023/11/14\t\nTime\t14:03:11.12\t14:03:11.12\t\n\
                Y_Unit_Label\tmm\tN\t\nX0\t0.0E+0\t0.0E+0\t\nDelta_X\t0.01\t0.01\t\n***End_of_Header***\t\t\t\n\
                X_Value\tStage\tLoad cell\tComment\n";
    let text = text(head, |_, [t, z, f]| format!("{t}\t{z}\t{f}"));
    assert_is_the_insertion(&read_as_proposed(&text));
}

#[test]
fn a_remark_behind_the_values_may_be_missing() {
    let rows = |remark: &'static str| {
        text("Time [s],Force [N],Position [mm],Event\n", move |k, [t, z, f]| {
            if k == 0 { format!("{t},{f},{z},{remark}") } else { format!("{t},{f},{z}") }
        })
    };
    for remark in ["start of the test", ""] {
        assert_is_the_insertion(&read(&rows(remark), &ReadOptions::default()).expect("read"));
    }
    // A value in the middle of a recording that is cut off is no missing remark.
    let cut = rows("").replacen("0.5,", "0.5\n0.501,", 1);
    assert!(refusal(&cut).contains("fields"), "{}", refusal(&cut));
}

#[test]
fn durations_with_their_unit_are_times() {
    let text = text("Time,Position_mm,Force_N\n", |_, [t, z, f]| format!("{t} sec,{z},{f}"));
    assert_is_the_insertion(&read(&text, &ReadOptions::default()).expect("read"));
}

#[test]
fn of_a_date_with_whole_seconds_and_a_time_the_time_is_taken() {
    for head in [
        "Date/Time;Elapsed Time (s);Load (N);Position (mm)\n",
        "Date/Time;Elapsed Time;Load;Position\n;s;N;mm\n",
    ] {
        let text = text(head, |_, [t, z, f]| format!("2023-11-14 13:59:{:02};{t};{f};{z}", t as u32));
        assert_is_the_insertion(&read(&text, &ReadOptions::default()).expect(head));
    }
    // One repeated stamp is no reason for another column.
    let rows = text("Time [s],Force [N],Position [mm],Arrival time [ms]\n", |k, [t, z, f]| {
        format!("{},{f},{z},{}", if k == 100 { t - 0.01 } else { t }, 1e3 * t)
    });
    assert!(refusal(&rows).contains("repeats"), "{}", refusal(&rows));
}

#[test]
fn text_in_other_columns_of_the_first_rows_loses_no_row() {
    for mark in ["---", "#DIV/0!", "start"] {
        let head = "Operator;A. B.\n\nTime [s];Velocity [mm/s];Position [mm];Force [N]\n";
        let text = text(
            head,
            |k, [t, z, f]| if k < 3 { format!("{t};{mark};{z};{f}") } else { format!("{t};10;{z};{f}") },
        );
        assert_is_the_insertion(&read(&text, &ReadOptions::default()).expect(mark));
    }
    // A line of numbers above the names.
    let head = "Sample;7\n0.1;0.2;0.3;0.4;0.5;0.6\nTime [s];Position [mm];Force [N]\n";
    let text = text(head, |_, [t, z, f]| format!("{t};{z};{f}"));
    assert_is_the_insertion(&read(&text, &ReadOptions::default()).expect("read"));
}

#[test]
fn a_row_without_a_value_in_front_is_refused() {
    let text = text("Index,Time [s],Position [mm],Force [N],Fx [N]\n", |_, [t, z, f]| {
        format!("{t},{z},{f},{}", 0.1 * f)
    });
    assert!(refusal(&text).contains("fields"), "{}", refusal(&text));
}

#[test]
fn a_unit_in_the_preamble_counts_less_than_one_in_a_name() {
    for line in ["Unit;kN", "Force unit;N", "Test unit;1", "Units;ms;kN;cm"] {
        let head = format!("{line}\n\nTime (s);Force 1 (N);Position (mm)\n");
        let text = text(&head, |_, [t, z, f]| format!("{t};{f};{z}"));
        assert_is_the_insertion(&read(&text, &ReadOptions::default()).expect(line));
    }
}

#[test]
fn a_measured_position_is_preferred_to_its_set_point() {
    let text = text("Time (s),Position setpoint (mm),Position (mm),Force (N)\n", |_, [t, z, f]| {
        format!("{t},{},{z},{f}", z + 0.4)
    });
    assert_is_the_insertion(&read(&text, &ReadOptions::default()).expect("read"));
}

#[test]
fn names_of_matlab_and_r_have_their_units() {
    for head in ["Time_s_,Position_mm_,Force_N_\n", "Time..s.,Position..mm.,Force..N.\n"] {
        let text = text(head, |_, [t, z, f]| format!("{t},{z},{f}"));
        assert_is_the_insertion(&read(&text, &ReadOptions::default()).expect(head));
    }
}

#[test]
fn a_column_that_its_name_alone_does_not_decide_is_asked_for() {
    let cases = [
        // The robot moves along x; z rests.
        ("t_s,x_mm,z_mm,force_n\n", ["x_mm", "z_mm"]),
        // The clamp holds with a constant force.
        ("t_s,Grip force (N),Depth (mm),Thrust (N)\n", ["Grip force (N)", "Thrust (N)"]),
        ("t_s,Crosshead (mm),LVDT (mm),Force (N)\n", ["Crosshead (mm)", "LVDT (mm)"]),
        (
            "Zeit (s);Standardweg (mm);Traversenweg (mm);Standardkraft (N)\n",
            ["Standardweg (mm)", "Traversenweg (mm)"],
        ),
    ];
    for (head, names) in cases {
        let text = text(head, |k, [t, z, f]| match head.as_bytes()[4] {
            b'x' => format!("{t},{z},{},{f}", 80.0 + 1e-3 * (k % 3) as f64),
            b'G' => format!("{t},{},{z},{f}", 8.0 + 1e-3 * (k % 3) as f64),
            b'C' => format!("{t},{},{z},{f}", 1.02 * z),
            _ => format!("{t};{z};{};{f}", 1.02 * z + 40.0),
        });
        let message = refusal(&text);
        assert!(
            message.contains("several columns") && names.iter().all(|n| message.contains(n)),
            "{message}"
        );
    }
    // Crosstalk in the other components of force and position decides nothing.
    let text = text("t_s,x_mm,y_mm,z_mm,Fx_N,Fy_N,Fz_N\n", |k, [t, z, f]| {
        let small = 1e-3 * (k % 5) as f64;
        format!("{t},{small},{small},{z},{},{},{f}", 0.2 * f, 0.1 * f)
    });
    assert_is_the_insertion(&read(&text, &ReadOptions::default()).expect("read"));
}

#[cfg(feature = "formats")]
#[test]
fn a_column_of_a_parquet_file_that_its_name_alone_does_not_decide_is_asked_for() {
    let column = |name: &str, of: &dyn Fn([f64; 3]) -> f64| {
        (name.to_owned(), (0..ROWS).map(|k| of(sample(k))).collect::<Vec<f64>>())
    };
    let file = |rest_mm: f64| {
        let columns = [
            column("t_s", &|[t, ..]| t),
            column("x_mm", &|[_, z, _]| rest_mm * z),
            column("z_mm", &|[_, z, _]| z),
            column("force_n", &|[.., f]| f),
        ];
        stylet_record::file_formats::columns_to_parquet(&columns, Path::new("log.parquet")).expect("written")
    };
    let read = |bytes: &[u8]| {
        read_csv_bytes(bytes, Path::new("log.parquet"), &ReadOptions::default()).map(|(r, _)| r)
    };
    assert_is_the_insertion(&read(&file(0.01)).expect("a side motion decides nothing"));
    let message = read(&file(2.0)).expect_err("a refusal").to_string();
    assert!(message.contains("several columns") && message.contains("x_mm"), "{message}");
    let found = inspect_bytes(&file(2.0), Path::new("log.parquet"), &InspectOptions::default());
    assert!(!found.expect("a table").is_readable());
}

#[test]
fn position_and_force_with_clocks_of_their_own_are_refused_if_these_differ() {
    let head = "Time_Force [s],Force [N],Time_Position [s],Position [mm]\n";
    let same = text(head, |_, [t, z, f]| format!("{t},{f},{t},{z}"));
    assert_is_the_insertion(&read(&same, &ReadOptions::default()).expect("read"));
    let scaled = text("Time [s],Position [mm],Time [ms],Force [N]\n", |_, [t, z, f]| {
        format!("{t},{z},{},{f}", 1e3 * t)
    });
    assert_is_the_insertion(&read(&scaled, &ReadOptions::default()).expect("read"));
    let latency = text("time_s,position_m,latency_ms,force_n\n", |k, [t, z, f]| {
        format!("{t},{},{},{f}", 1e-3 * z, k % 4)
    });
    assert_is_the_insertion(&read(&latency, &ReadOptions::default()).expect("read"));
    let other = text(head, |_, [t, z, f]| format!("{t},{f},{},{z}", t + 0.5));
    let message = refusal(&other);
    assert!(message.contains("Time_Position [s]") && message.contains("file of its own"), "{message}");
    let found = inspected(&other);
    assert!(!found.is_readable());
    let proposed = ReadOptions { columns: Some(found.map), repair: false };
    assert!(read(&other, &proposed).is_err());
}

#[test]
fn an_inspection_proposes_no_column_of_another_quantity() {
    let text = text("time_s,position_mm,current_mA,F/T Sequence\n", |k, [t, z, f]| {
        format!("{t},{z},{},{}", 100.0 * f + (k % 7) as f64, 4_300_000_000_u64 + k as u64)
    });
    let found = inspected(&text);
    assert!(found.candidate(Role::Position).is_some() && found.candidate(Role::Force).is_none());
    assert!(found.obstacles().any(|o| o.message.contains("no column can be the force")));
}

#[test]
fn of_recordings_side_by_side_the_inspection_proposes_the_first() {
    let text =
        text("Force (N),Distance (mm),Time (sec),Force (N),Distance (mm),Time (sec)\n", |_, [t, z, f]| {
            format!("{f},{z},{t},{},{},{t}", 2.0 * f, 3.0 * z)
        });
    assert_is_the_insertion(&read_as_proposed(&text));
}

#[test]
fn of_several_forces_the_inspection_proposes_the_largest() {
    let text = text("time_s,depth_mm,Axial force [N],Lateral force [N]\n", |k, [t, z, f]| {
        format!("{t},{z},{f},{}", 0.05 * f + 0.02 * (k % 2) as f64)
    });
    assert_is_the_insertion(&read_as_proposed(&text));
}

#[test]
fn statistics_at_the_end_are_left_out_with_a_note() {
    let rows = text("Zeit (s);Weg (mm);Kraft (N)\n", |_, [t, z, f]| format!("{t};{z};{f}"));
    for end in ["\nMaximum;22,004;2,066\nMittelwert;;0,486\n", "END OF DATA\n", "Maximum;1\n"] {
        let (recording, notes) =
            read_csv_bytes(format!("{rows}{end}").as_bytes(), Path::new("log.csv"), &ReadOptions::default())
                .expect(end);
        assert_is_the_insertion(&recording);
        assert!(
            notes.iter().any(|n| n.message.contains("at the end")
                && n.lines == [if end.starts_with('\n') { 203 } else { 202 }]),
            "{notes:?}"
        );
    }
    // Text between rows is refused, and so is a text of many lines.
    let between = rows.replacen("\n0.5;", "\npause;;\n0.5;", 1);
    assert!(refusal(&between).contains("\"pause\" is not a number"), "{}", refusal(&between));
    let many = format!("{rows}{}", "off;;\n".repeat(60));
    assert!(refusal(&many).contains("\"off\" is not a number"), "{}", refusal(&many));
}

#[test]
fn marks_of_meters_and_spreadsheets_are_missing_values() {
    for mark in ["---", "OL", "#DIV/0!", "#NV"] {
        let text = text("Time [s],Position [mm],Force [N]\n", |k, [t, z, f]| match k {
            50 => format!("{t},{z},{mark}"),
            _ => format!("{t},{z},{f}"),
        });
        assert_eq!(read(&text, &ReadOptions::default()).expect(mark).len(), ROWS - 1);
    }
}

/// 200 rows from one second before midnight; dates of a spreadsheet as days.
#[test]
fn times_of_day_pass_midnight_and_days_are_proposed_for_the_numbers_of_a_spreadsheet() {
    let clock = |s: f64| {
        let s = if s < 0.0 { s + 86_400.0 } else { s };
        format!("{:02}:{:02}:{:06.3}", (s / 3600.0) as u32, (s / 60.0) as u32 % 60, s % 60.0)
    };
    let midnight =
        text("Time,Position [mm],Force [N]\n", |_, [t, z, f]| format!("{},{z},{f}", clock(t - 1.0)));
    assert_is_the_insertion(&read(&midnight, &ReadOptions::default()).expect("read"));
    let days = text("Time,Position [mm],Force [N]\n", |_, [t, z, f]| {
        format!("{:.12},{z},{f}", 45_244.585_543_981 + t / 86_400.0)
    });
    let r = read_as_proposed(&days);
    assert!((r.time_s[ROWS - 1] - r.time_s[0] - sample(ROWS - 1)[0]).abs() < 1e-4);
}

#[test]
fn the_position_of_a_pose_in_matrix_form_is_its_translation() {
    for by_columns in [true, false] {
        let elements = |z: f64| {
            let rows = [
                [1.0, 0.0, 0.0, 0.3],
                [0.0, -1.0, 0.0, 0.1],
                [0.0, 0.0, -1.0, 1e-3 * z],
                [0.0, 0.0, 0.0, 1.0],
            ];
            (0..16).map(move |k| if by_columns { rows[k % 4][k / 4] } else { rows[k / 4][k % 4] })
        };
        let head: Vec<String> = (0..16).map(|k| format!("O_T_EE[{k}]")).collect();
        let text = text(&format!("time,{},force\n", head.join(",")), |_, [t, z, f]| {
            let pose: Vec<String> = elements(z).map(|x| x.to_string()).collect();
            format!("{t},{},{f}", pose.join(","))
        });
        assert_is_the_insertion(&read_as_proposed(&text));
    }
}

#[test]
fn an_inspection_reads_the_file_and_reverses_signs_that_run_the_other_way() {
    let folder = std::env::temp_dir().join(format!("stylet-signs-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    let path = folder.join("log.csv");
    for (reversed, signs) in
        [([1.0, 1.0], [1, 1]), ([-1.0, 1.0], [-1, 1]), ([1.0, -1.0], [1, -1]), ([-1.0; 2], [-1; 2])]
    {
        let rows = text("time_s,position_mm,force_n\n", |k, [t, z, f]| {
            let noise = 0.01 * ((k * 7919) % 13) as f64 / 13.0;
            format!("{t},{},{}", reversed[0] * z, reversed[1] * f + noise)
        });
        std::fs::write(&path, rows).expect("written");
        let found = stylet_record::inspect_and_read(&path, &InspectOptions::default()).expect("a table");
        assert_eq!(found.is_readable(), signs == [1, 1], "{signs:?}: {:?}", found.findings);
        let sign = |scale: Option<f64>| scale.map_or(1, |x| x.signum() as i32);
        assert_eq!([sign(found.map.position.scale), sign(found.map.force.scale)], signs);
        let options = InspectOptions { columns: Some(found.map) };
        assert!(stylet_record::inspect_and_read(&path, &options).expect("a table").is_readable());
    }
    // Millimetres under a name in metres: the proposed map has the unit that the magnitude suggests.
    let inspected = |rows: String| {
        std::fs::write(&path, rows).expect("written");
        stylet_record::inspect_and_read(&path, &InspectOptions::default()).expect("a table")
    };
    let found = inspected(text("time_s,position_m,force_n\n", |k, [t, z, f]| {
        format!("{t},{},{}", 20.0 * z, f + 1e-3 * (k % 7) as f64)
    }));
    assert!(!found.is_readable() && found.map_needed && found.map.position.scale == Some(1e-3), "{found:?}");
    // A retraction alone is no insertion with another sign.
    let found = inspected(text("time_s,position_mm,force_n\n", |k, [t, z, _]| {
        format!("{t},{},{}", 20.0 - z, -1.5 * (1.0 - t / 2.0) + 1e-2 * ((k * 7919) % 13) as f64 / 13.0)
    }));
    assert!(!found.is_readable() && !found.map_needed, "{found:?}");
    std::fs::remove_dir_all(&folder).expect("removed");
}

//! Promise: invalid input is refused with a message that names file, line, column and remedy.

use std::path::Path;

use stylet_record::{Column, ColumnMap, ReadOptions, RecordError, read_csv, read_csv_bytes};

const HEADER: &str = "time_s,position_m,force_n\n";

fn refusal_with(bytes: &[u8], options: &ReadOptions) -> RecordError {
    read_csv_bytes(bytes, Path::new("logs/run7.csv"), options).map(|_| ()).expect_err("must be refused")
}

fn refusal(bytes: &[u8]) -> RecordError {
    refusal_with(bytes, &ReadOptions::default())
}

/// The message contains the file and all the words.
#[track_caller]
fn contains_all(error: &RecordError, words: &[&str]) {
    let message = error.to_string();
    for word in ["logs/run7.csv:"].iter().chain(words) {
        assert!(message.contains(word), "{word:?} is missing in: {message}");
    }
}

#[test]
fn a_missing_file_is_refused() {
    let error = read_csv("no/such/recording.csv", &ReadOptions::default()).map(|_| ()).expect_err("no file");
    let message = error.to_string();
    assert!(matches!(error, RecordError::NoSuchFile { .. }), "{message}");
    assert!(message.contains("no/such/recording.csv: no such file; check the path"), "{message}");
}

#[test]
fn a_folder_is_not_a_recording() {
    let folder = env!("CARGO_MANIFEST_DIR");
    let error = read_csv(folder, &ReadOptions::default()).map(|_| ()).expect_err("a folder");
    let message = error.to_string();
    assert!(matches!(error, RecordError::IsDirectory { .. }), "{message}");
    assert!(message.contains(folder) && message.contains("name one CSV file inside it"), "{message}");
}

#[test]
fn an_empty_file_is_refused_with_what_a_recording_needs() {
    for empty in [&b""[..], b"\n\r\n  \n", b"\xEF\xBB\xBF"] {
        let error = refusal(empty);
        assert!(matches!(error, RecordError::EmptyFile { .. }));
        contains_all(&error, &["the file is empty", "a header line and at least 2 rows"]);
    }
}

#[test]
fn a_header_without_rows_is_named_with_its_line() {
    let error = refusal(b"\n\ntime_s,position_m,force_n\n\n");
    assert!(matches!(error, RecordError::HeaderOnly { line: 3, .. }));
    contains_all(&error, &["line 3", "no row follows", "at least 2 rows"]);
}

#[test]
fn a_single_sample_has_no_velocity() {
    let error = refusal(b"time_s,position_m,force_n\n0,0,0\n");
    contains_all(&error, &["1 sample(s) by line 2", "at least 2 samples"]);
    let repair = ReadOptions { repair: true, ..ReadOptions::default() };
    let error = refusal_with(b"time_s,position_m,force_n\n0,0,0\n0,0,0\n0,0,0\n", &repair);
    assert!(
        matches!(error, RecordError::RepairTooMuch { .. } | RecordError::TooFewSamples { .. }),
        "{error}"
    );
}

#[test]
fn a_binary_file_is_refused_with_the_byte_where_text_ends() {
    // Bytes that are not UTF-8 are text in a Windows code page.
    contains_all(&refusal(b"time_s,position_m,force_n\n0,0,\xC3\x28\n"), &["line 2", "is not a number"]);
    contains_all(
        &refusal(b"time_s,position_m,force_n\n0,0,\0\n"),
        &["a zero byte at byte 30 (line 2)", "export the data as CSV"],
    );
    contains_all(&refusal(b"\xFF\xFEt\0i\0m\0e\0"), &["line 1", "no column \"time_s\""]);
    contains_all(&refusal(b"PK\x03\x04rest"), &["a spreadsheet"]);
}

#[test]
fn a_missing_column_lists_those_that_exist_and_the_closest_spelling() {
    let error = refusal(b"time_s,posision_m,force_n\n0,0,0\n1,1,1\n");
    contains_all(
        &error,
        &[
            "line 1",
            "no column \"position_m\" (tip position in metres)",
            "it has \"time_s\", \"posision_m\", \"force_n\"",
            "the closest is \"posision_m\"",
            "rename the column or give a column map",
        ],
    );
}

#[test]
fn a_column_of_the_map_that_the_file_lacks_is_named_with_its_quantity() {
    let map = ColumnMap {
        time: Column::scaled("time", 1e-6),
        position: Column::scaled("pz", 1e-3),
        force: Column::si("Fz"),
        ..ColumnMap::default()
    };
    let options = ReadOptions { columns: Some(map), repair: false };
    let error = refusal_with(b"time;pz;fz\n0;0;0\n1;1;1\n", &options);
    contains_all(
        &error,
        &["\"Fz\" (the column map's force)", "\"time\", \"pz\", \"fz\"", "the closest is \"fz\""],
    );
}

#[test]
fn six_joint_torques_are_one_too_few() {
    let text = "time_s,position_m,force_n,joint_torque_1_nm,joint_torque_2_nm\n0,0,0,1,1\n1,1,1,1,1\n";
    contains_all(&refusal(text.as_bytes()), &["\"joint_torque_3_nm\"", "all seven joints or none"]);
}

#[test]
fn two_columns_of_one_name_are_ambiguous() {
    let error = refusal(b"time_s,position_m,force_n,force_n\n0,0,0,0\n1,1,1,1\n");
    contains_all(&error, &["line 1", "\"force_n\" twice", "rename"]);
}

#[test]
fn text_in_a_number_is_shown_with_line_column_and_remedy() {
    let row = |field: &str| refusal(format!("{HEADER}0,0,0\n\n1,{field},0\n").as_bytes());
    contains_all(
        &row("fast"),
        &["line 4, column \"position_m\"", "\"fast\" is not a number", "write a decimal number such as"],
    );
    contains_all(
        &row(""),
        &["line 4, column \"position_m\"", "an empty field", "fill in the value or remove the row"],
    );
    contains_all(&row("1_000"), &["line 4", "\"1_000\" is not a number"]);
    contains_all(&row(&"x".repeat(5000)), &["xxx\"... is not a number"]);
    let mixed = refusal(b"time_s;position_m;force_n\n0.01;0.5;0.5\n0.02;0,25;0.5\n");
    contains_all(&mixed, &["line 3, column \"position_m\"", "\"0,25\"", "decimal point and comma are mixed"]);
}

#[test]
fn numbers_that_are_not_finite_are_refused() {
    for text in ["NaN", "nan", "inf", "-inf", "Infinity", "1e999"] {
        let error = refusal(format!("{HEADER}0,0,0\r\n1,0,{text}\r\n").as_bytes());
        assert!(matches!(error, RecordError::NotFinite { line: 3, .. }), "{error}");
        contains_all(&error, &["line 3, column \"force_n\"", text, "remove the row or correct the value"]);
    }
    let huge = ColumnMap { force: Column::scaled("force_n", 1e300), ..ColumnMap::default() };
    let error = refusal_with(
        b"time_s,position_m,force_n\n0,0,1e300\n1,1,1\n",
        &ReadOptions { columns: Some(huge), repair: false },
    );
    contains_all(&error, &["line 2", "1e300", "the column map's scale"]);
}

#[test]
fn a_row_cut_short_or_too_long_is_named_with_both_counts() {
    let error = refusal(b"time_s,position_m,force_n\n0,0,0\n1,0.0\n");
    contains_all(&error, &["line 3", "the row has 2 fields, the header has 3", "complete or remove the row"]);
    let error = refusal(b"time_s,position_m,force_n\n0,0,0\n1,0,0,0");
    contains_all(&error, &["line 3", "the row has 4 fields"]);
}

#[test]
fn an_open_quotation_mark_is_reported_and_not_the_end_of_the_data() {
    let error = refusal(b"time_s,position_m,force_n\n0,0,0\n1,\"0,0\n2,0,0\n3,0,0\n");
    contains_all(&error, &["line 3", "complete or remove the row"]);
}

#[test]
fn time_that_runs_backward_is_named_with_both_lines() {
    let error = refusal(b"time_s,position_m,force_n\n0,0,0\n0.2,0,0\n\n0.1,0,0\n");
    assert!(matches!(error, RecordError::BackwardTime { line: 5, previous_line: 3, .. }), "{error}");
    contains_all(&error, &["line 5", "0.1 s after 0.2 s on line 3", "--repair"]);
}

#[test]
fn a_repeated_time_stamp_is_named_with_both_lines() {
    let more: String = (1..200).map(|k| format!("{},0,0\r\n", 0.2 + f64::from(k))).collect();
    let error =
        refusal(format!("time_s,position_m,force_n\r\n0,0,0\r\n0.2,0,0\r\n0.2,0,0\r\n{more}").as_bytes());
    assert!(matches!(error, RecordError::RepeatedTime { line: 4, previous_line: 3, .. }), "{error}");
    contains_all(&error, &["line 4", "repeats that of line 3", "--repair"]);
}

#[test]
fn a_scale_of_zero_is_refused_before_the_file_is_read() {
    let map = ColumnMap { position: Column::scaled("pz", 0.0), ..ColumnMap::default() };
    let message = refusal_with(b"", &ReadOptions { columns: Some(map), repair: false }).to_string();
    assert!(
        message.contains("position.scale = 0 for the column \"pz\"; it must be finite and not zero"),
        "{message}"
    );
}

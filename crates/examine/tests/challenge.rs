//! Promise: a challenge holds everything that an entrant needs and nothing of the truth, and answers from outside are judged like
//! any engine's.

use stylet_examine::{Hide, Plan, challenge_export};

#[test]
fn a_challenge_is_written_without_the_truth_and_answers_to_it_are_scored() {
    let folder = std::env::temp_dir().join(format!("stylet-challenge-{}", std::process::id()));
    let key = challenge_export::key_path(&folder);
    let plan = Plan { hide: vec![Hide::Clean, Hide::One], cases: 4, seed: 5, ..Plan::default() };
    assert_eq!(challenge_export::export(&plan, &folder).expect("a challenge"), 4);
    let text = std::fs::read_to_string(folder.join("cases/0001/assumed.ron")).expect("assumed.ron");
    assert!(text.contains("stiffness_n_per_m") && !text.contains("effects: ["), "{text}");
    let csv = std::fs::read_to_string(folder.join("cases/0001/1.csv")).expect("1.csv");
    assert!(csv.starts_with("time_s,position_m,force_n\n"));
    assert!(std::fs::read_to_string(folder.join("names.txt")).expect("names").contains("coulomb_friction"));
    // No file reveals the case behind a number.
    for entry in std::fs::read_dir(&folder).expect("folder") {
        let name = entry.expect("entry").file_name().into_string().expect("a name");
        assert!(["README.md", "names.txt", "cases"].contains(&name.as_str()), "{name}");
    }

    let answers = folder.join("answers.json");
    std::fs::write(
        &answers,
        r#"{"0001":{"verdict":"none"},"0002":{"verdict":"none"},"0003":{"verdict":"none"}}"#,
    )
    .expect("answers");
    let outcomes = challenge_export::score_answers(&folder, &answers).expect("judged");
    assert_eq!(outcomes.len(), 4);
    assert_eq!(outcomes.iter().filter(|o| o.failed.is_some()).count(), 1);
    for o in outcomes.iter().filter(|o| o.failed.is_none() && o.id.hide == Hide::Clean) {
        assert!(o.score.correct);
    }

    std::fs::write(&answers, r#"{"0007":{"verdict":"none"}}"#).expect("answers");
    let error = challenge_export::score_answers(&folder, &answers).expect_err("no such case").to_string();
    assert!(error.contains("0007") && error.contains("\"0004\""), "{error}");
    assert!(challenge_export::export(&plan, &folder).is_err());
    let _ = std::fs::remove_dir_all(&folder);
    let _ = std::fs::remove_file(key);
}

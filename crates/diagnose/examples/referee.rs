//! The diagnosis in the referee's worlds. Arguments: wrong (comma list), grade, hide (comma list), size, cases, seed [, loud].
use stylet_diagnose::{Evidence, Options, diagnose};
use stylet_examine::{Answer, Grade, Hide, Plan, Question, Size, World, Wrong, run, table};
use stylet_scenario::Scenario;

fn answer(question: &Question) -> Result<Answer, String> {
    let scenario = Scenario::parse(&question.name, &question.believed_ron).map_err(|e| e.to_string())?;
    let evidence: Vec<Evidence> = question
        .recordings
        .iter()
        .map(|r| Evidence { name: r.name.clone(), recording: r.recording.clone(), notes: Vec::new() })
        .collect();
    let examined = diagnose(&scenario, &evidence, &Options::default(), |_| {}).map_err(|e| e.to_string())?;
    let json = serde_json::to_string(&examined.diagnosis).map_err(|e| e.to_string())?;
    Answer::from_json(&json).map_err(|e| e.to_string())
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let list = |k: usize| args[k].split(',').map(str::to_owned).collect::<Vec<_>>();
    let plan = Plan {
        world: if std::env::var("RICH").is_ok() { World::Rich } else { World::Plain },
        wrong: list(0).iter().map(|w| serde_json::from_str::<Wrong>(&format!("\"{w}\"")).expect("wrong")).collect(),
        grades: vec![serde_json::from_str::<Grade>(&format!("\"{}\"", args[1])).expect("grade")],
        hide: list(2).iter().map(|w| serde_json::from_str::<Hide>(&format!("\"{w}\"")).expect("hide")).collect(),
        size: serde_json::from_str::<Size>(&format!("\"{}\"", args[3])).expect("size"),
        cases: args[4].parse().expect("cases"),
        seed: args[5].parse().expect("seed"),
        ..Plan::default()
    };
    let outcomes = run(&plan.cases(), None, &answer, &|_, _| {}).expect("run");
    println!("{}", table::text(&outcomes));
    for o in &outcomes {
        if !o.worth.right || args.len() > 6 {
            println!("{:?} hidden {:?} {:?} sd {:?} -> {:?} {:?} {:.2} s", o.id, o.hidden, o.values, o.strength_sd, o.verdict, o.named, o.seconds);
        }
    }
    let mut s: Vec<f64> = outcomes.iter().map(|o| o.seconds).collect();
    s.sort_by(f64::total_cmp);
    println!("seconds median {:.2} p90 {:.2}", s[s.len() / 2], s[s.len() * 9 / 10]);
}

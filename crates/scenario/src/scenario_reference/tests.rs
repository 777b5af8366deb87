use super::*;

#[test]
fn every_example_is_accepted_and_has_every_field_of_its_section() {
    assert!(sections().len() > 20);
    for section in sections() {
        let text = scenario_with(&section.example);
        let parsed = Scenario::parse(&section.title, &text);
        assert!(parsed.is_ok(), "{}: {text}", section.title);
        for (name, ..) in &section.fields {
            let path = format!("{}{name}", section.prefix);
            assert!(value_at(&text, &path).is_some(), "`{path}` is missing in the example");
        }
    }
}

#[test]
fn every_field_of_a_resolved_scenario_is_documented() {
    let all = sections();
    let known: Vec<String> = all
        .iter()
        .flat_map(|s| s.fields.iter().map(|(name, ..)| format!("{}{name}", s.prefix)))
        .map(|path| {
            path.split('/')
                .enumerate()
                .map(|(i, p)| if i == 0 { p } else { p.find('.').map_or("", |d| &p[d..]) })
                .collect()
        })
        .collect();
    for section in &all {
        let scenario = Scenario::parse("x", &scenario_with(&section.example)).expect("accepted");
        let resolved = scenario.to_ron().expect("it can be written");
        for entry in &RonOutline::new(&resolved).entries {
            let path = entry
                .path
                .replace("[0]", "[]")
                .replace("[1]", "[]")
                .replace("[2]", "[]")
                .replace("[3]", "[]");
            let leaf = !entry.path.is_empty() && !path.starts_with("effects[]") && !path.ends_with(']');
            assert!(
                !leaf || known.iter().any(|k| path.starts_with(k.as_str()) || k.starts_with(&path)),
                "`{path}`"
            );
        }
    }
}

#[test]
fn every_effect_line_is_accepted() {
    for info in all_effects() {
        let line = effect_line(info);
        let text = scenario_with(&format!("effects: [{line}],"));
        let scenario = Scenario::parse(info.id, &text);
        // `boundary_shift` needs a second layer.
        assert!(info.id == "boundary_shift" || scenario.is_ok(), "{text}\n{scenario:?}");
        assert!(line.ends_with("),"), "{line}");
    }
}

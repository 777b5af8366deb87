//! The protocols of the claims, written before the runs: `claims/*.md`.

/// A parsed protocol.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Protocol {
    /// `b1`.
    pub id: String,
    /// The claim in one line.
    pub title: String,
    /// The sections: heading and text.
    pub sections: Vec<(String, String)>,
}

impl Protocol {
    /// Reads a file of `claims/`: `# id · title`, then sections under `## heading`.
    #[must_use]
    pub fn read(text: &str) -> Self {
        let mut lines = text.lines();
        let head = lines.next().unwrap_or_default().trim_start_matches("# ");
        let (id, title) = head.split_once(" · ").unwrap_or((head, ""));
        let mut sections: Vec<(String, String)> = Vec::new();
        for line in lines {
            if let Some(heading) = line.strip_prefix("## ") {
                sections.push((heading.to_owned(), String::new()));
            } else if let Some((_, text)) = sections.last_mut() {
                text.push_str(line);
                text.push('\n');
            }
        }
        for (_, text) in &mut sections {
            *text = text.trim().to_owned();
        }
        Self { id: id.to_owned(), title: title.to_owned(), sections }
    }

    /// The text of a section; empty without it.
    #[must_use]
    pub fn section(&self, heading: &str) -> &str {
        self.sections.iter().find(|(h, _)| h == heading).map_or("", |(_, text)| text)
    }

    /// The items of a list; empty for `none`.
    #[must_use]
    pub fn list(&self, heading: &str) -> Vec<&str> {
        self.section(heading).lines().filter_map(|l| l.strip_prefix("- ")).collect()
    }
}

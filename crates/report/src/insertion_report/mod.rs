//! The report of one insertion, simulated or measured.
//!
//! The caller fills a [`RunReport`]. What does not exist stays empty (`Vec`) or `None`; its chart, column or tile is then left
//! out. All columns of samples are as long as [`RunReport::time_s`].

mod estimate_charts;
mod model;
mod result_tables;
mod scorecard;
mod summary_figure;
mod time_charts;

pub use model::{
    Combination, Detection, ForceTrace, LayerEstimate, Provenance, RunReport, RuptureScore, Score, StateSpan,
    TrueLayer, TrueRupture, Truth,
};

use crate::page_model::{Page, Section};

impl RunReport {
    /// Lays the report out: score first, then the charts, the tables, and the resolved scenario.
    #[must_use]
    pub fn to_page(&self) -> Page {
        let mut page = Page::new(&self.title).subtitle(&self.source);
        let facts = &self.provenance;
        let seed = facts.seed.map(|seed| seed.to_string()).unwrap_or_default();
        for (name, value) in
            [("seed", &seed), ("version", &facts.version), ("hash", &facts.hash), ("repeat", &facts.command)]
        {
            if !value.is_empty() {
                page = page.fact(name, value);
            }
        }
        page.section(scorecard::section(self))
            .section(time_charts::force_section(self))
            .section(estimate_charts::section(self))
            .section(time_charts::detection_section(self))
            .section(time_charts::motion_section(self))
            .section(result_tables::section(self))
            .section(self.scenario_section())
    }

    /// The report as one HTML file.
    #[must_use]
    pub fn to_html(&self) -> String {
        self.to_page().to_html()
    }

    fn scenario_section(&self) -> Section {
        let section = Section::new("Scenario");
        if self.provenance.scenario_text.is_empty() {
            return section;
        }
        let title = match self.provenance.scenario_file.as_str() {
            "" => "Resolved scenario".to_owned(),
            file => format!("{file}, resolved"),
        };
        section.code(title, &self.provenance.scenario_text)
    }
}

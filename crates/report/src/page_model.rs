//! A page as data: sections of charts, tables, score tiles, text, pictures and code.

use crate::chart_model::Chart;

/// Rating of a value, drawn as a colour and a sign, so that it does not depend on colour vision.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Status {
    /// Not rated.
    #[default]
    Plain,
    /// Within the good range.
    Good,
    /// Acceptable.
    Warn,
    /// Out of range.
    Bad,
}

impl Status {
    /// `Good` up to `good`, `Warn` up to `warn`, `Bad` beyond; not rated without a finite value.
    #[must_use]
    pub fn at_most(value: f64, good: f64, warn: f64) -> Self {
        if !value.is_finite() {
            Self::Plain
        } else if value <= good {
            Self::Good
        } else if value <= warn {
            Self::Warn
        } else {
            Self::Bad
        }
    }

    pub(crate) const fn class(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::Good => "good",
            Self::Warn => "warn",
            Self::Bad => "bad",
        }
    }
}

/// One figure of a scorecard.
#[derive(Clone, Debug, PartialEq)]
pub struct Tile {
    /// Label.
    pub label: String,
    /// The figure, with unit.
    pub value: String,
    /// A line below; may be empty.
    pub detail: String,
    /// Judgement.
    pub status: Status,
}

impl Tile {
    /// A tile without rating.
    #[must_use]
    pub fn new(label: impl Into<String>, value: impl Into<String>, detail: impl Into<String>) -> Self {
        Self { label: label.into(), value: value.into(), detail: detail.into(), status: Status::Plain }
    }

    /// The same tile with a judgement.
    #[must_use]
    pub fn status(mut self, status: Status) -> Self {
        self.status = status;
        self
    }
}

/// A cell of a table.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cell {
    /// Text of the cell.
    pub text: String,
    /// Judgement.
    pub status: Status,
    /// Aligned to the right, as numbers are.
    pub right_aligned: bool,
}

impl Cell {
    /// A text cell.
    #[must_use]
    pub fn text(text: impl Into<String>) -> Self {
        Self { text: text.into(), status: Status::Plain, right_aligned: false }
    }

    /// A cell with a number.
    #[must_use]
    pub fn number(text: impl Into<String>) -> Self {
        Self { text: text.into(), status: Status::Plain, right_aligned: true }
    }

    /// The same cell with a judgement.
    #[must_use]
    pub fn status(mut self, status: Status) -> Self {
        self.status = status;
        self
    }
}

/// A table. The first cell of a row is its heading.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// Caption above the table.
    pub title: String,
    /// Upper row of headings that span several columns: text and number of columns; may be empty.
    pub column_groups: Vec<(String, usize)>,
    /// Column headings.
    pub headers: Vec<String>,
    /// Rows, each as long as `headers`.
    pub rows: Vec<Vec<Cell>>,
}

impl Table {
    /// A table without an upper row of headings.
    #[must_use]
    pub fn new(title: impl Into<String>, headers: &[&str], rows: Vec<Vec<Cell>>) -> Self {
        let headers = headers.iter().map(|h| (*h).to_owned()).collect();
        Self { title: title.into(), column_groups: Vec::new(), headers, rows }
    }

    /// The same with an upper row of headings: text and number of columns of each.
    #[must_use]
    pub fn with_column_groups(mut self, groups: &[(&str, usize)]) -> Self {
        self.column_groups = groups.iter().map(|(text, columns)| ((*text).to_owned(), *columns)).collect();
        self
    }
}

/// Paragraphs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Text {
    /// Paragraphs of plain text; markup in them is escaped.
    pub paragraphs: Vec<String>,
    /// Set apart as a warning when `Warn` or `Bad`.
    pub status: Status,
}

/// A still picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SvgImage {
    /// Alternative text.
    pub description: String,
    /// SVG text. It is embedded as an image: scripts in it do not run.
    pub markup: String,
}

/// Text to be copied: a scenario, a command.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Code {
    /// Name, such as the file's.
    pub title: String,
    /// The text itself.
    pub text: String,
    /// Collapsed until opened.
    pub folded: bool,
}

/// A piece of a section.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::large_enum_variant, reason = "a page holds a few dozen blocks")]
pub enum Block {
    /// A chart that zooms and pans.
    Chart(Chart),
    /// A table.
    Table(Table),
    /// Score tiles.
    Scorecard(Vec<Tile>),
    /// Paragraphs.
    Text(Text),
    /// A still picture.
    Svg(SvgImage),
    /// Text to be copied.
    Code(Code),
}

/// A part of the page with its heading.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Section {
    /// Heading.
    pub title: String,
    /// Content in order.
    pub blocks: Vec<Block>,
}

impl Section {
    /// An empty section.
    #[must_use]
    pub fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), blocks: Vec::new() }
    }

    /// Adds a block.
    #[must_use]
    pub fn block(mut self, block: Block) -> Self {
        self.blocks.push(block);
        self
    }

    /// Adds a chart unless it has nothing to draw.
    #[must_use]
    pub fn chart(self, chart: Chart) -> Self {
        if chart.is_empty() { self } else { self.block(Block::Chart(chart)) }
    }

    /// Adds a table unless it has no rows.
    #[must_use]
    pub fn table(self, table: Table) -> Self {
        if table.rows.is_empty() { self } else { self.block(Block::Table(table)) }
    }

    /// Adds a paragraph.
    #[must_use]
    pub fn text(self, paragraph: impl Into<String>) -> Self {
        self.texts(vec![paragraph.into()])
    }

    /// Adds paragraphs unless there are none.
    #[must_use]
    pub fn texts(self, paragraphs: Vec<String>) -> Self {
        if paragraphs.is_empty() {
            self
        } else {
            self.block(Block::Text(Text { paragraphs, status: Status::Plain }))
        }
    }

    /// Adds paragraphs set apart as a warning.
    #[must_use]
    pub fn warnings(self, paragraphs: Vec<String>) -> Self {
        self.block(Block::Text(Text { paragraphs, status: Status::Warn }))
    }

    /// Adds a row of tiles.
    #[must_use]
    pub fn tiles(self, tiles: Vec<Tile>) -> Self {
        self.block(Block::Scorecard(tiles))
    }

    /// Adds a still picture (SVG).
    #[must_use]
    pub fn picture(self, description: impl Into<String>, markup: String) -> Self {
        self.block(Block::Svg(SvgImage { description: description.into(), markup }))
    }

    /// Adds text to be copied.
    #[must_use]
    pub fn code(self, title: impl Into<String>, text: impl Into<String>) -> Self {
        self.block(Block::Code(Code { title: title.into(), text: text.into(), folded: false }))
    }

    /// Adds text to be copied collapsed until opened.
    #[must_use]
    pub fn folded(self, title: impl Into<String>, text: impl Into<String>) -> Self {
        self.block(Block::Code(Code { title: title.into(), text: text.into(), folded: true }))
    }
}

/// A page, rendered to one self-contained HTML file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Page {
    /// Title.
    pub title: String,
    /// A line below the title; may be empty.
    pub subtitle: String,
    /// Small facts below: name and value.
    pub facts: Vec<(String, String)>,
    /// The sections.
    pub sections: Vec<Section>,
}

impl Page {
    /// An empty page.
    #[must_use]
    pub fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), ..Self::default() }
    }

    /// Sets the line below the title.
    #[must_use]
    pub fn subtitle(mut self, subtitle: impl Into<String>) -> Self {
        self.subtitle = subtitle.into();
        self
    }

    /// Adds a small fact to the head: seed, version, hash.
    #[must_use]
    pub fn fact(mut self, name: impl Into<String>, value: impl Into<String>) -> Self {
        self.facts.push((name.into(), value.into()));
        self
    }

    /// Adds a section unless it is empty.
    #[must_use]
    pub fn section(mut self, section: Section) -> Self {
        if !section.blocks.is_empty() {
            self.sections.push(section);
        }
        self
    }
}

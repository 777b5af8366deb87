//! Colours distinguishable with colour vision deficiency, on light and dark backgrounds.

/// A colour by role; the eight hues are Okabe and Ito's (2008), `Ink` and `Grey` follow the theme.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Colour {
    /// The text colour: near black on paper, near white in the dark. Ground truth is drawn in it.
    Ink,
    /// Grey, for measured data.
    Grey,
    /// `#0072B2`
    Blue,
    /// `#D55E00`
    Vermillion,
    /// `#009E73`
    Green,
    /// `#CC79A7`
    Purple,
    /// `#E69F00`
    Orange,
    /// `#56B4E9`
    SkyBlue,
    /// `#F0E442`; for areas: as a line it is too pale on white.
    Yellow,
}

impl Colour {
    /// Every colour, in the order of the declaration.
    pub const ALL: [Self; 9] = [
        Self::Ink,
        Self::Grey,
        Self::Blue,
        Self::Vermillion,
        Self::Green,
        Self::Purple,
        Self::Orange,
        Self::SkyBlue,
        Self::Yellow,
    ];

    /// The hexadecimal colour on a light page.
    #[must_use]
    pub const fn light(self) -> &'static str {
        match self {
            Self::Ink => "#1b1f24",
            Self::Grey => "#9aa3ad",
            Self::Blue => "#0072b2",
            Self::Vermillion => "#d55e00",
            Self::Green => "#009e73",
            Self::Purple => "#cc79a7",
            Self::Orange => "#e69f00",
            Self::SkyBlue => "#56b4e9",
            Self::Yellow => "#f0e442",
        }
    }

    /// The hexadecimal colour on a dark page: blue and vermillion are lifted, `Ink` and `Grey` follow the theme.
    #[must_use]
    pub const fn dark(self) -> &'static str {
        match self {
            Self::Ink => "#eef1f4",
            Self::Grey => "#76808b",
            Self::Blue => "#2f97dd",
            Self::Vermillion => "#f0752b",
            other => other.light(),
        }
    }

    /// The name used in the page's data and in the class names of an SVG.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ink => "ink",
            Self::Grey => "grey",
            Self::Blue => "blue",
            Self::Vermillion => "vermillion",
            Self::Green => "green",
            Self::Purple => "purple",
            Self::Orange => "orange",
            Self::SkyBlue => "sky_blue",
            Self::Yellow => "yellow",
        }
    }

    /// The colour of the `index`-th curve of several that are compared; repeats after seven.
    #[must_use]
    pub const fn nth(index: usize) -> Self {
        match index % 7 {
            0 => Self::Blue,
            1 => Self::Vermillion,
            2 => Self::Green,
            3 => Self::Purple,
            4 => Self::Orange,
            5 => Self::SkyBlue,
            _ => Self::Ink,
        }
    }

    /// The shade of the `index`-th of several adjoining areas (tissue layers).
    #[must_use]
    pub const fn area(index: usize) -> Self {
        match index % 4 {
            0 => Self::SkyBlue,
            1 => Self::Orange,
            2 => Self::Green,
            _ => Self::Purple,
        }
    }
}

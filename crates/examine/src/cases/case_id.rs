//! Identifier of a case: all its properties are functions of these words and numbers.

use crate::named_enum::named_enum;
use serde::{Deserialize, Serialize};

named_enum! {
    /// Tissue law of the simulator.
    World {
        Plain = "plain": "the equations of docs/reference/model.md, implemented a second time",
        Rich = "rich": "a law of another form: bristles, foundation springs, damage, tearing, a bending needle",
    }
}

named_enum! {
    /// Misspecification of the assumed scenario or of the sensor.
    Wrong {
        Nothing = "nothing": "nothing wrong: K, b, F known to 5 %, geometry exact, white or AR(1) noise, 200 Hz",
        Thickness = "thickness": "every layer's thickness off by up to 2, 5, 10 %",
        Surface = "surface": "the surface off by up to 0.5, 1, 2 mm, the same in all recordings",
        SurfaceEach = "surface_each": "the surface off by up to 0.5, 1, 2 mm, in every recording by another amount",
        Coefficients = "coefficients": "K, b, F off by up to 10, 20, 28 % (tolerance 30 %)",
        Encoder = "encoder": "encoder noise of 2, 10, 20 um",
        EncoderSteps = "encoder_steps": "encoder steps of 5, 20, 50 um",
        Jitter = "jitter": "samples at irregular instants, up to 10, 20, 30 % of the interval off",
        Dropped = "dropped": "1, 3, 10 % of the samples missing",
        Late = "late": "the force late by 0.5, 1, 2 samples against the position",
        Growing = "growing": "noise that grows with 0.5, 1, 2 % of the force",
        Tails = "tails": "an eighth, a quarter, half of the noise's variance Student t of 3 degrees",
        Ar1 = "ar1": "AR(1) noise of 0.5, 0.8, 0.95",
        Ar2 = "ar2": "AR(2) noise of (0.8, -0.3), (1.3, -0.6), (1.6, -0.8)",
        Wander = "wander": "1/f wander of 0.5, 1, 2 times the noise",
        Hum = "hum": "mains hum of drifting frequency, amplitude 0.5, 1, 2 times the noise",
        Bits = "bits": "a 12-bit converter over +-10, 20, 40 N",
        Rate = "rate": "sampled at 50 Hz, 1 kHz, 5 kHz",
        Layers = "layers": "one or two layers; five; six of 3 to 40 mm, K 10 to 1000 N/m, F 0.2 to 10 N",
        NoAir = "no_air": "the recordings begin 1 mm, 0.3 mm before the surface, or on it",
        Recordings = "recordings": "eight, two, one recordings in place of four",
        ScatterPuncture = "scatter_puncture": "puncture forces scatter by 1, 3, 6 % between recordings",
        ScatterFriction = "scatter_friction": "friction scatters by 1, 3, 6 % between recordings",
        ScatterSurface = "scatter_surface": "the surface scatters by 1, 3, 6 % of the first layer between recordings",
        Five = "five": "thickness, surface, coefficients, encoder and growing noise at once, at half the size",
        Geometry = "geometry": "thickness and surface off at once, each as much as in its own row",
        Guess = "guess": "every layer's thickness, K, b, F assumed off by a factor of up to 1.6, 3, 10",
        NoScenario = "no_scenario": "no assumed layers at all: of one or two, two to four, five layers",
    }
}

named_enum! {
    /// Severity of the misspecification.
    Severity {
        Small = "small": "the first of the three amounts",
        Medium = "medium": "the second",
        Large = "large": "the third",
    }
}

named_enum! {
    /// Hidden causes of a case.
    Hide {
        Clean = "clean": "nothing",
        One = "one": "one effect of the library",
        Two = "two": "two effects",
        Three = "three": "three effects",
        Outside = "outside": "something that the library lacks",
        Mixed = "mixed": "one effect together with something that the library lacks",
        Instrument = "instrument": "an instrument fault in six repeats of three motions",
        Custom = "custom": "a custom effect",
    }
}

impl Hide {
    /// Everything that the simulator hides by itself.
    pub const BUILT_IN: &'static [Hide] = match Self::ALL.split_last() {
        Some((_custom, built_in)) => built_in,
        None => &[],
    };
}

named_enum! {
    /// Strength of the hidden causes: RMS residual of the re-fitted base law.
    Size {
        Faint = "faint": "0.15 to 0.5 standard deviations of the noise",
        Medium = "medium": "0.5 to 5 standard deviations of the noise",
        Strong = "strong": "5 to 15 standard deviations of the noise",
    }
}

/// Version of the case generator. Between versions the same identifier may denote different cases, so outcomes must not be mixed. 2:
/// every row hides other effects than its neighbours under the same index.
pub const GENERATOR_VERSION: u32 = 2;

/// The version of files without a version.
pub(crate) fn first_generator_version() -> u32 {
    1
}

/// Identifier of a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct CaseId {
    /// Tissue law of the simulator.
    pub world: World,
    /// Misspecification.
    pub wrong: Wrong,
    /// Severity of the misspecification.
    pub severity: Severity,
    /// Hidden causes.
    pub hide: Hide,
    /// Strength of the hidden causes.
    pub size: Size,
    /// Seed of the generator.
    pub seed: u64,
    /// Index of the case among those with the same other fields.
    pub index: u64,
}

impl CaseId {
    /// Seed of this case. It does not depend on the severity: the same insertion is tested at every severity of the
    /// misspecification.
    #[must_use]
    pub fn case_seed(&self) -> u64 {
        let mut h = self.seed ^ 0x51_7c_c1_b7_27_22_0a_95;
        for part in [self.world as u64, self.wrong as u64, self.hide as u64, self.size as u64, self.index] {
            h = mix(h ^ part.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        }
        h
    }

    /// Readable name, also used for files.
    #[must_use]
    pub fn name(&self) -> String {
        format!(
            "{}-{}-{}-{}-{}-{}-{}",
            self.world, self.wrong, self.severity, self.hide, self.size, self.seed, self.index
        )
    }
}

/// Bijective hash of 64 bits (SplitMix64's finaliser, Steele, Lea and Flood 2014).
pub(crate) fn mix(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

//! Sets of repeated insertions on the one engine: what varies between recordings and days is random, the law is shared.
//!
//! | module | what lives there |
//! |---|---|
//! | [`first`] | the first guess: what the raw force says of faces, loads and releases |
//! | [`fitted`] | the fit from several starts, judged by the law's own discrepancy |
//! | [`population`] | an insertion nobody has seen: draws from what varies, mean and band |
//! | [`left_out`] | recordings and whole days left out; the mean of the others as the floor; by phase |

pub mod first;
pub mod fitted;
pub mod left_out;
pub mod population;

pub use first::Insertion;

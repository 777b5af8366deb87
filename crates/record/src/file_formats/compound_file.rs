//! Check of compound files, the container of xls, for cyclic chains of sectors, in which a reader would loop for ever.

/// Sector numbers from here on end a chain or mark free sectors.
const FIRST_SPECIAL: u32 = 0xFFFF_FFFA;
/// Bytes of the header.
const HEADER_BYTES: usize = 512;
/// Sector numbers of the allocation table in the header.
const HEADER_ENTRIES: usize = 109;

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?))
}

/// Whether all chains of sectors end.
pub(super) fn is_sound(bytes: &[u8]) -> bool {
    check(bytes).unwrap_or(false)
}

fn check(bytes: &[u8]) -> Option<bool> {
    let shift = u16::from_le_bytes(bytes.get(30..32)?.try_into().ok()?);
    if !matches!(shift, 9 | 12) || bytes.len() < HEADER_BYTES {
        return Some(false);
    }
    let size = 1_usize << shift;
    let sectors = bytes.len() / size + 1;
    let sector = |number: u32| {
        let from = (number as usize).checked_add(1)?.checked_mul(size)?;
        bytes.get(from..bytes.len().min(from + size))
    };
    let numbers = |data: &[u8]| (0..data.len() / 4).filter_map(|k| u32_at(data, 4 * k)).collect::<Vec<u32>>();
    // Sectors of the allocation table: in the header, then in a separate chain.
    let mut table_sectors: Vec<u32> = (0..HEADER_ENTRIES).filter_map(|k| u32_at(bytes, 76 + 4 * k)).collect();
    let (mut next, mut steps) = (u32_at(bytes, 68)?, 0);
    while next < FIRST_SPECIAL {
        let mut entries = numbers(sector(next)?);
        next = entries.pop()?;
        table_sectors.extend(entries);
        steps += 1;
        if steps > sectors {
            return Some(false);
        }
    }
    let mut table = Vec::new();
    for number in table_sectors.into_iter().filter(|number| *number < FIRST_SPECIAL) {
        table.extend(numbers(sector(number)?));
        if table.len() > sectors + size {
            break;
        }
    }
    if !chains_end(&table) {
        return Some(false);
    }
    // The table of small sectors is a stream of the first one.
    let (mut small, mut next) = (Vec::new(), u32_at(bytes, 60)?);
    while next < FIRST_SPECIAL && small.len() <= sectors * size {
        small.extend(numbers(sector(next)?));
        next = table.get(next as usize).copied().unwrap_or(u32::MAX);
    }
    Some(chains_end(&small))
}

/// Whether no chain runs in a circle.
fn chains_end(table: &[u32]) -> bool {
    // Number of the walk that passed an entry first.
    let mut passed = vec![0_usize; table.len()];
    for start in 0..table.len() {
        let mut at = start;
        while let Some(mark) = passed.get_mut(at) {
            if *mark == start + 1 {
                return false;
            }
            if *mark != 0 {
                break;
            }
            *mark = start + 1;
            match table[at] {
                next if next < FIRST_SPECIAL => at = next as usize,
                _ => break,
            }
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_circle_is_found_and_chains_that_meet_or_end_are_none() {
        assert!(chains_end(&[1, 2, u32::MAX, 2, 99]));
        assert!(!chains_end(&[1, 2, 0]));
        assert!(!chains_end(&[u32::MAX, 1]));
    }

    #[test]
    fn a_spreadsheet_is_sound_and_its_beginning_alone_is_refused() {
        let whole = include_bytes!("../../tests/foreign/machine.xls");
        assert!(is_sound(whole));
        assert!(!is_sound(&whole[..600]));
    }
}

//! Of an effect that has a size for each block: the block that differs from the others. The size of all blocks together is often not
//! determined (a late trigger looks the same); their differences are.

use super::candidate_effects::Column;

/// The block that differs most.
#[derive(Debug, Clone, PartialEq)]
pub struct OddBlock {
    pub block: String,
    /// In which of its numbers.
    pub parameter: String,
    /// By how much it differs from the mean of the other blocks, in the unit.
    pub by: f64,
    pub unit: String,
}

/// The block that differs most, from the sizes of all columns in typical sizes; `None` where another one differs nearly as much.
pub(super) fn odd_block(columns: &[Column], sizes: &[f64]) -> Option<OddBlock> {
    let of = |c: &Column| c.name.split_once('@').map(|(name, block)| (name.to_owned(), block.to_owned()));
    let all: Vec<(String, String, f64)> = columns
        .iter()
        .zip(sizes)
        .filter_map(|(c, size)| of(c).map(|(name, block)| (name, block, size * c.typical)))
        .collect();
    let from_others = |(name, block, value): &(String, String, f64)| {
        let others: Vec<f64> = all.iter().filter(|o| o.0 == *name && o.1 != *block).map(|o| o.2).collect();
        value - others.iter().sum::<f64>() / others.len().max(1) as f64
    };
    let largest = |skip: Option<&str>| {
        let each = all.iter().filter(|o| skip != Some(o.1.as_str())).map(|o| (o, from_others(o)));
        each.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
    };
    let (first, by) = largest(None)?;
    let (_, next) = largest(Some(&first.1))?;
    let unit = columns.first()?.unit.clone();
    let odd = OddBlock { block: first.1.clone(), parameter: first.0.clone(), by, unit };
    // of three blocks one that differs makes each of the others differ by half of it
    (next.abs() < 0.6 * by.abs()).then_some(odd)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_block_stands_out_or_none_does() {
        let column =
            |name: &str| Column { name: name.to_owned(), unit: "um".to_owned(), typical: 2.0, positive: false };
        let columns = ["x@m/a", "y@m/a", "x@m/b", "y@m/b", "x@m/c", "y@m/c"].map(column);
        // b is 4 um longer in x than the others; 1 um of all cannot be seen and is spread over them
        let odd = odd_block(&columns, &[-0.5, -0.5, 1.5, -0.5, -0.5, -0.5]).unwrap();
        assert_eq!((odd.block.as_str(), odd.parameter.as_str(), odd.by), ("m/b", "x", 4.0));
        assert_eq!(odd_block(&columns, &[1.0, 0.0, -1.0, 0.0, 0.2, 0.1]), None);
        assert_eq!(odd_block(&columns[..2], &[1.0, 2.0]), None);
    }
}

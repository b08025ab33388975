//! Which extreme cases a node is fed together.
//!
//! All combinations of the extremes of four ports are tens of thousands; faults need one extreme, or two that meet. So
//! the cases are rows of an orthogonal array of strength two: with p a prime not below the number of ports and of any
//! port's levels, the rows (a + c·b mod p) over the ports c, for all a, b < p, hold every pair of levels of every two
//! ports. That is p² cases, 169 for thirteen levels, however many ports there are.

use std::collections::BTreeSet;

use crate::{AnyValue, PortSpec, Slot};

/// Inputs, one slot a port, and what is extreme about them.
#[derive(Clone)]
pub struct Case {
    pub name: String,
    pub inputs: Vec<Slot>,
}

/// What one port is fed: its name for people, and the slot.
type Level = (String, Slot);

/// The extremes of the port's type; absent if it may be; for a list also several.
fn levels(port: &PortSpec) -> Vec<Level> {
    let extremes = port.value_type.extremes();
    let mut levels: Vec<Level> = Vec::new();
    if port.optional {
        levels.push(("absent".into(), Slot::new()));
    }
    if port.many {
        let all = extremes.iter().map(|(_, value)| value.clone());
        levels.push(("all extremes".into(), all.collect()));
    }
    levels.extend(extremes.into_iter().map(|(name, value)| (name.to_owned(), vec![value])));
    levels
}

/// The cases of a node with these input ports: pairs of extremes as they are declared (sizes differ), and made to go
/// together ([`crate::Value::matched`]). Without extremes there is one case a port less, and a node without inputs has
/// one case.
pub fn together(ports: &[PortSpec]) -> Vec<Case> {
    let levels: Vec<Vec<Level>> = ports.iter().map(levels).collect();
    let counts: Vec<usize> = levels.iter().map(Vec::len).collect();
    let mut cases = Vec::new();
    for (diagonal, row) in rows(&counts) {
        let mut case = Case {
            name: String::new(),
            inputs: Vec::new(),
        };
        let mut told = Vec::new();
        for (port, (levels, i)) in ports.iter().zip(levels.iter().zip(row)) {
            let (name, slot) = &levels[i];
            told.push(format!("{} = {name}", port.name));
            case.inputs.push(slot.clone());
        }
        case.name = told.join(", ");
        match matched(&case.inputs) {
            None => cases.push(case),
            Some(inputs) => {
                // Sizes that differ are refused alike whatever else the values are: one row in p shows it.
                if diagonal {
                    cases.push(case.clone());
                }
                let name = format!("{}, matched", case.name);
                cases.push(Case { name, inputs });
            }
        }
    }
    cases
}

/// One port extreme at a time, the others as in `ordinary` and made to go with it.
pub fn around(ports: &[PortSpec], ordinary: &[Slot]) -> Vec<Case> {
    let mut cases = Vec::new();
    for (i, port) in ports.iter().enumerate() {
        for (name, slot) in levels(port) {
            let mut inputs = ordinary.to_vec();
            inputs[i] = slot;
            let name = format!("{} = {name}", port.name);
            let mut fitted = inputs.clone();
            let mut changed = false;
            for j in (0..ports.len()).filter(|&j| j != i) {
                changed |= agree(&mut fitted, i, j);
            }
            cases.push(Case {
                name: name.clone(),
                inputs,
            });
            if changed {
                let name = format!("{name}, the others matched");
                cases.push(Case { name, inputs: fitted });
            }
        }
    }
    cases
}

/// The inputs made to go together: each with those before it, the nearest last, so that it is the one it agrees with
/// when they disagree. `None` if all went together already.
fn matched(inputs: &[Slot]) -> Option<Vec<Slot>> {
    let mut inputs = inputs.to_vec();
    let mut changed = false;
    for i in 1..inputs.len() {
        for j in (0..i).rev() {
            changed |= agree(&mut inputs, j, i);
        }
    }
    changed.then_some(inputs)
}

/// Makes the values of port `other` go with the first of port `anchor`, or that one with them. Whether anything changed.
pub(super) fn agree(inputs: &mut [Slot], anchor: usize, other: usize) -> bool {
    let Some(first) = inputs[anchor].first().cloned() else {
        return false;
    };
    let mut changed = false;
    for k in 0..inputs[other].len() {
        let value = inputs[other][k].clone();
        let replace = |slot: &mut AnyValue, by: AnyValue| {
            let differs = slot.digest() != by.digest();
            *slot = by;
            differs
        };
        if let Some(fitting) = value.matched(&first) {
            changed |= replace(&mut inputs[other][k], fitting);
        } else if let Some(fitting) = first.matched(&value) {
            changed |= replace(&mut inputs[anchor][0], fitting);
        }
    }
    changed
}

/// Rows of levels, one a port, that hold every pair of levels of every two ports; and whether the row is one of the
/// few that hold every level once. No rows if a port has no levels.
fn rows(counts: &[usize]) -> Vec<(bool, Vec<usize>)> {
    let most = counts.iter().copied().max().unwrap_or(1).max(counts.len());
    if counts.contains(&0) {
        return Vec::new();
    }
    if counts.len() == 1 {
        return (0..counts[0]).map(|i| (true, vec![i])).collect();
    }
    let prime = (most.max(2)..).find(|n| (2..*n).all(|d| n % d != 0)).unwrap_or(most);
    let mut seen = BTreeSet::new();
    let mut rows = Vec::new();
    for b in 0..prime {
        for a in 0..prime {
            let row: Vec<usize> = counts
                .iter()
                .enumerate()
                .map(|(c, n)| (a + c * b) % prime % n)
                .collect();
            if seen.insert(row.clone()) {
                rows.push((b == 0, row));
            }
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_node_without_inputs_has_one_case() {
        assert_eq!(rows(&[]), [(true, vec![])]);
    }

    proptest! {
        #[test]
        fn every_two_extremes_of_two_ports_meet(counts in prop::collection::vec(1usize..14, 1..6)) {
            let rows = rows(&counts);
            for c in 0..counts.len() {
                for d in 0..c {
                    for i in 0..counts[c] {
                        for j in 0..counts[d] {
                            prop_assert!(rows.iter().any(|(_, row)| row[c] == i && row[d] == j));
                        }
                    }
                }
                for i in 0..counts[c] {
                    prop_assert!(rows.iter().any(|(diagonal, row)| *diagonal && row[c] == i));
                }
            }
            prop_assert!(rows.len() <= 17 * 17);
        }
    }
}

//! Connected components of a mask.

use crate::Mask;

/// Which neighbours hang together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Connectivity {
    /// Left, right, above, below.
    Four,
    /// And the diagonals.
    Eight,
}

/// The connected parts of a mask.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Components {
    /// Row-major; 0 outside, then 1, 2, … in the order in which a row-by-row scan meets the parts.
    pub labels: Vec<u32>,
    /// Pixels of part `i + 1`.
    pub sizes: Vec<usize>,
}

impl Components {
    /// The label of the largest part (the first of equals); `None` when there is none.
    pub fn largest(&self) -> Option<u32> {
        let most = *self.sizes.iter().max()?;
        self.sizes.iter().position(|&size| size == most).map(|i| i as u32 + 1)
    }
}

/// Labels the connected parts of `mask`.
pub fn components(mask: &Mask, connectivity: Connectivity) -> Components {
    let (width, height) = mask.size();
    let mut labels = vec![0u32; mask.len()];
    let mut sizes = Vec::new();
    let mut stack = Vec::new();
    let reach: &[(isize, isize)] = match connectivity {
        Connectivity::Four => &[(1, 0), (-1, 0), (0, 1), (0, -1)],
        Connectivity::Eight => &[(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)],
    };
    for start in 0..mask.len() {
        if !mask.data()[start] || labels[start] != 0 {
            continue;
        }
        let label = sizes.len() as u32 + 1;
        let mut size = 0;
        labels[start] = label;
        stack.push(start);
        while let Some(at) = stack.pop() {
            size += 1;
            let (x, y) = ((at % width) as isize, (at / width) as isize);
            for (dx, dy) in reach {
                let (nx, ny) = (x + dx, y + dy);
                if nx < 0 || ny < 0 || nx >= width as isize || ny >= height as isize {
                    continue;
                }
                let next = ny as usize * width + nx as usize;
                if mask.data()[next] && labels[next] == 0 {
                    labels[next] = label;
                    stack.push(next);
                }
            }
        }
        sizes.push(size);
    }
    Components { labels, sizes }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn diagonal_neighbours_hang_together_only_eight_connected() {
        let mask = Mask::from_fn(4, 4, |x, y| x == y || (x, y) == (3, 0));
        let four = components(&mask, Connectivity::Four);
        assert_eq!(four.sizes, [1, 1, 1, 1, 1]);
        let eight = components(&mask, Connectivity::Eight);
        assert_eq!(eight.sizes, [4, 1]);
        assert_eq!(eight.largest(), Some(1));
        assert_eq!(eight.labels[3], 2);
        assert_eq!(
            components(&Mask::filled(3, 3, false), Connectivity::Four).largest(),
            None
        );
    }
}

//! Where the labels of points stand, so that each can be read: what finds no free place beside its point has none.

/// Width of a character and height of a line of labels, about.
const CHARACTER: f64 = 6.1;
const LINE: f64 = 12.0;

/// A rectangle: left, top, right, bottom.
pub type Area = (f64, f64, f64, f64);

/// A label in its place.
#[derive(Clone, Debug, PartialEq)]
pub struct Placed {
    /// Where the text begins, or ends.
    pub x: f64,
    /// Its base line.
    pub y: f64,
    /// Whether it ends at `x`.
    pub end: bool,
}

/// Places labels one after another within an area.
pub struct Labels {
    within: Area,
    taken: Vec<Area>,
}

impl Labels {
    /// No label may leave `within`.
    pub fn new(within: Area) -> Self {
        Self {
            within,
            taken: Vec::new(),
        }
    }

    /// Keeps an area free of labels.
    pub fn keep_free(&mut self, area: Area) {
        self.taken.push(area);
    }

    /// A free place for a text beside a point: right of it or left, above or below.
    pub fn place(&mut self, text: &str, (x, y): (f64, f64)) -> Option<Placed> {
        let width = CHARACTER * text.chars().count() as f64;
        for (end, y) in [(false, y - 6.0), (true, y - 6.0), (false, y + 15.0), (true, y + 15.0)] {
            let x = if end { x - 9.0 } else { x + 9.0 };
            let left = if end { x - width } else { x };
            let area = (left, y - LINE + 2.0, left + width, y + 2.0);
            let inside = area.0 >= self.within.0
                && area.1 >= self.within.1
                && area.2 <= self.within.2
                && area.3 <= self.within.3;
            if inside && !self.taken.iter().any(|taken| overlap(*taken, area)) {
                self.taken.push(area);
                return Some(Placed { x, y, end });
            }
        }
        None
    }
}

fn overlap(a: Area, b: Area) -> bool {
    a.0 < b.2 && b.0 < a.2 && a.1 < b.3 && b.1 < a.3
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_of_one_place_go_around_it_until_there_is_no_room() {
        let mut labels = Labels::new((0.0, 0.0, 300.0, 100.0));
        let places: Vec<_> = (0..5).map(|_| labels.place("label", (150.0, 50.0))).collect();
        let sides: Vec<_> = places.iter().flatten().map(|p| (p.end, p.y)).collect();
        assert_eq!(sides, [(false, 44.0), (true, 44.0), (false, 65.0), (true, 65.0)]);
        assert_eq!(places[4], None);
    }

    #[test]
    fn a_label_leaves_neither_the_drawing_nor_enters_what_is_kept_free() {
        let mut labels = Labels::new((0.0, 0.0, 300.0, 100.0));
        assert!(labels.place("at the rim", (290.0, 50.0)).unwrap().end);
        labels.keep_free((100.0, 0.0, 200.0, 34.0));
        let below = labels.place("x", (150.0, 30.0)).unwrap();
        assert_eq!((below.y, below.end), (45.0, false));
    }
}

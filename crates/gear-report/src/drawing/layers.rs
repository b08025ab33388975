//! Layered layout of a directed graph (Sugiyama, Tagawa and Toda 1981), in four steps:
//!
//! 1. a box's layer is the length of the longest path that leads to it, so every edge points down,
//!    and a source is pulled down to just above its first reader;
//! 2. an edge that crosses layers gets a waypoint in each, so that it is routed between boxes, not through them;
//! 3. within a layer, boxes and waypoints are ordered by the mean position of their neighbours, sweeping down
//!    and up, and the ordering with the fewest crossings is kept;
//! 4. positions minimise the squared slant of the edges while keeping order and distance.
//!
//! Plain loops, no recursion. Edges of a cycle, which a checked graph has not, are drawn but do not count for layers.

/// Width and height of a box.
pub const BOX: (f64, f64) = (140.0, 42.0);
const GAP: (f64, f64) = (44.0, 38.0);
/// Between a waypoint and whatever is beside it.
const WAYPOINT_GAP: f64 = 18.0;
/// How far above and below the boxes of a row an edge may turn.
const ROW_CLEARANCE: f64 = 4.0;
const WAYPOINT_WIDTH: f64 = 6.0;
const MARGIN: f64 = 8.0;
/// Rounds in which positions settle; a pull travels one layer a round.
const SETTLE: usize = 300;

/// Where everything goes.
#[derive(Debug)]
pub struct Layout {
    /// The centre of each box.
    pub places: Vec<(f64, f64)>,
    /// The distinct edges.
    pub routes: Vec<Route>,
    /// Extent of the drawing.
    pub width: f64,
    /// Extent of the drawing.
    pub height: f64,
}

/// An edge on its way through the layers.
#[derive(Debug)]
pub struct Route {
    /// The box it leaves.
    pub from: usize,
    /// The box it reaches.
    pub to: usize,
    /// From the lower side of one to the upper side of the other.
    pub points: Vec<(f64, f64)>,
}

/// Boxes and waypoints alike.
struct Items {
    layer: Vec<usize>,
    up: Vec<Vec<usize>>,
    down: Vec<Vec<usize>>,
}

/// Lays out `count` boxes and the edges between them.
pub fn layout(count: usize, edges: &[(usize, usize)]) -> Layout {
    let mut edges: Vec<_> = edges.iter().copied().filter(|(from, to)| from != to).collect();
    edges.sort_unstable();
    edges.dedup();

    let layer = layer_of(count, &edges);
    let (items, chains) = insert_waypoints(layer, &edges);
    let rows = order(&items);
    let x = positions(&items, &rows, count);

    let left = x.iter().copied().fold(f64::INFINITY, f64::min);
    let right = x.iter().copied().fold(0.0, f64::max);
    let shift = if left.is_finite() {
        MARGIN + BOX.0 / 2.0 - left
    } else {
        0.0
    };
    let y = |item: usize| MARGIN + BOX.1 / 2.0 + items.layer[item] as f64 * (BOX.1 + GAP.1);
    let place = |item: usize| (x[item] + shift, y(item));

    let routes = edges
        .iter()
        .zip(&chains)
        .map(|(&(from, to), chain)| {
            // In the rows that it crosses an edge goes straight down, so that it turns only where no boxes are.
            let points = chain.iter().flat_map(|&item| {
                let (x, y) = place(item);
                let half = BOX.1 / 2.0 + if item < count { 0.0 } else { ROW_CLEARANCE };
                let below = (item != to).then_some((x, y + half));
                let above = (item != from).then_some((x, y - half));
                above.into_iter().chain(below)
            });
            let points = points.collect();
            Route { from, to, points }
        })
        .collect();
    Layout {
        places: (0..count).map(place).collect(),
        routes,
        width: right + shift + BOX.0 / 2.0 + MARGIN,
        height: rows.len() as f64 * (BOX.1 + GAP.1) - GAP.1 + 2.0 * MARGIN,
    }
}

/// Longest-path layers, by Kahn's algorithm.
fn layer_of(count: usize, edges: &[(usize, usize)]) -> Vec<usize> {
    let mut waiting = vec![0usize; count];
    for &(_, to) in edges {
        waiting[to] += 1;
    }
    let sources: Vec<bool> = waiting.iter().map(|&n| n == 0).collect();
    let mut layer = vec![0usize; count];
    let mut ready: Vec<usize> = (0..count).filter(|&item| waiting[item] == 0).collect();
    while let Some(item) = ready.pop() {
        for &(from, to) in edges.iter().filter(|(from, _)| *from == item) {
            layer[to] = layer[to].max(layer[from] + 1);
            waiting[to] -= 1;
            if waiting[to] == 0 {
                ready.push(to);
            }
        }
    }
    for item in (0..count).filter(|&item| sources[item]) {
        let first_reader = edges
            .iter()
            .filter(|(from, _)| *from == item)
            .map(|&(_, to)| layer[to])
            .min();
        layer[item] = first_reader.map_or(0, |reader| reader.saturating_sub(1));
    }
    layer
}

/// Splits edges at every layer they cross; the chain of an edge runs from its first to its last item.
fn insert_waypoints(mut layer: Vec<usize>, edges: &[(usize, usize)]) -> (Items, Vec<Vec<usize>>) {
    let mut chains = Vec::with_capacity(edges.len());
    for &(from, to) in edges {
        let mut chain = vec![from];
        for crossed in layer[from] + 1..layer[to].max(layer[from] + 1) {
            chain.push(layer.len());
            layer.push(crossed);
        }
        chain.push(to);
        chains.push(chain);
    }
    let mut items = Items {
        up: vec![Vec::new(); layer.len()],
        down: vec![Vec::new(); layer.len()],
        layer,
    };
    for pair in chains.iter().flat_map(|chain| chain.windows(2)) {
        items.down[pair[0]].push(pair[1]);
        items.up[pair[1]].push(pair[0]);
    }
    (items, chains)
}

/// The rows of items, each from left to right.
fn order(items: &Items) -> Vec<Vec<usize>> {
    let depth = items.layer.iter().max().map_or(0, |deepest| deepest + 1);
    let mut rows = vec![Vec::new(); depth];
    for (item, &layer) in items.layer.iter().enumerate() {
        rows[layer].push(item);
    }
    let mut best = (crossings(items, &rows), rows.clone());
    for sweep in 0..12 {
        let downwards = sweep % 2 == 0;
        let mut rank = vec![0.0; items.layer.len()];
        for (position, &item) in rows.iter().flat_map(|row| row.iter().enumerate()) {
            rank[item] = position as f64;
        }
        let mut visit: Vec<usize> = (0..depth).collect();
        if !downwards {
            visit.reverse();
        }
        for layer in visit {
            let neighbours = if downwards { &items.up } else { &items.down };
            let mut keyed: Vec<(f64, usize)> = rows[layer]
                .iter()
                .map(|&item| (mean(&neighbours[item], &rank).unwrap_or(rank[item]), item))
                .collect();
            keyed.sort_by(|a, b| a.0.total_cmp(&b.0));
            rows[layer] = keyed.into_iter().map(|(_, item)| item).collect();
            for (position, &item) in rows[layer].iter().enumerate() {
                rank[item] = position as f64;
            }
        }
        let now = crossings(items, &rows);
        if now < best.0 {
            best = (now, rows.clone());
        }
    }
    best.1
}

/// How many pairs of edges between neighbouring rows cross.
fn crossings(items: &Items, rows: &[Vec<usize>]) -> usize {
    let mut rank = vec![0; items.layer.len()];
    for (position, &item) in rows.iter().flat_map(|row| row.iter().enumerate()) {
        rank[item] = position;
    }
    rows.iter()
        .map(|row| {
            let spans: Vec<(usize, usize)> = row
                .iter()
                .flat_map(|&item| {
                    items.down[item]
                        .iter()
                        .map(|&below| (rank[item], rank[below]))
                        .collect::<Vec<_>>()
                })
                .collect();
            let mut crossed = 0;
            for (i, a) in spans.iter().enumerate() {
                crossed += spans[i + 1..]
                    .iter()
                    .filter(|b| (a.0 < b.0 && a.1 > b.1) || (a.0 > b.0 && a.1 < b.1))
                    .count();
            }
            crossed
        })
        .sum()
}

/// Horizontal centres of all items; the first `boxes` of them are boxes, the others waypoints.
///
/// They minimise Σ w (x_u − x_v)² over the edges, subject to order and distance in each row, by going from row to row and
/// placing each exactly ([`place_row`]). The weights are symmetric: anything else would slowly shear the drawing.
fn positions(items: &Items, rows: &[Vec<usize>], boxes: usize) -> Vec<f64> {
    let half = |item: usize| {
        if item < boxes {
            BOX.0 / 2.0
        } else {
            WAYPOINT_WIDTH / 2.0
        }
    };
    let gap = |a: usize, b: usize| if a < boxes && b < boxes { GAP.0 } else { WAYPOINT_GAP };
    let apart = |a: usize, b: usize| half(a) + half(b) + gap(a, b);
    // Chains of boxes hang straight; long edges bend around them.
    let stiffness = |a: usize, b: usize| match (a < boxes, b < boxes) {
        (true, true) => 8.0,
        (false, false) => 2.0,
        _ => 1.0,
    };
    let mut x = vec![0.0; items.layer.len()];
    for round in 0..SETTLE {
        for row in rows {
            let wishes: Vec<(f64, f64)> = row
                .iter()
                .map(|&item| {
                    let (mut sum, mut weight) = (0.0, 0.0);
                    for &neighbour in items.up[item].iter().chain(&items.down[item]) {
                        // In the first round nothing below has its place yet.
                        if round > 0 || items.layer[neighbour] < items.layer[item] {
                            let w = stiffness(item, neighbour);
                            sum += w * x[neighbour];
                            weight += w;
                        }
                    }
                    if weight > 0.0 {
                        (sum / weight, weight)
                    } else {
                        (x[item], 1e-3)
                    }
                })
                .collect();
            let gaps: Vec<f64> = row.windows(2).map(|pair| apart(pair[0], pair[1])).collect();
            for (&item, place) in row.iter().zip(place_row(&wishes, &gaps)) {
                x[item] = place;
            }
        }
    }
    x
}

/// The places nearest to the wishes (place, weight), least squares, that keep the gaps between neighbours: with the gaps
/// taken off, an isotonic regression, solved by pooling neighbours that want to pass each other.
fn place_row(wishes: &[(f64, f64)], gaps: &[f64]) -> Vec<f64> {
    let offsets: Vec<f64> = std::iter::once(0.0)
        .chain(gaps.iter().scan(0.0, |sum, gap| {
            *sum += gap;
            Some(*sum)
        }))
        .collect();
    // (mean, weight, number of items) of each pool, increasing.
    let mut pools: Vec<(f64, f64, usize)> = Vec::new();
    for (&(wish, weight), offset) in wishes.iter().zip(&offsets) {
        let mut pool = (wish - offset, weight, 1);
        while let Some(&(mean, weight, count)) = pools.last().filter(|last| last.0 > pool.0) {
            pool = (
                (mean * weight + pool.0 * pool.1) / (weight + pool.1),
                weight + pool.1,
                count + pool.2,
            );
            pools.pop();
        }
        pools.push(pool);
    }
    let means = pools
        .into_iter()
        .flat_map(|(mean, _, count)| std::iter::repeat_n(mean, count));
    means.zip(offsets).map(|(mean, offset)| mean + offset).collect()
}

fn mean(of: &[usize], values: &[f64]) -> Option<f64> {
    (!of.is_empty()).then(|| of.iter().map(|&i| values[i]).sum::<f64>() / of.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The edges of `graphs/gear.yaml`, in words: a chain with many edges that skip layers.
    const EDGES: [(usize, usize); 20] = [
        (0, 1),
        (0, 2),
        (0, 3),
        (1, 3),
        (2, 3),
        (3, 4),
        (4, 5),
        (1, 5),
        (5, 6),
        (4, 6),
        (6, 7),
        (0, 7),
        (2, 7),
        (7, 8),
        (2, 8),
        (8, 9),
        (9, 10),
        (0, 10),
        (2, 10),
        (10, 11),
    ];

    #[test]
    fn every_edge_points_down() {
        let layout = layout(12, &EDGES);
        for (from, to) in EDGES {
            assert!(layout.places[from].1 < layout.places[to].1, "{from} -> {to}");
        }
    }

    #[test]
    fn boxes_do_not_overlap_and_stay_inside() {
        let layout = layout(12, &EDGES);
        for (i, a) in layout.places.iter().enumerate() {
            assert!(a.0 - BOX.0 / 2.0 >= 0.0 && a.0 + BOX.0 / 2.0 <= layout.width);
            assert!(a.1 - BOX.1 / 2.0 >= 0.0 && a.1 + BOX.1 / 2.0 <= layout.height);
            for b in &layout.places[i + 1..] {
                let apart = (a.0 - b.0).abs() >= BOX.0 || (a.1 - b.1).abs() >= BOX.1;
                assert!(apart, "{a:?} {b:?}");
            }
        }
    }

    #[test]
    fn edges_run_between_boxes_not_through_them() {
        let layout = layout(12, &EDGES);
        for route in &layout.routes {
            for way in &route.points[1..route.points.len() - 1] {
                for place in &layout.places {
                    let outside = (way.0 - place.0).abs() > BOX.0 / 2.0 || (way.1 - place.1).abs() > BOX.1 / 2.0;
                    assert!(outside, "{route:?}");
                }
            }
        }
    }

    #[test]
    fn a_chain_beside_long_edges_hangs_straight() {
        let layout = layout(12, &EDGES);
        assert!(layout.width < 4.5 * BOX.0, "{}", layout.width);
        // 3 → 4 → 5 → 6 → 7 → 8 → 9 → 10 → 11, with edges passing on both sides.
        let drift = (layout.places[3].0 - layout.places[11].0).abs();
        assert!(drift < BOX.0, "{drift}");
    }

    #[test]
    fn what_wants_the_same_place_shares_it_fairly() {
        assert_eq!(place_row(&[(5.0, 1.0), (5.0, 1.0)], &[2.0]), [4.0, 6.0]);
        assert_eq!(place_row(&[(5.0, 3.0), (5.0, 1.0)], &[2.0]), [4.5, 6.5]);
        assert_eq!(place_row(&[(0.0, 1.0), (9.0, 1.0)], &[2.0]), [0.0, 9.0]);
    }

    #[test]
    fn a_cycle_ends() {
        assert_eq!(layout(3, &[(0, 1), (1, 2), (2, 0)]).places.len(), 3);
    }
}

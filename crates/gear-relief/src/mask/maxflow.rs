//! Maximum flow and minimum cut by the two-tree algorithm of Boykov and Kolmogorov (PAMI 2004).
//!
//! Two trees grow at once: S from the source along edges that still have room, T from the sink against them. Where
//! they touch there is an augmenting path: flow is pushed along it until an edge is full. Nodes whose edge
//! to their parent filled up are orphans; each looks for a new parent in its own tree, at the smallest
//! distance from the terminal that can be verified, and becomes free when there is none (its children are
//! orphans then). Keeping the trees between augmentations is what makes the method fast on grids: most
//! of a picture's tree survives each push.
//!
//! What must stay true:
//! * a node in S has a path of edges with room from the source through its parents; in T, to the sink;
//! * every node of a tree that has a free or foreign neighbour with room between them is in the active queue;
//! * capacities are integers, so that saturation is exact, the algorithm ends, and the cut has no tolerance;
//! * nodes are visited in an order that depends on the input alone: the same cut every time.
//!
//! There is no recursion: paths are walked by parent links, orphans wait in a queue.

use std::collections::VecDeque;

/// No edge, or no parent.
const NONE: u32 = u32::MAX;
/// The parent link of a node that hangs on its terminal.
const TERMINAL: u32 = u32::MAX - 1;
/// The parent link of an orphan.
const ORPHAN: u32 = u32::MAX - 2;

#[derive(Clone, Copy, PartialEq, Eq)]
enum Tree {
    Free,
    Source,
    Sink,
}

struct Edge {
    head: u32,
    next: u32,
    room: i32,
}

/// A flow network: nodes between a source and a sink.
pub struct Network {
    first: Vec<u32>,
    /// Edge 2k and 2k+1 are each other's reverse.
    edges: Vec<Edge>,
    /// Room from the source (positive) or to the sink (negative).
    terminal: Vec<i32>,
    parent: Vec<u32>,
    tree: Vec<Tree>,
    stamp: Vec<u32>,
    distance: Vec<u32>,
    queued: Vec<bool>,
    active: VecDeque<u32>,
    orphans: VecDeque<u32>,
    clock: u32,
    flow: i64,
}

impl Network {
    /// A network of `nodes` nodes without edges.
    pub fn new(nodes: usize, edges: usize) -> Self {
        Self {
            first: vec![NONE; nodes],
            edges: Vec::with_capacity(2 * edges),
            terminal: vec![0; nodes],
            parent: vec![NONE; nodes],
            tree: vec![Tree::Free; nodes],
            stamp: vec![0; nodes],
            distance: vec![0; nodes],
            queued: vec![false; nodes],
            active: VecDeque::new(),
            orphans: VecDeque::new(),
            clock: 0,
            flow: 0,
        }
    }

    /// Links `node` with the terminals: capacities from the source and to the sink, not negative.
    pub fn link_terminals(&mut self, node: usize, from_source: i32, to_sink: i32) {
        self.flow += i64::from(from_source.min(to_sink));
        self.terminal[node] += from_source - to_sink;
    }

    /// Links two nodes: capacities there and back, not negative.
    pub fn link(&mut self, a: usize, b: usize, there: i32, back: i32) {
        for (tail, head, room) in [(a, b, there), (b, a, back)] {
            let edge = self.edges.len() as u32;
            self.edges.push(Edge {
                head: head as u32,
                next: self.first[tail],
                room,
            });
            self.first[tail] = edge;
        }
    }

    /// Pushes all the flow there is and returns its value.
    pub fn solve(&mut self) -> i64 {
        for node in 0..self.terminal.len() {
            if self.terminal[node] != 0 {
                self.tree[node] = if self.terminal[node] > 0 {
                    Tree::Source
                } else {
                    Tree::Sink
                };
                self.parent[node] = TERMINAL;
                self.distance[node] = 1;
                self.activate(node);
            }
        }
        while let Some(&node) = self.active.front() {
            let node = node as usize;
            if self.tree[node] == Tree::Free {
                self.retire(node);
                continue;
            }
            match self.grow(node) {
                None => self.retire(node),
                Some(bridge) => {
                    self.clock += 1;
                    self.augment(bridge);
                    while let Some(orphan) = self.orphans.pop_front() {
                        self.adopt(orphan as usize);
                    }
                }
            }
        }
        self.flow
    }

    /// After [`solve`](Self::solve): is `node` on the source's side of the cut? Nodes that neither terminal reaches
    /// are on the sink's.
    pub fn on_source_side(&self, node: usize) -> bool {
        self.tree[node] == Tree::Source
    }

    fn activate(&mut self, node: usize) {
        if !self.queued[node] {
            self.queued[node] = true;
            self.active.push_back(node as u32);
        }
    }

    fn retire(&mut self, node: usize) {
        self.queued[node] = false;
        self.active.pop_front();
    }

    /// Room along `edge` in the direction in which flow runs through a node of `tree`: away from it in S, towards
    /// it in T.
    fn room(&self, tree: Tree, edge: u32) -> i32 {
        let along = if tree == Tree::Source { edge } else { edge ^ 1 };
        self.edges[along as usize].room
    }

    /// Takes free neighbours into the node's tree; returns the edge (source side to sink side) where it meets the
    /// other tree.
    fn grow(&mut self, node: usize) -> Option<u32> {
        let tree = self.tree[node];
        let mut edge = self.first[node];
        while edge != NONE {
            let Edge { head, next, .. } = self.edges[edge as usize];
            let other = head as usize;
            if self.room(tree, edge) > 0 {
                if self.tree[other] == Tree::Free {
                    self.tree[other] = tree;
                    self.parent[other] = edge ^ 1;
                    self.stamp[other] = self.stamp[node];
                    self.distance[other] = self.distance[node] + 1;
                    self.activate(other);
                } else if self.tree[other] != tree {
                    return Some(if tree == Tree::Source { edge } else { edge ^ 1 });
                } else if self.stamp[other] <= self.stamp[node] && self.distance[other] > self.distance[node] {
                    // a shorter way to the terminal
                    self.parent[other] = edge ^ 1;
                    self.stamp[other] = self.stamp[node];
                    self.distance[other] = self.distance[node] + 1;
                }
            }
            edge = next;
        }
        None
    }

    /// Pushes along the path through `bridge`; nodes behind edges that fill up become orphans.
    fn augment(&mut self, bridge: u32) {
        let (tail, head) = (
            self.edges[(bridge ^ 1) as usize].head as usize,
            self.edges[bridge as usize].head as usize,
        );
        let mut push = self.edges[bridge as usize].room;
        for (start, tree) in [(tail, Tree::Source), (head, Tree::Sink)] {
            let mut node = start;
            while self.parent[node] != TERMINAL {
                let up = self.parent[node];
                push = push.min(self.room(tree, up ^ 1));
                node = self.edges[up as usize].head as usize;
            }
            push = push.min(self.terminal[node].abs());
        }
        self.edges[bridge as usize].room -= push;
        self.edges[(bridge ^ 1) as usize].room += push;
        for (start, tree) in [(tail, Tree::Source), (head, Tree::Sink)] {
            let mut node = start;
            while self.parent[node] != TERMINAL {
                let up = self.parent[node];
                // in S flow runs from the parent to the node, in T from the node to the parent
                let along = if tree == Tree::Source { up ^ 1 } else { up };
                self.edges[along as usize].room -= push;
                self.edges[(along ^ 1) as usize].room += push;
                let above = self.edges[up as usize].head as usize;
                if self.edges[along as usize].room == 0 {
                    self.orphan(node);
                }
                node = above;
            }
            self.terminal[node] -= if tree == Tree::Source { push } else { -push };
            if self.terminal[node] == 0 {
                self.orphan(node);
            }
        }
        self.flow += i64::from(push);
    }

    fn orphan(&mut self, node: usize) {
        self.parent[node] = ORPHAN;
        self.orphans.push_back(node as u32);
    }

    /// Distance of `node` from its terminal if its parents lead there; stamps are set by the caller.
    fn verified_distance(&self, start: usize) -> Option<u32> {
        let (mut node, mut steps) = (start, 0);
        loop {
            if self.stamp[node] == self.clock {
                return Some(steps + self.distance[node]);
            }
            steps += 1;
            match self.parent[node] {
                TERMINAL => return Some(steps),
                ORPHAN | NONE => return None,
                up => node = self.edges[up as usize].head as usize,
            }
        }
    }

    /// Marks the verified path above `start`, so that later searches stop early.
    fn mark_path(&mut self, start: usize, mut distance: u32) {
        let mut node = start;
        while self.stamp[node] != self.clock {
            self.stamp[node] = self.clock;
            self.distance[node] = distance;
            distance -= 1;
            match self.parent[node] {
                TERMINAL => break,
                up => node = self.edges[up as usize].head as usize,
            }
        }
    }

    /// Finds the orphan a new parent, or sets it free.
    fn adopt(&mut self, node: usize) {
        let tree = self.tree[node];
        let mut best: Option<(u32, u32)> = None;
        let mut edge = self.first[node];
        while edge != NONE {
            let Edge { head, next, .. } = self.edges[edge as usize];
            let other = head as usize;
            // flow must run from the new parent to the node in S, from the node to it in T
            if self.tree[other] == tree
                && self.room(tree, edge ^ 1) > 0
                && let Some(distance) = self.verified_distance(other)
            {
                if best.is_none_or(|(_, least)| distance < least) {
                    best = Some((edge, distance));
                }
                self.mark_path(other, distance);
            }
            edge = next;
        }
        if let Some((edge, distance)) = best {
            self.parent[node] = edge;
            self.stamp[node] = self.clock;
            self.distance[node] = distance + 1;
            return;
        }
        self.parent[node] = NONE;
        self.tree[node] = Tree::Free;
        let mut edge = self.first[node];
        while edge != NONE {
            let Edge { head, next, .. } = self.edges[edge as usize];
            let other = head as usize;
            if self.tree[other] == tree {
                if self.room(tree, edge ^ 1) > 0 {
                    self.activate(other);
                }
                let up = self.parent[other];
                if up < ORPHAN && self.edges[up as usize].head as usize == node {
                    self.orphan(other);
                }
            }
            edge = next;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Ford–Fulkerson with breadth-first search on a capacity matrix: slow and obvious.
    mod oracle {
        pub fn max_flow(mut capacity: Vec<Vec<i64>>, source: usize, sink: usize) -> (i64, Vec<bool>) {
            let n = capacity.len();
            let mut total = 0;
            loop {
                let mut from = vec![usize::MAX; n];
                from[source] = source;
                let mut queue = vec![source];
                let mut at = 0;
                while at < queue.len() {
                    let a = queue[at];
                    at += 1;
                    for b in 0..n {
                        if capacity[a][b] > 0 && from[b] == usize::MAX {
                            from[b] = a;
                            queue.push(b);
                        }
                    }
                }
                if from[sink] == usize::MAX {
                    return (total, from.iter().map(|f| *f != usize::MAX).collect());
                }
                let mut push = i64::MAX;
                let mut b = sink;
                while b != source {
                    push = push.min(capacity[from[b]][b]);
                    b = from[b];
                }
                let mut b = sink;
                while b != source {
                    capacity[from[b]][b] -= push;
                    capacity[b][from[b]] += push;
                    b = from[b];
                }
                total += push;
            }
        }
    }

    fn cut_value(matrix: &[Vec<i64>], side: impl Fn(usize) -> bool) -> i64 {
        let n = matrix.len();
        let mut value = 0;
        for a in 0..n {
            for b in 0..n {
                if side(a) && !side(b) {
                    value += matrix[a][b];
                }
            }
        }
        value
    }

    fn check(nodes: usize, terminals: &[(i32, i32)], links: &[(usize, usize, i32, i32)]) -> Result<(), TestCaseError> {
        let mut network = Network::new(nodes, links.len());
        let (source, sink) = (nodes, nodes + 1);
        let mut matrix = vec![vec![0i64; nodes + 2]; nodes + 2];
        for (node, &(from, to)) in terminals.iter().enumerate() {
            network.link_terminals(node, from, to);
            matrix[source][node] += i64::from(from);
            matrix[node][sink] += i64::from(to);
        }
        for &(a, b, there, back) in links.iter().filter(|l| l.0 != l.1) {
            network.link(a, b, there, back);
            matrix[a][b] += i64::from(there);
            matrix[b][a] += i64::from(back);
        }
        let flow = network.solve();
        let (expected, _) = oracle::max_flow(matrix.clone(), source, sink);
        prop_assert_eq!(flow, expected);
        // the cut that is returned has the flow's value: it is a minimum cut
        let side = |n: usize| n == source || (n < nodes && network.on_source_side(n));
        prop_assert_eq!(cut_value(&matrix, side), flow);
        Ok(())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(300))]

        #[test]
        fn flow_and_cut_agree_with_ford_fulkerson(
            nodes in 1usize..14,
            raw in prop::collection::vec((0i32..20, 0i32..20), 14),
            links in prop::collection::vec((0usize..14, 0usize..14, 0i32..12, 0i32..12), 0..60),
        ) {
            let links: Vec<_> = links.into_iter().map(|(a, b, c, d)| (a % nodes, b % nodes, c, d)).collect();
            check(nodes, &raw[..nodes], &links)?;
        }

        #[test]
        fn grids_agree_too(
            terminals in prop::collection::vec((0i32..9, 0i32..9), 36),
            weights in prop::collection::vec(0i32..7, 60),
        ) {
            let mut links = Vec::new();
            let mut weight = weights.iter().cycle();
            for y in 0..6usize {
                for x in 0..6usize {
                    for (dx, dy) in [(1, 0), (0, 1)] {
                        if x + dx < 6 && y + dy < 6 {
                            let w = *weight.next().unwrap();
                            links.push((y * 6 + x, (y + dy) * 6 + x + dx, w, w));
                        }
                    }
                }
            }
            check(36, &terminals, &links)?;
        }
    }

    #[test]
    fn an_empty_network_carries_nothing() {
        assert_eq!(Network::new(0, 0).solve(), 0);
        assert_eq!(Network::new(3, 0).solve(), 0);
    }
}

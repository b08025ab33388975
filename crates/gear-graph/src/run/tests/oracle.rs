//! Random graphs against a naive evaluator: values, and what may be left out.

use std::collections::BTreeSet;
use std::fmt::Write;

use proptest::prelude::*;

use super::kit::*;
use crate::*;

/// A node that reads earlier nodes only.
#[derive(Clone, Debug)]
enum Kind {
    Add {
        of: Vec<usize>,
        plus: i8,
    },
    Choose {
        a: usize,
        b: usize,
        c: Option<usize>,
        threshold: i8,
    },
}

/// The number of node `i`; 0 is the graph input.
fn value(nodes: &[Kind], x: f64, i: usize) -> f64 {
    let Some(node) = i.checked_sub(1).map(|i| &nodes[i]) else {
        return x;
    };
    match node {
        Kind::Add { of, plus } => of.iter().fold(f64::from(*plus), |sum, i| sum + value(nodes, x, *i)),
        Kind::Choose { a, b, c, threshold } => {
            let a = value(nodes, x, *a);
            if a <= f64::from(*threshold) {
                return a;
            }
            let b = value(nodes, x, *b);
            match c {
                Some(c) if b < 0.0 => value(nodes, x, *c),
                _ => b,
            }
        }
    }
}

/// The nodes that have to run for node `i`, by the definition of demand.
fn needed(nodes: &[Kind], x: f64, i: usize, found: &mut BTreeSet<usize>) {
    let Some(node) = i.checked_sub(1).map(|i| &nodes[i]) else {
        return;
    };
    if !found.insert(i) {
        return;
    }
    match node {
        Kind::Add { of, .. } => of.iter().for_each(|i| needed(nodes, x, *i, found)),
        Kind::Choose { a, b, c, threshold } => {
            needed(nodes, x, *a, found);
            if value(nodes, x, *a) > f64::from(*threshold) {
                needed(nodes, x, *b, found);
                if let Some(c) = c
                    && value(nodes, x, *b) < 0.0
                {
                    needed(nodes, x, *c, found);
                }
            }
        }
    }
}

fn yaml(nodes: &[Kind]) -> String {
    let name = |i: usize| match (i.checked_sub(1), i.checked_sub(1).map(|i| &nodes[i])) {
        (None, _) | (_, None) => "x".to_string(),
        (_, Some(Kind::Add { .. })) => format!("n{i}.sum"),
        (_, Some(Kind::Choose { .. })) => format!("n{i}.chosen"),
    };
    let mut text = String::from("gear: 1\ninputs: {x: Number}\nnodes:\n");
    for (i, node) in nodes.iter().enumerate() {
        let i = i + 1;
        let _ = match node {
            Kind::Add { of, plus } => {
                let of: Vec<_> = of.iter().map(|i| name(*i)).collect();
                writeln!(
                    text,
                    "  n{i}: {{node: Add, in: {{of: [{}]}}, with: {{plus: {plus}}}}}",
                    of.join(", ")
                )
            }
            Kind::Choose { a, b, c, threshold } => {
                let c = c.map(|c| format!(", c: {}", name(c))).unwrap_or_default();
                writeln!(
                    text,
                    "  n{i}: {{node: Choose, in: {{a: {}, b: {}{c}}}, with: {{when: {{above: {{threshold: {threshold}}}}}}}}}",
                    name(*a),
                    name(*b),
                )
            }
        };
    }
    let _ = writeln!(text, "outputs: {{y: {}}}", name(nodes.len()));
    text
}

fn kinds() -> impl Strategy<Value = Vec<Kind>> {
    let kind =
        |i: usize| {
            let any = 0..=i;
            prop_oneof![
                (prop::collection::vec(any.clone(), 1..4), -5i8..5).prop_map(|(of, plus)| Kind::Add { of, plus }),
                (any.clone(), any.clone(), prop::option::of(any), -8i8..8)
                    .prop_map(|(a, b, c, threshold)| Kind::Choose { a, b, c, threshold }),
            ]
        };
    (1usize..14).prop_flat_map(move |n| (0..n).map(kind).collect::<Vec<_>>())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, ..ProptestConfig::default() })]

    #[test]
    fn a_run_computes_the_right_value_and_nothing_that_is_not_needed(
        nodes in kinds(), x in -6i8..6, y in -6i8..6, lost in any::<bool>(),
    ) {
        let graph = GraphSource::new("random.yaml", yaml(&nodes)).check(&registry()).unwrap();
        let shelf = Shelf::new();
        let last = nodes.len();
        let go = |x: f64| Run::new(&graph).store(shelf.open()).input_value("x", Number(x)).go().unwrap();
        let expected = |x: f64| {
            let mut found = BTreeSet::new();
            needed(&nodes, x, last, &mut found);
            found.into_iter().map(|i| format!("n{i}")).collect::<BTreeSet<_>>()
        };
        let ran = |outcome: &Outcome<'_>| outcome.report.ran().into_iter().map(String::from).collect::<BTreeSet<_>>();

        // Cold: exactly what is needed, as far as nothing equal was stored by an earlier node of the same run.
        let x = f64::from(x);
        let cold = go(x);
        prop_assert_eq!(number(&cold, "y"), value(&nodes, x, last));
        prop_assert!(ran(&cold).is_subset(&expected(x)), "{:?} {:?}", ran(&cold), expected(x));

        // Without a store: the same, and exactly what is needed.
        let bare = Run::new(&graph).input_value("x", Number(x)).go().unwrap();
        prop_assert_eq!(bare.digest("y"), cold.digest("y"));
        prop_assert_eq!(ran(&bare), expected(x));

        // Warm: nothing. With another input, or with contents lost: right again.
        prop_assert!(go(x).report.ran().is_empty());
        if lost {
            shelf.evict_contents();
        }
        let other = go(f64::from(y));
        prop_assert_eq!(number(&other, "y"), value(&nodes, f64::from(y), last));

        // The plan of the bare run: what it says is left out does not run.
        let plan = Run::new(&graph).input_value("x", Number(x)).plan().unwrap();
        for node in plan.nodes.iter().filter(|node| !node.input) {
            let runs = ran(&bare).contains(&node.id);
            match node.state {
                PlannedState::Runs => prop_assert!(runs, "{} is said to run", node.id),
                PlannedState::LeftOut | PlannedState::Cached => prop_assert!(!runs, "{} is said not to run", node.id),
                _ => {}
            }
        }
    }
}

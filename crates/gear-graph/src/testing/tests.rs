//! The kit finds what it is made to find: each node here breaks one promise.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use super::*;
use crate::{Demand, Known, Lazy, Number, Registry, Report, Wanted};

/// How a node misbehaves.
#[derive(Clone, Copy, Debug, PartialEq, crate::Choice)]
enum Way {
    /// Not at all.
    Well,
    /// Another number each time.
    Counts,
    /// Another number on another number of threads.
    Threads,
    /// The value of one output depends on the other.
    Jealous,
    /// A partial result when interrupted.
    Hasty,
    /// Panics on infinity.
    Panics,
    /// Gives NaN.
    Nan,
    /// Reads what it did not demand.
    Greedy,
    /// Its result changes when it is given what it did not demand.
    Peeks,
    /// Asks for what is known.
    Nags,
}

/// A node that misbehaves in one way.
#[derive(Clone, Debug, Params)]
struct Odd {
    /// The way.
    #[param(default = Way::Well)]
    way: Way,
}

#[derive(crate::Inputs)]
struct In {
    /// A number.
    a: Arc<Number>,
    /// A number that is needed only if `a` is positive.
    b: Lazy<Number>,
}

#[derive(crate::Outputs)]
struct Out {
    /// The result.
    sum: Wanted<Number>,
    /// What it is made of.
    report: Wanted<Report>,
}

impl Node for Odd {
    const NAME: &str = "Odd";
    const VERSION: u32 = 1;
    type Inputs = In;
    type Outputs = Out;

    fn demand(&self, _: &str, known: &Known<'_>) -> Result<Demand, NodeError> {
        if self.way == Way::Nags {
            return Ok(Demand::need(&["a"], "asked again"));
        }
        Ok(if self.way != Way::Greedy && known.get::<Number>("a")?.0 > 0.0 {
            known.need(&["b"], "a > 0")
        } else {
            Demand::ready_because("a <= 0")
        })
    }

    fn run(&self, inputs: In, want: &Want, ctx: &Context) -> Result<Out, NodeError> {
        static RUNS: AtomicU64 = AtomicU64::new(0);
        let a = inputs.a.0;
        let b = match self.way {
            Way::Greedy => inputs.b.demanded()?.0,
            Way::Peeks => inputs.b.get().map_or(0.0, |b| b.0),
            _ if a > 0.0 => inputs.b.demanded()?.0,
            _ => 0.0,
        };
        if self.way != Way::Nan && (a + b).is_nan() {
            return Err(NodeError::input("a", "expected numbers with a sum"));
        }
        ctx.progress(0.5);
        let extra = match self.way {
            Way::Counts => RUNS.fetch_add(1, Ordering::Relaxed) as f64,
            Way::Threads => rayon::current_num_threads() as f64,
            Way::Jealous if want.has("report") => 1.0,
            Way::Hasty if ctx.is_cancelled() => 1.0,
            Way::Panics if a.is_infinite() => panic!("a is {a}"),
            _ => 0.0,
        };
        Ok(Out {
            sum: want.compute("sum", || Number(a + b + extra)),
            report: want.try_compute("report", || {
                Report::new(serde_json::json!({"b": inputs.b.get().is_some() && a > 0.0}))
            })?,
        })
    }
}

fn odd(way: Way) -> Odd {
    Odd { way }
}

fn inputs() -> In {
    In {
        a: Arc::new(Number(1.0)),
        b: Lazy::given(Number(2.0)),
    }
}

/// The message of the panic.
fn complaint(check: impl FnOnce() + std::panic::UnwindSafe) -> String {
    let cause = std::panic::catch_unwind(check).expect_err("the kit has found nothing");
    cause.downcast_ref::<String>().cloned().unwrap_or_default()
}

#[test]
fn a_node_that_behaves_passes() {
    assert_pure(&odd(Way::Well), inputs);
    assert_extremes(&odd(Way::Well));
    assert_extremes_around(&odd(Way::Well), inputs());
}

#[test]
fn broken_purity_is_found() {
    for (way, expected) in [
        (Way::Counts, "on 1 threads gives other bits"),
        (Way::Threads, "on 2 threads gives other bits"),
        (Way::Jealous, "output `sum` of Odd depends on what else is wanted"),
        (Way::Hasty, "interrupted, gives another result"),
    ] {
        let found = complaint(move || assert_pure(&odd(way), inputs));
        assert!(found.contains(expected), "{way:?}: {found}");
    }
}

#[test]
fn faults_on_extremes_are_found_and_the_cases_are_named() {
    for (way, expected) in [
        (Way::Panics, "a = infinite, b = zero: panics: a is inf"),
        (Way::Nan, "a = nan, b = nan: `sum` is not a number"),
        (Way::Counts, "on one thread"),
        (Way::Greedy, "that its `demand` did not ask for"),
        (
            Way::Peeks,
            "gives other bits when it is given `b`, which it did not demand",
        ),
        (Way::Nags, "`demand` asks for [\"a\"]"),
    ] {
        let found = complaint(move || assert_extremes(&odd(way)));
        assert!(found.contains("extreme cases"), "{way:?}: {found}");
        assert!(found.contains(expected), "{way:?}: {found}");
    }
}

#[test]
fn every_method_of_a_registered_type_is_tried() {
    let mut registry = Registry::new();
    registry.node::<Odd>();
    let node_type = registry.find_node("Odd").expect("it was registered");
    let titles: Vec<_> = Subject::with_every_method(node_type, &serde_json::json!({}))
        .into_iter()
        .map(|s| s.title)
        .collect();
    assert_eq!(titles.len(), 10);
    assert_eq!(titles[..2], ["Odd", "Odd with way: counts"]);
    let found = complaint(|| assert_type(&node_type.clone(), &serde_json::json!({})));
    for way in ["counts", "panics", "nan"] {
        assert!(
            found.contains(&format!("Odd with way: {way} breaks its promises")),
            "{found}"
        );
    }
}

#[test]
fn summaries_are_told_by_port() {
    let out = run_wanting(&odd(Way::Well), inputs(), &["sum"]).unwrap();
    assert_eq!(
        summaries(out),
        serde_json::json!({"sum": {"value": 3.0}, "report": null})
    );
}

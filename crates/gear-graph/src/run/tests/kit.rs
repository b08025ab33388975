//! Nodes, a loader and shorthands for the tests.

use std::sync::Arc;

use crate::*;

/// Sum of numbers, plus an offset.
#[derive(Clone, Debug, Params)]
pub struct Add {
    /// Added to the sum.
    #[param(default = 0.0)]
    pub plus: f64,
}

#[derive(Inputs)]
pub struct AddIn {
    /// The numbers.
    pub of: Vec<Arc<Number>>,
}

#[derive(Outputs)]
pub struct AddOut {
    /// The sum.
    pub sum: Arc<Number>,
}

impl Node for Add {
    const NAME: &str = "Add";
    const VERSION: u32 = 1;
    type Inputs = AddIn;
    type Outputs = AddOut;

    fn run(&self, inputs: AddIn, _: &Want, _: &Context) -> Result<AddOut, NodeError> {
        let sum = inputs.of.iter().fold(self.plus, |sum, x| sum + x.0);
        Ok(AddOut {
            sum: Arc::new(Number(sum)),
        })
    }
}

/// Takes `a`, or `b` when `a` is above a threshold (or always, or never).
#[derive(Clone, Debug, Params)]
pub struct Choose {
    /// When `b` is taken.
    #[param(default = When::Above { threshold: 10.0 })]
    pub when: When,
}

#[derive(Clone, Debug, PartialEq, Choice)]
pub enum When {
    /// Never.
    Never,
    /// Always.
    Always,
    /// When `a` is above.
    Above {
        /// The threshold.
        #[param(default = 10.0)]
        threshold: f64,
    },
}

#[derive(Inputs)]
pub struct ChooseIn {
    /// Always looked at.
    pub a: Arc<Number>,
    /// Looked at when needed.
    pub b: Lazy<Number>,
    /// Looked at when `b` was looked at and is negative.
    pub c: Option<Lazy<Number>>,
}

#[derive(Outputs)]
pub struct ChooseOut {
    /// The choice.
    pub chosen: Wanted<Number>,
    /// Twice `a`; needs nothing else.
    pub twice: Wanted<Number>,
}

impl Node for Choose {
    const NAME: &str = "Choose";
    const VERSION: u32 = 1;
    type Inputs = ChooseIn;
    type Outputs = ChooseOut;

    fn demand(&self, output: &str, known: &Known<'_>) -> Result<Demand, NodeError> {
        if output == "twice" {
            return Ok(Demand::ready_because("only a is doubled"));
        }
        if known.has("b") {
            if known.is_wired("c") && !known.has("c") && known.get::<Number>("b")?.0 < 0.0 {
                return Ok(Demand::need(&["c"], "b is negative"));
            }
            return Ok(Demand::ready_because("b is not negative"));
        }
        Ok(match self.when {
            When::Never => Demand::ready_because("never"),
            When::Always => Demand::need(&["b"], "always"),
            When::Above { threshold } if known.get::<Number>("a")?.0 > threshold => {
                Demand::need(&["b"], "a is above the threshold")
            }
            When::Above { .. } => Demand::ready_because("a is not above the threshold"),
        })
    }

    fn run(&self, inputs: ChooseIn, want: &Want, _: &Context) -> Result<ChooseOut, NodeError> {
        let c = inputs.c.as_ref().and_then(|c| c.get());
        let chosen = c.or(inputs.b.get()).map_or(inputs.a.0, |x| x.0);
        Ok(ChooseOut {
            chosen: want.compute("chosen", || Number(chosen)),
            twice: want.compute("twice", || Number(2.0 * inputs.a.0)),
        })
    }
}

/// Rounds down, and keeps the rest.
#[derive(Clone, Debug, Params)]
pub struct Floor {}

#[derive(Inputs)]
pub struct FloorIn {
    /// Any number.
    pub x: Arc<Number>,
}

#[derive(Outputs)]
pub struct FloorOut {
    /// The whole part.
    pub whole: Wanted<Number>,
    /// The rest.
    pub rest: Wanted<Number>,
    /// Many bytes that depend on the whole part only, so that they do not fit into a record.
    pub large: Wanted<Report>,
}

impl Node for Floor {
    const NAME: &str = "Floor";
    const VERSION: u32 = 1;
    type Inputs = FloorIn;
    type Outputs = FloorOut;

    fn run(&self, inputs: FloorIn, want: &Want, ctx: &Context) -> Result<FloorOut, NodeError> {
        let x = inputs.x.0;
        if x < 0.0 {
            ctx.note("negative numbers round away from zero");
        }
        let large = || Report(serde_json::json!({ "whole": x.floor(), "filling": "x".repeat(20_000) }));
        Ok(FloorOut {
            whole: want.compute("whole", || Number(x.floor())),
            rest: want.compute("rest", || Number(x - x.floor())),
            large: want.compute("large", large),
        })
    }
}

/// Reads the large report of `Floor`.
#[derive(Clone, Debug, Params)]
pub struct Measure {
    /// Added to the length.
    #[param(default = 0)]
    pub plus: u32,
}

#[derive(Inputs)]
pub struct MeasureIn {
    /// The report.
    pub report: Arc<Report>,
}

#[derive(Outputs)]
pub struct MeasureOut {
    /// Length of its text.
    pub length: Arc<Number>,
}

impl Node for Measure {
    const NAME: &str = "Measure";
    const VERSION: u32 = 1;
    type Inputs = MeasureIn;
    type Outputs = MeasureOut;

    fn run(&self, inputs: MeasureIn, _: &Want, _: &Context) -> Result<MeasureOut, NodeError> {
        let length = inputs.report.0["filling"].as_str().map_or(0, str::len);
        Ok(MeasureOut {
            length: Arc::new(Number(length as f64 + f64::from(self.plus))),
        })
    }
}

/// Does not do well.
#[derive(Clone, Debug, Params)]
pub struct Trouble {
    /// What goes wrong.
    #[param(default = Kind::Error)]
    pub kind: Kind,
}

#[derive(Clone, Copy, Debug, PartialEq, Choice)]
pub enum Kind {
    /// It says why.
    Error,
    /// It panics.
    Panic,
    /// It waits until it is interrupted.
    Wait,
    /// It waits and does not look whether it is interrupted.
    Deaf,
    /// It does not compute what is wanted.
    Forget,
}

#[derive(Outputs)]
pub struct TroubleOut {
    /// Never there.
    pub never: Wanted<Number>,
}

impl Node for Trouble {
    const NAME: &str = "Trouble";
    const VERSION: u32 = 1;
    type Inputs = FloorIn;
    type Outputs = TroubleOut;

    fn run(&self, inputs: FloorIn, _: &Want, ctx: &Context) -> Result<TroubleOut, NodeError> {
        match self.kind {
            Kind::Error => Err(NodeError::because(
                format!("{} is no good", inputs.x.0),
                NodeError::input("x", "expected better"),
            )),
            Kind::Panic => panic!("the node is broken"),
            Kind::Wait => loop {
                ctx.checkpoint()?;
                ctx.progress(0.5);
                std::thread::sleep(std::time::Duration::from_millis(5));
            },
            Kind::Deaf => loop {
                std::thread::sleep(std::time::Duration::from_millis(5));
            },
            Kind::Forget => Ok(TroubleOut {
                never: Wanted::skipped(),
            }),
        }
    }
}

/// Gives another number each time.
#[derive(Clone, Debug, Params)]
pub struct Dice {}

impl Node for Dice {
    const NAME: &str = "Dice";
    const VERSION: u32 = 1;
    const DETERMINISTIC: bool = false;
    type Inputs = ();
    type Outputs = AddOut;

    fn run(&self, (): (), _: &Want, _: &Context) -> Result<AddOut, NodeError> {
        use std::sync::atomic::{AtomicU32, Ordering};
        static THROWS: AtomicU32 = AtomicU32::new(0);
        Ok(AddOut {
            sum: Arc::new(Number(f64::from(THROWS.fetch_add(1, Ordering::Relaxed)))),
        })
    }
}

/// Reads a number from a text file.
#[derive(Clone, Debug, Params)]
pub struct NumberText {
    /// Multiplies the number.
    #[param(default = 1.0)]
    pub scale: f64,
}

impl Loader for NumberText {
    const VERSION: u32 = 1;
    type Value = Number;

    fn load(&self, file: &FileSource, ctx: &Context) -> Result<Number, NodeError> {
        let bytes = file.read()?;
        let text = String::from_utf8_lossy(&bytes);
        let number: f64 = text
            .trim()
            .parse()
            .map_err(|_| NodeError::new(format!("expected a number, found `{}`", text.trim())))?;
        if number == 0.0 {
            ctx.note("zero is an odd number to give");
        }
        Ok(Number(number * self.scale))
    }
}

pub fn registry() -> Registry {
    let mut registry = Registry::new();
    registry
        .node::<Add>()
        .node::<Choose>()
        .node::<Floor>()
        .node::<Measure>()
        .node::<Trouble>()
        .node::<Dice>()
        .node::<Ranged>()
        .loader::<NumberText>();
    registry
}

pub fn graph(body: &str) -> Graph {
    graph_set(body, &[])
}

pub fn graph_set(body: &str, set: &[&str]) -> Graph {
    let mut source = GraphSource::new("test.yaml", format!("gear: 1\n{body}"));
    source.set = set.iter().map(ToString::to_string).collect();
    source.check(&registry()).unwrap()
}

pub fn number(outcome: &Outcome<'_>, output: &str) -> f64 {
    let value = outcome.value(output).unwrap_or_else(|| panic!("{:#?}", outcome.report));
    value.get::<Number>().unwrap().0
}

/// A store in a folder that goes away with it.
pub struct Shelf(tempfile::TempDir);

impl Shelf {
    pub fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub fn path(&self) -> &std::path::Path {
        self.0.path()
    }

    pub fn open(&self) -> Arc<Store> {
        Arc::new(Store::open(self.0.path()))
    }

    /// Removes all contents, as an eviction would, and leaves the records.
    pub fn evict_contents(&self) {
        std::fs::remove_dir_all(self.0.path().join("contents")).unwrap();
    }
}

/// Has parameters of all kinds with ranges.
#[derive(Clone, Debug, Params)]
pub struct Ranged {
    /// A share.
    #[param(default = 0.5, range = 0.0..=1.0, unit = "share of the longer side")]
    pub share: f64,
    /// A count.
    #[param(default = 3, range = 1..=9)]
    pub count: u32,
    /// A list.
    #[param(default = vec![], range = -90.0..=90.0, unit = "degrees")]
    pub list: Vec<f64>,
    /// A number or `auto`.
    #[param(default = OrAuto::Auto, above = 0.0, below = 1.0)]
    pub auto: OrAuto<f64>,
    /// A flag.
    #[param(default = false)]
    pub flag: bool,
    /// Not above `high`.
    #[param(default = 0.0)]
    pub low: f64,
    /// Not below `low`.
    #[param(default = 1.0)]
    pub high: f64,
}

impl Node for Ranged {
    const NAME: &str = "Ranged";
    const VERSION: u32 = 1;
    type Inputs = FloorIn;
    type Outputs = FloorOut;

    fn check(&self) -> Result<(), NodeError> {
        if self.low > self.high {
            return Err(NodeError::param(
                "low",
                format!("must not be above high = {}, found {}", self.high, self.low),
            ));
        }
        Ok(())
    }

    fn run(&self, inputs: FloorIn, want: &Want, ctx: &Context) -> Result<FloorOut, NodeError> {
        Floor {}.run(inputs, want, ctx)
    }
}

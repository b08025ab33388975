//! Parameters: one definition, read, written and described.

use serde_json::json;

use crate::testing::read;
use crate::*;

/// Every kind of parameter.
///
/// The second paragraph.
#[derive(Clone, Debug, PartialEq, Params)]
struct All {
    /// A flag.
    #[param(default = true)]
    flag: bool,
    /// A count.
    #[param(default = 3, range = 1..=9, unit = "views")]
    count: u32,
    /// A share.
    #[param(default = 0.1, range = 0.0..=1.0)]
    share: f32,
    /// A text.
    #[param(default = String::from("x"))]
    text: String,
    /// A rectangle.
    r#box: Option<[f64; 4]>,
    /// A list.
    #[param(default = vec![-90, 90], range = -180..=180)]
    yaws: Vec<i32>,
    /// A method.
    #[param(default = Method::Plain)]
    method: Method,
    /// A number or `auto`.
    #[param(default = OrAuto::Auto, range = -4.0..=4.0)]
    beta: OrAuto<f64>,
}

#[derive(Clone, Debug, PartialEq, Choice)]
enum Method {
    /// The plain one.
    Plain,
    /// Canny's.
    #[choice(name = "canny-1986")]
    Canny {
        /// Lower threshold.
        #[param(default = 0.1, range = 0.0..=1.0)]
        low: f64,
    },
    /// Needs a parameter.
    TwoWords {
        /// Must be given.
        radius: f64,
    },
}

/// What must be given must be given.
#[derive(Clone, Debug, PartialEq, Params)]
struct Required {
    /// No default.
    size: u32,
}

/// Parameters that several nodes share.
#[derive(Clone, Debug, PartialEq, Params)]
struct Shared {
    /// How long.
    #[param(default = 3.0, range = 0.0..=9.0, unit = "s")]
    patience: f64,
}

/// Some of its own, then the shared ones.
#[derive(Clone, Debug, PartialEq, Params)]
struct Sharing {
    /// Its own.
    #[param(default = 1)]
    own: u32,
    #[param(flatten)]
    shared: Shared,
    /// How.
    #[param(default = How::Waiting { shared: Shared::default() })]
    how: How,
}

#[derive(Clone, Debug, PartialEq, Choice)]
enum How {
    /// With them too.
    Waiting {
        #[param(flatten)]
        shared: Shared,
    },
}

fn messages<P: Params>(value: serde_json::Value) -> Vec<String> {
    match read::<P>(&value) {
        Ok(read) => panic!("{value} was read as {read:?}"),
        Err(problems) => problems.into_iter().map(|problem| problem.message).collect(),
    }
}

#[test]
fn nothing_given_is_the_default() {
    assert_eq!(read::<All>(&json!({})).unwrap(), All::default());
    assert_eq!(read::<All>(&json!(null)).unwrap(), All::default());
}

#[test]
fn what_is_written_reads_back() {
    let all = read::<All>(&json!({
        "flag": false, "count": 9, "share": 0.25, "text": "y", "box": [0, 1, 2, 3.5], "yaws": [],
        "method": {"canny-1986": {"low": 0.2}}, "beta": -4,
    }))
    .unwrap();
    assert_eq!(all.method, Method::Canny { low: 0.2 });
    assert_eq!(all.beta, OrAuto::Value(-4.0));
    assert_eq!(read::<All>(&serde_json::Value::Object(all.write())).unwrap(), all);
}

#[test]
fn shared_parameters_stand_beside_a_node_s_own() {
    let names: Vec<_> = Sharing::specs().iter().map(|spec| spec.name).collect();
    assert_eq!(names, ["own", "patience", "how"]);
    let given = json!({"own": 2, "patience": 4.0, "how": {"waiting": {"patience": 5.0}}});
    let node = read::<Sharing>(&given).unwrap();
    assert_eq!(node.shared.patience, 4.0);
    assert_eq!(
        serde_json::Value::Object(node.write()),
        given,
        "flat, and in this order"
    );
    assert_eq!(read::<Sharing>(&json!({})).unwrap(), Sharing::default());
    assert_eq!(
        messages::<Sharing>(json!({"patience": 10, "patient": 1})),
        [
            "parameter `patience` of the node under test must be 0 to 9 (s), found `10`",
            "the node under test has no parameter `patient`"
        ]
    );
}

#[test]
fn different_spellings_of_one_value_are_written_alike() {
    let written = |value| serde_json::Value::Object(read::<All>(&value).unwrap().write());
    assert_eq!(
        written(json!({"method": "canny-1986"})),
        written(json!({"method": {"canny-1986": {"low": 0.1}}}))
    );
    assert_eq!(written(json!({"beta": 1})), written(json!({"beta": 1.0})));
    assert_eq!(written(json!({"beta": 0.0})), written(json!({"beta": -0.0})));
    assert_eq!(
        written(json!({}))["share"],
        json!(0.1),
        "an f32 is shown as it was written"
    );
}

#[test]
fn all_mistakes_are_reported_each_with_its_name() {
    insta::assert_debug_snapshot!(messages::<All>(json!({
        "flag": 1, "count": 2.5, "share": 1e40, "text": 3, "box": [1, 2], "yaws": [0, 500, "x"],
        "method": "two-words", "beta": "automatic", "betta": 1,
    })));
    assert_eq!(
        messages::<Required>(json!({})),
        ["the node under test needs the parameter `size`: a whole number"]
    );
    assert_eq!(
        messages::<All>(json!({"count": -1})),
        ["parameter `count` of the node under test must be 1 to 9 (views), found `-1`"]
    );
}

#[test]
fn a_specification_is_complete_and_goes_to_json() {
    let mut registry = Registry::new();
    registry.node::<run::tests::kit::Ranged>();
    let spec = &registry.find_node("Ranged").unwrap().spec;
    insta::assert_json_snapshot!(json!({ "node": &**spec, "params": All::specs() }));
    assert_eq!(All::DOC, "Every kind of parameter.\n\nThe second paragraph.");
}

#[test]
fn a_node_built_in_code_is_checked_like_one_from_a_file() {
    use crate::run::tests::kit::Ranged;
    let bad = Ranged {
        share: f64::NAN,
        ..Ranged::default()
    };
    assert!(testing::check(&bad).unwrap_err().to_string().contains("`share`"));
    let bad = Ranged {
        low: 2.0,
        ..Ranged::default()
    };
    assert!(
        testing::check(&bad)
            .unwrap_err()
            .to_string()
            .contains("must not be above high")
    );
}

#[test]
fn what_is_no_number_is_not_told_to_lose_its_quotes() {
    let problems = read::<All>(&json!({"share": "1.5.2"})).unwrap_err();
    let help = problems[0].help.clone().unwrap();
    assert!(help.contains("`1.5.2` is no number"), "{help}");
    let problems = read::<All>(&json!({"share": "0.5"})).unwrap_err();
    assert_eq!(problems[0].help.as_deref(), Some("quotes make it a text; write `0.5`"));
}

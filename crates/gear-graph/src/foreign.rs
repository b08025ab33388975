//! Node types that are known only when the program runs: those of a plugin, in another process, in another language.
//!
//! A node in Rust is a type, and its description is part of the program. What a plugin says of its nodes arrives as
//! data. [`Registry::foreign`] takes such a description and something that runs it, and from there on nobody can tell
//! the difference: the same messages, schema, help and keys.
//!
//! Names and docs in descriptions are `&'static str`, since nearly all of them are literals and they are copied without
//! a thought all over the framework. Those of plugins are [`interned`]: kept once each, for the rest of the process. That is
//! a few kilobytes a plugin, and a program reads the description of a plugin once.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError};

use crate::registry::{AnyNode, MOST_PORTS, numerics};
use crate::{
    AnyValue, Context, Demand, Fields, Known, NodeError, NodeSpec, NodeType, ParamKind, ParamSpec, ParamValue,
    ParamValues, PortSpec, Registry, Resources, Slot, Span, Tree, Want,
};

/// The text, kept for the rest of the process; the same text is kept once.
pub fn interned(text: &str) -> &'static str {
    static KEPT: Mutex<BTreeSet<&'static str>> = Mutex::new(BTreeSet::new());
    let mut kept = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(same) = kept.get(text) {
        return same;
    }
    let text: &'static str = Box::leak(text.into());
    kept.insert(text);
    text
}

/// What runs a node that is described by data. As [`crate::Node`], with parameters and values by position.
///
/// All lazy inputs that are wired are read.
pub trait Foreign: Send + Sync + 'static {
    /// See [`crate::Node::realm`]. It must say which program gives the results: a plugin's fingerprint.
    fn realm(&self, resources: &Resources) -> String;

    /// See [`crate::Node::memory`].
    fn memory(&self, inputs: &[u64]) -> Option<u64> {
        let _ = inputs;
        None
    }

    /// Computes the wanted outputs: inputs are one slot a port, outputs one value a port, in the order of the
    /// description. Their types are checked by the framework.
    fn run(
        &self,
        params: &ParamValues,
        inputs: &mut [Slot],
        want: &Want,
        ctx: &Context,
    ) -> Result<Vec<Option<AnyValue>>, NodeError>;
}

/// Why a description cannot be taken.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ForeignRefusal {
    /// The name is taken.
    #[error("there is a node type `{name}` already, {by}; rename one of them")]
    Taken {
        /// The name.
        name: String,
        /// Whose it is.
        by: String,
    },
    /// A name that no graph could hold.
    #[error("`{name}` cannot be the name of a {what}: expected {expected}")]
    Name {
        /// The name.
        name: String,
        /// Of a node type, a port, a parameter or a choice.
        what: &'static str,
        /// What is allowed.
        expected: &'static str,
    },
    /// Something is there twice.
    #[error("`{node}` has two {what} named `{name}`")]
    Twice {
        /// The node type.
        node: String,
        /// Inputs, outputs, parameters or choices.
        what: &'static str,
        /// Their name.
        name: String,
    },
    /// A node without outputs, or with too many ports.
    #[error("`{node}` has {found} {what}; expected {expected}")]
    Ports {
        /// The node type.
        node: String,
        /// Inputs or outputs.
        what: &'static str,
        /// How many.
        found: usize,
        /// How many are allowed.
        expected: &'static str,
    },
    /// A default that is not one of the parameter's own values.
    #[error("the default of `{param}` of `{node}` is not one: {cause}")]
    Default {
        /// The node type.
        node: String,
        /// The parameter.
        param: String,
        /// Why.
        cause: String,
    },
}

impl Registry {
    /// Adds a node type that is described by data, and run by `body`. The numerics of its ports' types are filled in.
    ///
    /// # Errors
    /// If the description contradicts itself, or the name is taken; nothing is added then.
    pub fn foreign(&mut self, spec: NodeSpec, body: Arc<dyn Foreign>) -> Result<(), ForeignRefusal> {
        if let Some(taken) = self.find_node(spec.name) {
            return Err(ForeignRefusal::Taken {
                name: spec.name.to_owned(),
                by: match taken.spec.plugin {
                    Some(plugin) => format!("of the plugin `{plugin}`"),
                    None => "which is gear's own".to_owned(),
                },
            });
        }
        check_spec(&spec)?;
        let ports = spec.inputs.iter().chain(&spec.outputs);
        let spec = Arc::new(NodeSpec {
            numerics: numerics(&[], ports.map(|port| port.value_type)),
            ..spec
        });
        let described = Arc::clone(&spec);
        self.insert_checked(NodeType {
            spec,
            read: Arc::new(move |fields| {
                Some(Arc::new(Described {
                    params: fields.take_described(&described.params)?,
                    spec: Arc::clone(&described),
                    body: Arc::clone(&body),
                }))
            }),
        });
        Ok(())
    }
}

fn check_spec(spec: &NodeSpec) -> Result<(), ForeignRefusal> {
    let node = || spec.name.to_owned();
    let words = |name: &str, separator: char| {
        name.starts_with(|c: char| c.is_ascii_alphabetic())
            && name.chars().all(|c| c.is_ascii_alphanumeric() || c == separator)
    };
    if !words(spec.name, '_') {
        return Err(ForeignRefusal::Name {
            name: node(),
            what: "node type",
            expected: "letters and digits, such as `LogRatio`",
        });
    }
    for (what, ports, expected) in [
        ("inputs", &spec.inputs, "at most 64"),
        ("outputs", &spec.outputs, "1 to 64"),
    ] {
        if ports.len() > MOST_PORTS || (what == "outputs" && ports.is_empty()) {
            return Err(ForeignRefusal::Ports {
                node: node(),
                what,
                found: ports.len(),
                expected,
            });
        }
        distinct(spec.name, what, ports.iter().map(|port| port.name))?;
        if let Some(port) = ports.iter().find(|port| !words(port.name, '_')) {
            return Err(ForeignRefusal::Name {
                name: port.name.to_owned(),
                what: "port",
                expected: "letters, digits and `_`",
            });
        }
    }
    check_params(spec.name, &spec.params)
}

fn check_params(node: &str, params: &[ParamSpec]) -> Result<(), ForeignRefusal> {
    distinct(node, "parameters", params.iter().map(|param| param.name))?;
    for param in params {
        if param.name.is_empty()
            || !param
                .name
                .chars()
                .all(|c| c.is_ascii_alphanumeric() || "_-".contains(c))
        {
            return Err(ForeignRefusal::Name {
                name: param.name.to_owned(),
                what: "parameter",
                expected: "letters, digits and `_`",
            });
        }
        check_kind(node, &param.kind)?;
        let Some(default) = &param.default else { continue };
        let tree = Tree::from_json(
            &[(param.name.to_owned(), default.clone())]
                .into_iter()
                .collect::<ParamValue>(),
        );
        let mut problems = Vec::new();
        let fields = Fields::new(Some(&tree), Span::default(), format!("`{node}`"), &mut problems);
        let read = fields.and_then(|mut fields| fields.take_described(std::slice::from_ref(param)));
        if read.is_none() || !problems.is_empty() {
            let causes: Vec<_> = problems.into_iter().map(|problem| problem.message).collect();
            return Err(ForeignRefusal::Default {
                node: node.to_owned(),
                param: param.name.to_owned(),
                cause: causes.join("; "),
            });
        }
    }
    Ok(())
}

fn check_kind(node: &str, kind: &ParamKind) -> Result<(), ForeignRefusal> {
    match kind {
        ParamKind::Choice { variants } => {
            distinct(node, "choices", variants.iter().map(|variant| variant.name))?;
            if let Some(odd) = variants.iter().find(|variant| variant.name.trim().is_empty()) {
                return Err(ForeignRefusal::Name {
                    name: odd.name.to_owned(),
                    what: "choice",
                    expected: "a word",
                });
            }
            variants
                .iter()
                .try_for_each(|variant| check_params(node, &variant.params))
        }
        ParamKind::List { of, .. } | ParamKind::OrAuto { of } | ParamKind::Optional { of } => check_kind(node, of),
        ParamKind::Bool | ParamKind::Integer | ParamKind::Number | ParamKind::Text => Ok(()),
    }
}

fn distinct<'n>(node: &str, what: &'static str, names: impl Iterator<Item = &'n str>) -> Result<(), ForeignRefusal> {
    let mut seen = BTreeSet::new();
    for name in names {
        if !seen.insert(name) {
            return Err(ForeignRefusal::Twice {
                node: node.to_owned(),
                what,
                name: name.to_owned(),
            });
        }
    }
    Ok(())
}

/// A node of such a type, with its parameters.
struct Described {
    spec: Arc<NodeSpec>,
    params: ParamValues,
    body: Arc<dyn Foreign>,
}

impl AnyNode for Described {
    fn params(&self) -> ParamValues {
        self.params.clone()
    }

    fn realm(&self, resources: &Resources) -> String {
        self.body.realm(resources)
    }

    fn check(&self) -> Result<(), NodeError> {
        Ok(())
    }

    fn memory(&self, inputs: &[u64]) -> Option<u64> {
        self.body.memory(inputs)
    }

    fn demand(&self, _output: &str, known: &Known<'_>) -> Result<Demand, NodeError> {
        Ok(match known.lazy_unknown() {
            ports if ports.is_empty() => Demand::ready(),
            ports => Demand::Need {
                ports,
                reason: "always read".into(),
            },
        })
    }

    fn run(&self, inputs: &mut [Slot], want: &Want, ctx: &Context) -> Result<Vec<Option<AnyValue>>, NodeError> {
        check_inputs(&self.spec.inputs, inputs)?;
        let outputs = self.body.run(&self.params, inputs, want, ctx)?;
        let ports = &self.spec.outputs;
        if outputs.len() != ports.len() {
            return Err(NodeError::new(format!(
                "the node gave {} outputs; expected {}",
                outputs.len(),
                ports.len()
            )));
        }
        for (port, value) in ports.iter().zip(&outputs) {
            match value {
                Some(value) if value.value_type() != port.value_type => {
                    return Err(NodeError::new(format!(
                        "the node gave a {} as `{}`; expected {}",
                        value.value_type().name,
                        port.name,
                        port.value_type.name
                    )));
                }
                None if want.has(port.name) => {
                    return Err(NodeError::new(format!(
                        "the node did not give `{}`, which was wanted",
                        port.name
                    )));
                }
                _ => {}
            }
        }
        Ok(outputs)
    }
}

fn check_inputs(ports: &[PortSpec], inputs: &[Slot]) -> Result<(), NodeError> {
    for (port, slot) in ports.iter().zip(inputs) {
        if slot.is_empty() && !port.optional && !port.lazy {
            return Err(NodeError::input(port.name, "is required and was not given"));
        }
        if let Some(odd) = slot.iter().find(|value| value.value_type() != port.value_type) {
            return Err(NodeError::input(
                port.name,
                format!("expected {}, found {}", port.value_type.name, odd.value_type().name),
            ));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::{Digest, GraphSource, Limits, Number, Run, Value, ValueType, Variant};

    /// Adds `amount` to a number.
    struct Adds;

    impl Foreign for Adds {
        fn realm(&self, _: &Resources) -> String {
            "plugin:test".to_owned()
        }

        fn run(
            &self,
            params: &ParamValues,
            inputs: &mut [Slot],
            _: &Want,
            _: &Context,
        ) -> Result<Vec<Option<AnyValue>>, NodeError> {
            let amount = params["amount"].as_f64().unwrap_or_default();
            let number = inputs[0][0].expect::<Number>()?;
            Ok(vec![Some(AnyValue::new(Number(number.0 + amount)))])
        }
    }

    fn port(name: &'static str) -> PortSpec {
        PortSpec {
            name,
            doc: "A number.",
            value_type: ValueType::of::<Number>(),
            optional: false,
            lazy: false,
            many: false,
        }
    }

    fn param(name: &'static str, kind: ParamKind, default: Option<ParamValue>) -> ParamSpec {
        ParamSpec {
            name,
            doc: "What it is for.",
            kind,
            limits: Limits::none(),
            default,
        }
    }

    fn spec() -> NodeSpec {
        NodeSpec {
            name: interned("Adds"),
            version: 1,
            doc: "Adds.",
            deterministic: true,
            kept: true,
            numerics: Vec::new(),
            inputs: vec![port("number")],
            outputs: vec![port("sum")],
            params: vec![
                ParamSpec {
                    limits: Limits::none().within(0..=9),
                    ..param("amount", ParamKind::Number, Some(json!(1)))
                },
                param(
                    "method",
                    ParamKind::Choice {
                        variants: vec![
                            Variant {
                                name: "plain",
                                doc: "Plain.",
                                params: Vec::new(),
                            },
                            Variant {
                                name: "carried",
                                doc: "With a carry.",
                                params: vec![param("digits", ParamKind::Integer, Some(json!(2)))],
                            },
                        ],
                    },
                    Some(json!("plain")),
                ),
                param(
                    "weights",
                    ParamKind::OrAuto {
                        of: Box::new(ParamKind::List {
                            of: Box::new(ParamKind::Number),
                            len: Some(2),
                        }),
                    },
                    Some(json!("auto")),
                ),
                param(
                    "note",
                    ParamKind::Optional {
                        of: Box::new(ParamKind::Text),
                    },
                    Some(json!(null)),
                ),
            ],
            plugin: Some("test"),
        }
    }

    fn registry() -> Registry {
        let mut registry = Registry::new();
        registry.foreign(spec(), Arc::new(Adds)).unwrap();
        registry
    }

    fn graph(with: &str) -> Result<crate::Graph, crate::Mistakes> {
        let text = format!(
            "gear: 1\ninputs: {{n: Number}}\nnodes:\n  a: {{node: Adds, in: {{number: n}}, with: {{{with}}}}}\noutputs: {{s: a.sum}}\n"
        );
        GraphSource::new("g.yaml", text).check(&registry())
    }

    #[test]
    fn a_node_from_data_runs_like_any_other() {
        let graph = graph("amount: 2.5, method: {carried: {digits: 3}}, weights: [1, 2]").unwrap();
        let outcome = Run::new(&graph).input_value("n", Number(4.0)).go().unwrap();
        assert_eq!(outcome.digest("s"), Some(Number(6.5).digest()));
    }

    #[test]
    fn its_parameters_get_the_same_messages() {
        let messages = |with: &str| {
            let mistakes = graph(with).unwrap_err();
            mistakes
                .problems()
                .iter()
                .map(|p| p.message.clone())
                .collect::<Vec<_>>()
        };
        assert_eq!(
            messages("amount: 12, method: carryed, weights: [1], note: 3, amuont: 1"),
            [
                "parameter `amount` of node `a` (Adds) must be 0 to 9, found `12`",
                "parameter `method` of node `a` (Adds) takes one of plain, carried, found `carryed`",
                "parameter `weights` of node `a` (Adds) takes a list of 2, each a number, found a list of 1",
                "parameter `note` of node `a` (Adds) takes a text, found `3`",
                "node `a` (Adds) has no parameter `amuont`",
            ]
        );
    }

    #[test]
    fn different_spellings_of_one_value_are_one_value() {
        let params = |value: ParamValue| {
            let tree = Tree::from_json(&value);
            let mut problems = Vec::new();
            let mut fields = Fields::new(Some(&tree), Span::default(), "it", &mut problems).unwrap();
            fields.take_described(&spec().params).unwrap()
        };
        assert_eq!(params(json!({"amount": 1})), params(json!({"amount": 1.0})));
        assert_eq!(
            params(json!({"method": "carried"})),
            params(json!({"method": {"carried": {"digits": 2}}}))
        );
        assert_eq!(params(json!({"method": {"plain": null}})), params(json!({})));
    }

    #[test]
    fn a_description_that_contradicts_itself_is_refused() {
        let refused = |change: fn(&mut NodeSpec)| {
            let mut spec = spec();
            change(&mut spec);
            registry_without()
                .foreign(spec, Arc::new(Adds))
                .unwrap_err()
                .to_string()
        };
        assert!(refused(|s| s.name = "no name").contains("cannot be the name of a node type"));
        assert!(refused(|s| s.outputs.clear()).contains("0 outputs"));
        assert!(refused(|s| s.inputs.push(port("number"))).contains("two inputs named `number`"));
        assert!(refused(|s| s.outputs[0].name = "a.b").contains("of a port"));
        assert!(refused(|s| s.params[0].default = Some(json!(99))).contains("must be 0 to 9"));
        assert!(refused(|s| s.params[1].name = "amount").contains("two parameters"));
        let taken = registry().foreign(spec(), Arc::new(Adds)).unwrap_err();
        assert!(taken.to_string().contains("of the plugin `test`"), "{taken}");
    }

    fn registry_without() -> Registry {
        Registry::new()
    }

    #[test]
    fn a_registry_with_it_is_another_registry() {
        assert_ne!(registry().digest(), Registry::new().digest());
        assert_ne!(registry().digest(), Digest::default());
        assert!(crate::graph::schema(&registry()).to_string().contains("\"Adds\""));
    }

    #[test]
    fn the_same_text_is_kept_once() {
        let (a, b) = (interned("kept once"), interned(&String::from("kept once")));
        assert!(std::ptr::eq(a, b));
    }

    #[test]
    fn what_it_gives_must_be_what_it_said() {
        struct Odd(Vec<Option<AnyValue>>);
        impl Foreign for Odd {
            fn realm(&self, _: &Resources) -> String {
                "plugin:odd".to_owned()
            }
            fn run(
                &self,
                _: &ParamValues,
                _: &mut [Slot],
                _: &Want,
                _: &Context,
            ) -> Result<Vec<Option<AnyValue>>, NodeError> {
                Ok(self.0.clone())
            }
        }
        let told = |given: Vec<Option<AnyValue>>| {
            let node = Described {
                spec: Arc::new(spec()),
                params: ParamValues::new(),
                body: Arc::new(Odd(given)),
            };
            let want = Want::from_ports(vec![("sum", true)]);
            let mut inputs = [vec![AnyValue::new(Number(1.0))]];
            node.run(&mut inputs, &want, &Context::detached())
                .unwrap_err()
                .to_string()
        };
        assert!(told(vec![]).contains("gave 0 outputs"));
        assert!(told(vec![None]).contains("did not give `sum`"));
        let report = AnyValue::new(crate::Report::new(1).unwrap());
        assert!(told(vec![Some(report)]).contains("gave a Report as `sum`"));
    }
}

//! Names that the crate, the node and its ports may have.

use gear_graph::graph::nearest;
use gear_graph::{Registry, ValueType};

use super::Refusal;

/// Names of types that every node's source uses, so that a node of that name would hide them.
const TAKEN: &[&str] = &[
    "Arc",
    "Box",
    "Clone",
    "Context",
    "Debug",
    "Default",
    "Err",
    "In",
    "Inputs",
    "Node",
    "NodeError",
    "None",
    "Ok",
    "Option",
    "Out",
    "Outputs",
    "Params",
    "Registry",
    "Result",
    "Self",
    "Some",
    "String",
    "Vec",
    "Want",
    "Wanted",
];

/// Words that Rust keeps for itself.
const KEYWORDS: &[&str] = &[
    "abstract", "as", "async", "await", "become", "box", "break", "const", "continue", "crate", "do", "dyn", "else",
    "enum", "extern", "false", "final", "fn", "for", "gen", "if", "impl", "in", "let", "loop", "macro", "match", "mod",
    "move", "mut", "override", "priv", "pub", "ref", "return", "self", "static", "struct", "super", "trait", "true",
    "try", "type", "typeof", "union", "unsafe", "unsized", "use", "virtual", "where", "while", "yield",
];

const LONGEST: usize = 60;

/// The names of a new node and its crate.
#[derive(Debug)]
pub struct Names {
    /// In graphs, and of the Rust type: `OilCrackle`.
    pub node: String,
    /// Of the folder: `oil-crackle`.
    pub kebab: String,
}

/// A port of a new node.
#[derive(Debug)]
pub struct Port {
    pub name: String,
    pub value_type: ValueType,
}

impl Names {
    /// The name as given, if it can be a node's.
    pub fn of(name: &str, registry: &Registry) -> Result<Self, Refusal> {
        let form =
            name.starts_with(|c: char| c.is_ascii_uppercase()) && name.chars().all(|c| c.is_ascii_alphanumeric());
        if !form {
            let help = match camel(name) {
                Some(camel) => format!("did you mean `{camel}`?"),
                None => "an example is `OilCrackle`".to_owned(),
            };
            return Err(Refusal::new(format!(
                "`{name}` cannot be a node's name: expected letters (a to z) and digits, words begun with capitals; {help}"
            )));
        }
        if name.len() > LONGEST {
            return Err(Refusal::new(format!(
                "the name has {} letters; expected at most {LONGEST}",
                name.len()
            )));
        }
        if TAKEN.contains(&name) {
            return Err(Refusal::new(format!(
                "`{name}` is the name of something that every node uses; take another"
            )));
        }
        if registry.find_node(name).is_some() {
            return Err(Refusal::new(format!(
                "there is a node named `{name}` already; take another name"
            )));
        }
        if registry.find_value(name).is_some() {
            return Err(Refusal::new(format!("`{name}` is a type of value; take another name")));
        }
        Ok(Self {
            node: name.to_owned(),
            kebab: kebab(name),
        })
    }

    /// Of the crate: `node-oil-crackle`.
    pub fn package(&self) -> String {
        format!("node-{}", self.kebab)
    }

    /// Of the crate in Rust: `node_oil_crackle`.
    pub fn module(&self) -> String {
        self.package().replace('-', "_")
    }
}

/// The ports that a flag gives.
pub fn ports(flag: &str, given: &[String], registry: &Registry) -> Result<Vec<Port>, Refusal> {
    let mut ports: Vec<Port> = Vec::new();
    for text in given {
        let refuse = |cause: String| Refusal::new(format!("{flag} {text}: {cause}"));
        let Some((name, type_name)) = text.split_once(':') else {
            return Err(refuse("expected NAME:TYPE, such as `image:Image`".to_owned()));
        };
        let form = name.starts_with(|c: char| c.is_ascii_lowercase())
            && name
                .chars()
                .all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
            && name.len() <= LONGEST;
        if !form {
            return Err(refuse(format!(
                "`{name}` cannot be a port's name: expected small letters, digits and `_`, a letter first"
            )));
        }
        if KEYWORDS.contains(&name) {
            return Err(refuse(format!(
                "`{name}` is a word of the Rust language; take another name"
            )));
        }
        if ports.iter().any(|port| port.name == name) {
            return Err(refuse(format!("there are two ports named `{name}`")));
        }
        let Some(value_type) = registry.find_value(type_name) else {
            let types = || registry.values().map(|value| value.name);
            let help = match nearest(type_name, types()) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("there are {}", types().collect::<Vec<_>>().join(", ")),
            };
            return Err(refuse(format!("there is no type named `{type_name}`; {help}")));
        };
        ports.push(Port {
            name: name.to_owned(),
            value_type,
        });
    }
    if ports.len() > 64 {
        return Err(Refusal::new(format!(
            "{} times {flag}; expected at most 64",
            ports.len()
        )));
    }
    Ok(ports)
}

/// `OilCrackle` as `oil-crackle`, `HDRMerge2` as `hdr-merge2`.
fn kebab(name: &str) -> String {
    let letters: Vec<char> = name.chars().collect();
    let mut kebab = String::new();
    for (i, c) in letters.iter().enumerate() {
        let after_small = i > 0 && !letters[i - 1].is_ascii_uppercase();
        let before_small = i > 0 && letters.get(i + 1).is_some_and(|next| next.is_ascii_lowercase());
        if c.is_ascii_uppercase() && (after_small || before_small) {
            kebab.push('-');
        }
        kebab.push(c.to_ascii_lowercase());
    }
    kebab
}

/// What may have been meant by `oil-crackle`, `oil_crackle` or `oilCrackle`.
fn camel(name: &str) -> Option<String> {
    let words = name
        .split(|c: char| !c.is_ascii_alphanumeric())
        .filter(|word| !word.is_empty());
    let camel: String = words.map(|word| word[..1].to_ascii_uppercase() + &word[1..]).collect();
    let fits = camel.starts_with(|c: char| c.is_ascii_uppercase()) && name.is_ascii();
    fits.then_some(camel)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_are_named_in_kebab_case() {
        for (name, expected) in [
            ("OilCrackle", "oil-crackle"),
            ("HDRMerge2", "hdr-merge2"),
            ("A", "a"),
            ("ToRGB", "to-rgb"),
            ("Step2Of3", "step2-of3"),
        ] {
            assert_eq!(kebab(name), expected);
        }
    }

    #[test]
    fn names_that_cannot_be_are_refused_with_one_sentence() {
        let registry = crate::registry();
        let refused = |name: &str| Names::of(name, &registry).unwrap_err().to_string();
        assert!(refused("oil-crackle").contains("did you mean `OilCrackle`?"));
        assert!(refused("oilCrackle").contains("did you mean `OilCrackle`?"));
        for bad in ["", "-", "../Evil", "Öl", "2D", "A b", "a\nb", "Oil/Crackle", "🎨"] {
            let text = refused(bad);
            assert!(text.contains("cannot be a node's name"), "{text}");
        }
        assert!(refused("Self").contains("every node uses"));
        assert!(refused("LogRatio").contains("already"));
        assert!(refused("Image").contains("type of value"));
        assert!(refused(&"A".repeat(61)).contains("at most 60"));
        assert!(refused("In").ends_with("nothing was written"));
    }

    #[test]
    fn ports_that_cannot_be_are_refused_with_one_sentence() {
        let registry = crate::registry();
        let refused = |given: &[&str]| {
            let given: Vec<_> = given.iter().map(ToString::to_string).collect();
            ports("--input", &given, &registry).unwrap_err().to_string()
        };
        assert!(refused(&["image"]).contains("expected NAME:TYPE"));
        assert!(refused(&["image:Imgae"]).contains("did you mean `Image`?"));
        assert!(refused(&["image:"]).contains("there is no type"));
        assert!(refused(&["match:Image"]).contains("word of the Rust language"));
        assert!(refused(&["a:Image", "a:Mask"]).contains("two ports"));
        for bad in ["Image:Image", "a-b:Image", "_a:Image", ":Image", "1:Image"] {
            assert!(refused(&[bad]).contains("cannot be a port's name"), "{bad}");
        }
    }
}

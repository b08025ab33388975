//! Reading parameters one by one; mistakes are collected, never thrown.

use super::{Limits, Param, ParamKind, Problem, Span, Spanned, Tree, TreeKind, Variant};
use crate::graph::{glued, nearest};

/// Where a parameter's reading reports mistakes, and what the parameter is called in messages.
pub struct Reader<'p> {
    pub(super) problems: &'p mut Vec<Problem>,
    /// Such as `parameter `radius` of node `ratio``.
    pub(super) subject: String,
}

impl Reader<'_> {
    /// Adds a mistake.
    pub fn report(&mut self, problem: Problem) {
        self.problems.push(problem);
    }

    /// The parameter's name in messages, such as ``parameter `radius` of node `ratio` ``.
    pub fn subject(&self) -> &str {
        &self.subject
    }

    /// Reports that the value is of the wrong kind.
    pub fn wrong_kind(&mut self, tree: &Tree, expected: &str) {
        let problem = Problem::error(
            "wrong-parameter-type",
            format!("{} takes {expected}, found {}", self.subject, tree.describe()),
            tree.span,
            format!("expected {expected}"),
        )
        .maybe_help(
            yaml_trap(tree, expected)
                .or_else(|| misspelt_word(tree, expected))
                .or_else(|| {
                    (tree.kind == TreeKind::Null)
                        .then(|| "write a value, or leave it out where it has a default".to_owned())
                }),
        );
        self.report(problem);
    }

    /// Reports that a number is out of range.
    pub fn out_of_range(&mut self, tree: &Tree, limits: &Limits) {
        let problem = Problem::error(
            "parameter-out-of-range",
            format!("{} must be {limits}, found {}", self.subject, tree.describe()),
            tree.span,
            format!("must be {limits}"),
        );
        self.report(problem);
    }

    /// Reads a choice: a bare word, or a map of one word to the parameters of that method.
    pub fn choice<T>(
        &mut self,
        tree: &Tree,
        variants: &[Variant],
        read: impl FnOnce(&str, &mut Fields<'_, '_>) -> Option<T>,
    ) -> Option<T> {
        let (word, span, params) = match &tree.kind {
            TreeKind::Text(word) => (word.as_str(), tree.span, None),
            TreeKind::Map(entries) if entries.len() == 1 => {
                let (key, value) = &entries[0];
                (key.value.as_str(), key.span, Some(value))
            }
            _ => {
                self.wrong_kind(tree, &names(variants));
                return None;
            }
        };
        if !variants.iter().any(|variant| variant.name == word) {
            let problem = Problem::error(
                "unknown-choice",
                format!("{} takes {}, found `{word}`", self.subject, names(variants)),
                span,
                "unknown choice",
            )
            .maybe_help(glued(word).or_else(|| {
                let near = nearest(word, variants.iter().map(|v| v.name));
                near.map(|name| format!("did you mean `{name}`?"))
            }));
            self.report(problem);
            return None;
        }
        let owner = format!("`{word}` of {}", self.subject);
        let mut fields = Fields::new(params, span, owner, self.problems)?;
        read(word, &mut fields)
    }
}

fn names(variants: &[Variant]) -> String {
    let names: Vec<_> = variants.iter().map(|v| v.name).collect();
    match names.as_slice() {
        [one] => format!("`{one}`"),
        _ => format!("one of {}", names.join(", ")),
    }
}

/// `Auto` for `auto`: the words that may stand in place of a value end its description.
fn misspelt_word(tree: &Tree, expected: &str) -> Option<String> {
    let TreeKind::Text(text) = &tree.kind else {
        return None;
    };
    let word = expected.rsplit_once(", or ")?.1;
    nearest(text, [word]).map(|word| format!("did you mean `{word}`?"))
}

fn has_leading_zero(digits: &str) -> bool {
    digits.starts_with('0') && digits[1..].starts_with(|next: char| next.is_ascii_digit())
}

/// What YAML 1.1 would have made of a text, when that is what was expected.
pub(crate) fn yaml_trap(tree: &Tree, expected: &str) -> Option<String> {
    let TreeKind::Text(text) = &tree.kind else {
        return None;
    };
    if expected.contains("true or false") {
        return match text.to_ascii_lowercase().as_str() {
            "yes" | "on" | "y" => Some(format!("`{text}` is a text in YAML 1.2; write `true`")),
            "no" | "off" | "n" => Some(format!("`{text}` is a text in YAML 1.2; write `false`")),
            _ => None,
        };
    }
    if !expected.contains("number") {
        return None;
    }
    let plain = text.replace('_', "");
    let digits = plain.trim_start_matches(['-', '+']).trim_start_matches('0');
    if let Some((whole, rest)) = text.split_once(',')
        && let Ok(number) = format!("{whole}.{rest}").parse::<f64>()
    {
        return Some(format!("decimals stand behind a point; write `{number}`"));
    }
    if text.contains(':') && text.split(':').all(|part| part.parse::<f64>().is_ok()) {
        return Some("numbers to the base of 60 are texts in YAML 1.2; write one number".to_owned());
    }
    if plain.matches('.').count() > 1 && plain.chars().all(|c| c.is_ascii_digit() || "+-.".contains(c)) {
        return Some(format!("`{text}` is no number: it has more than one point"));
    }
    if digits.chars().all(|c| c.is_ascii_digit() || c == '.') && plain.chars().any(|c| c.is_ascii_digit()) {
        let sign = if plain.starts_with('-') { "-" } else { "" };
        let lead = if digits.is_empty() || digits.starts_with('.') {
            "0"
        } else {
            ""
        };
        let why = if plain.len() < text.len() {
            "a number with `_` is a text in YAML 1.2"
        } else if has_leading_zero(plain.trim_start_matches(['-', '+'])) {
            "a number with a leading 0 is octal to some readers and decimal to others"
        } else {
            "quotes make it a text"
        };
        return Some(format!("{why}; write `{sign}{lead}{digits}`"));
    }
    None
}

/// A map of parameters that is being read.
pub struct Fields<'t, 'p> {
    entries: &'t [(Spanned<String>, Tree)],
    /// Where to point when something is missing.
    span: Span,
    owner: String,
    known: Vec<&'static str>,
    problems: &'p mut Vec<Problem>,
}

impl<'t, 'p> Fields<'t, 'p> {
    /// Reads from `tree` (nothing at all when absent or `null`); `owner` is what the parameters belong to, such as
    /// ``node `ratio` (LogRatio)``, standing at `span`. `None` and a problem if the tree is no map.
    pub fn new(
        tree: Option<&'t Tree>,
        span: Span,
        owner: impl Into<String>,
        problems: &'p mut Vec<Problem>,
    ) -> Option<Self> {
        let owner = owner.into();
        let entries: &[_] = match tree.map(|tree| (&tree.kind, tree)) {
            None | Some((TreeKind::Null, _)) => &[],
            Some((TreeKind::Map(entries), _)) => entries,
            Some((_, tree)) => {
                problems.push(Problem::error(
                    "wrong-parameter-type",
                    format!("the parameters of {owner} must be a map, found {}", tree.describe()),
                    tree.span,
                    "expected `{name: value, …}`",
                ));
                return None;
            }
        };
        Some(Self {
            entries,
            span,
            owner,
            known: Vec::new(),
            problems,
        })
    }

    /// Reads the parameter `name`.
    pub fn take<T: Param>(&mut self, name: &'static str, limits: &Limits, default: Option<T>) -> Option<T> {
        self.take_with(name, &T::kind(), default, |tree, reader| T::read(tree, limits, reader))
    }

    /// Reads the parameter `name` of this kind with `read`.
    pub(super) fn take_with<T>(
        &mut self,
        name: &'static str,
        kind: &ParamKind,
        default: Option<T>,
        read: impl FnOnce(&Tree, &mut Reader<'_>) -> Option<T>,
    ) -> Option<T> {
        self.known.push(name);
        // Duplicate keys were reported when the tree was checked; the last one counts.
        match self.entries.iter().rev().find(|(key, _)| key.value == name) {
            Some((_, tree)) => {
                let mut reader = Reader {
                    problems: self.problems,
                    subject: format!("parameter `{name}` of {}", self.owner),
                };
                read(tree, &mut reader)
            }
            None => {
                if default.is_none() {
                    let kind = kind.describe();
                    self.problems.push(Problem::error(
                        "missing-parameter",
                        format!("{} needs the parameter `{name}`: {kind}", self.owner),
                        self.span,
                        format!("`{name}` is missing"),
                    ));
                }
                default
            }
        }
    }

    /// Reports the keys that no `take` asked for.
    pub fn finish(&mut self) {
        for (key, _) in self.entries {
            if self.known.contains(&key.value.as_str()) {
                continue;
            }
            self.problems.push(unknown_parameter(&self.owner, key, &self.known));
        }
    }
}

/// The mistake that `owner` has only the parameters `known`.
pub(crate) fn unknown_parameter(owner: &str, key: &Spanned<String>, known: &[&str]) -> Problem {
    let help = match (glued(&key.value), nearest(&key.value, known.iter().copied())) {
        (Some(apart), _) => apart,
        (None, Some(name)) => format!("did you mean `{name}`?"),
        (None, None) if known.is_empty() => "it takes no parameters".to_string(),
        (None, None) => format!("its parameters are {}", known.join(", ")),
    };
    Problem::error(
        "unknown-parameter",
        format!("{owner} has no parameter `{}`", key.value),
        key.span,
        "unknown parameter",
    )
    .help(help)
}

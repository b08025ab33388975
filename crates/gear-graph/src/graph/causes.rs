//! What can be wrong with a graph file: the list of all causes.

/// A cause of a mistake.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cause {
    /// Its stable name, [`crate::Problem::code`].
    pub code: &'static str,
    /// What it means.
    pub meaning: &'static str,
    /// Whether the JSON Schema of graph files tells of it as well.
    pub schema: bool,
}

const fn schema(code: &'static str, meaning: &'static str) -> Cause {
    Cause {
        code,
        meaning,
        schema: true,
    }
}

const fn check(code: &'static str, meaning: &'static str) -> Cause {
    Cause {
        code,
        meaning,
        schema: false,
    }
}

/// All causes, in the order in which a file is read. Nodes that read parameters in their own way may add others.
pub const CAUSES: &[Cause] = &[
    check("not-yaml", "the file is not YAML that can be read"),
    check(
        "too-large",
        "the file unfolds to more than can be read, or is nested too deeply",
    ),
    check("duplicate-key", "a key stands twice in one map"),
    schema("missing-version", "`gear:` is missing"),
    schema("bad-version", "`gear:` is no version"),
    schema(
        "version-too-new",
        "the file is of a version that this program does not know",
    ),
    check("unreadable-graph", "the file behind `extends` cannot be read"),
    check("extends-cycle", "files extend each other in a ring"),
    check("nothing-to-remove", "`null` stands where there is nothing to remove"),
    check("bad-override", "a `--set` is not of the form `NODE.PARAM=VALUE`"),
    check("unknown-override", "a `--set` names no node and no input"),
    schema("unknown-key", "a key that the format does not have"),
    schema(
        "wrong-type",
        "a map, a text or a list stands where something else belongs",
    ),
    schema("bad-name", "a name that cannot be one"),
    schema("reserved-name", "an output of the name of a file that a run writes"),
    check(
        "duplicate-name",
        "a name that is given twice, or differs from another one only in capitals",
    ),
    schema("missing-type", "an input has no type"),
    schema("unknown-value-type", "there is no such type of values"),
    schema("missing-node-type", "a node has no type"),
    schema("missing-port", "a snapshot has no port"),
    schema("unknown-node-type", "there is no such type of nodes"),
    schema("unknown-port", "the node has no such input port"),
    schema("missing-input", "nothing is wired to a port that needs something"),
    check("unknown-source", "a wire begins at nothing"),
    check("unknown-output", "the node has no such output"),
    check(
        "removed-but-read",
        "a node or an input is removed, and something still reads it",
    ),
    check("wrong-port-type", "a wire ends at a port of another type"),
    check(
        "optional-into-required",
        "an optional input is wired to a port that needs something",
    ),
    check("optional-output", "an output is an optional input, which may be absent"),
    check(
        "no-loader",
        "no loader reads the type of an input, so that no file can be given for it",
    ),
    schema("unknown-parameter", "the node or loader has no such parameter"),
    schema("missing-parameter", "a parameter without default is not given"),
    schema("wrong-parameter-type", "the value of a parameter is of another kind"),
    schema("unknown-choice", "a parameter has no such choice"),
    schema("parameter-out-of-range", "the value of a parameter is out of its range"),
    check("parameters-do-not-fit", "parameters do not fit together"),
    check("cycle", "nodes wait for each other"),
    schema("no-outputs", "the graph has no outputs"),
    check("unused-input", "no output needs the input (a warning)"),
    check("unused-node", "no output needs the node (a warning)"),
];

//! Places stay true whatever the lines look like.

use super::*;

const TEXT: &str = "gear: 1
inputs:
  x: Number
nodes:
  a:
    node: Add
    in: {of: x}
    with:
      plus: much
outputs:
  y: a.sum
";

/// File, line and column of the first mistake.
fn place(text: &str) -> (usize, usize) {
    let mistakes = mistakes(text);
    let (_, line, column) = mistakes.position(mistakes.problems()[0].labels[0].0);
    (line, column)
}

#[test]
fn ends_of_lines_and_a_byte_order_mark_move_nothing() {
    assert_eq!(place(TEXT), (9, 13));
    assert_eq!(place(&TEXT.replace('\n', "\r\n")), (9, 13));
    assert_eq!(place(&TEXT.replace('\n', "\r")), (9, 13));
    assert_eq!(place(&format!("\u{feff}{TEXT}")), (9, 13));
    assert_eq!(place(&TEXT.replace("gear", "# 画 é 😀\ngear")), (10, 13));
    // On the first line itself, the mark is not counted.
    assert_eq!(place("\u{feff}gear: 1.5\n"), place("gear: 1.5\n"));
}

#[test]
fn lines_that_end_as_on_windows() {
    let said = mistakes(&TEXT.replace('\n', "\r\n")).to_string();
    assert_eq!(said, mistakes(TEXT).to_string());
}

#[test]
fn values_over_several_lines() {
    insta::assert_snapshot!(mistakes(
        "gear: 1
inputs: {x: Number}
nodes:
  a:
    node: Add
    in:
      of:
        - x
        - y
    with:
      plus: >-
        a lot
        of it
  b: {
    node: Add,
    in: {
      off: x
    },
    with: {plus: \"1
      more\"}
  }
outputs:
  y:
    c.sum
"
    ));
}

#[test]
fn tabs_between_words() {
    insta::assert_snapshot!(mistakes(
        "gear: 1
inputs: {x: Number}
nodes:
  a:
    node:\tAdd
    in:\t{\tof:\tz\t}
    with:\t{plus:\t\tmuch}
outputs: {y: a.sum}
"
    ));
}

#[test]
fn wide_characters_before_the_place() {
    insta::assert_snapshot!(mistakes(
        "gear: 1
inputs: {x: Number}
nodes:
  仕女図: {node: Add, in: {of: 絵}} # 画
  naïve: {node: Add, in: {of: x}, with: {plus: '😀', 😀: 1}}
outputs: {y: 仕女図.som, z: naïve.sum}
"
    ));
}

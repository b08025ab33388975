"""Parameters: what stands as the default of a keyword argument of a node."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Dict, List, Optional, Union

REQUIRED = object()
"""As a default: the parameter must be given."""


@dataclass(frozen=True)
class Param:
    """One parameter, as gear describes it."""

    kind: Any
    doc: str
    default: Any = REQUIRED
    range: Optional[Dict[str, float]] = None
    unit: Optional[str] = None

    def describe(self, name: str) -> Dict[str, Any]:
        """Its entry in the description of its node."""
        entry: Dict[str, Any] = {"name": name, "doc": self.doc, "kind": self.kind}
        if self.range:
            entry["range"] = self.range
        if self.unit is not None:
            entry["unit"] = self.unit
        if self.default is not REQUIRED:
            entry["default"] = self.default
        return entry


def _range(
    min: Optional[float], max: Optional[float], above: Optional[float], below: Optional[float]
) -> Optional[Dict[str, float]]:
    ends = {"min": min, "max": max, "above": above, "below": below}
    return {name: end for name, end in ends.items() if end is not None} or None


def number(
    default: Any,
    doc: str,
    *,
    min: Optional[float] = None,
    max: Optional[float] = None,
    above: Optional[float] = None,
    below: Optional[float] = None,
    unit: Optional[str] = None,
) -> Any:
    """A finite number."""
    return Param("number", doc, default, _range(min, max, above, below), unit)


def integer(
    default: Any, doc: str, *, min: Optional[int] = None, max: Optional[int] = None, unit: Optional[str] = None
) -> Any:
    """A whole number."""
    return Param("integer", doc, default, _range(min, max, None, None), unit)


def flag(default: Any, doc: str) -> Any:
    """True or false."""
    return Param("bool", doc, default)


def text(default: Any, doc: str) -> Any:
    """A text."""
    return Param("text", doc, default)


def numbers(
    default: Any,
    doc: str,
    *,
    len: Optional[int] = None,
    min: Optional[float] = None,
    max: Optional[float] = None,
    unit: Optional[str] = None,
) -> Any:
    """A list of numbers."""
    of: Dict[str, Any] = {"of": "number"}
    if len is not None:
        of["len"] = len
    return Param({"list": of}, doc, default, _range(min, max, None, None), unit)


def optional(inner: Param) -> Any:
    """None, or what `inner` takes; None when it is not given."""
    return Param({"optional": inner.kind}, inner.doc, None, inner.range, inner.unit)


def or_auto(inner: Param) -> Any:
    """The word `auto`, or what `inner` takes; `auto` when it is not given."""
    return Param({"or-auto": inner.kind}, inner.doc, "auto", inner.range, inner.unit)


def variant(name: str, doc: str, **params: Param) -> Dict[str, Any]:
    """One choice, with parameters of its own. A node gets `{name: {…}}` if it has some, else the bare word."""
    out: Dict[str, Any] = {"name": name, "doc": doc}
    if params:
        out["params"] = [param.describe(key) for key, param in params.items()]
    return out


def choice(default: Any, doc: str, variants: Union[Dict[str, str], List[Dict[str, Any]]]) -> Any:
    """One of these: words with their docs, or what :func:`variant` makes."""
    if isinstance(variants, dict):
        variants = [variant(name, about) for name, about in variants.items()]
    return Param({"choice": variants}, doc, default)

"""Code and weights that a plugin runs with and does not bring: where the code is imported from, and what the plugin states
of both, without reading all of the weights at every start."""

from __future__ import annotations

import hashlib
import importlib.metadata
import os
import sys
from contextlib import contextmanager
from pathlib import Path
from typing import Dict, Iterator

from .context import NodeFailure

_BLOCK = 1 << 16
_BLOCKS = 64


def versions(*packages: str) -> Dict[str, str]:
    """The versions of these packages, without importing them."""
    found = {}
    for package in packages:
        try:
            found[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            found[package] = "not installed"
    return found


def fingerprint(path: "str | os.PathLike[str]") -> str:
    """Tells the content of a file, or of all files in a folder, from another: names, sizes, and 64 blocks of 64 KiB
    spread evenly over each file, the first and the last among them. Two versions of weights differ everywhere, so this
    tells them apart; a file that was changed on purpose outside these blocks is not noticed."""
    root = Path(path)
    files = [root] if root.is_file() else sorted(file for file in root.rglob("*") if file.is_file())
    digest = hashlib.sha256()
    for file in files:
        size = file.stat().st_size
        name = file.name if file == root else file.relative_to(root).as_posix()
        digest.update(f"{name}\0{size}\0".encode())
        with file.open("rb") as source:
            last = max(0, size - _BLOCK)
            for i in range(_BLOCKS):
                source.seek(last * i // (_BLOCKS - 1))
                digest.update(source.read(_BLOCK))
                if size <= _BLOCK:
                    break
    return "sha256-sampled:" + digest.hexdigest()


def model(name: str) -> str:
    """What a model is: the fingerprint of a folder or file; of a name on the Hugging Face hub the commit that is in the
    local cache, or `not downloaded`."""
    if Path(name).exists():
        return fingerprint(name)
    cache = os.environ.get("HF_HUB_CACHE") or os.path.join(
        os.environ.get("HF_HOME") or os.path.join(os.path.expanduser("~"), ".cache", "huggingface"), "hub"
    )
    reference = Path(cache) / ("models--" + name.replace("/", "--")) / "refs" / "main"
    commit = reference.read_text().strip() if reference.is_file() else "not downloaded"
    return f"{name}@{commit}"


@contextmanager
def importing(name: str, variable: str, how: str) -> Iterator[None]:
    """Around imports of code that is cloned, and not installed: the folder that the environment variable names is looked in
    first, and what cannot be imported fails the node with `how` to get it."""
    folder = os.environ.get(variable)
    if folder and folder not in sys.path:
        sys.path.insert(0, folder)
    try:
        yield
    except ImportError as error:
        raise NodeFailure(f"{name} cannot be imported ({error}); {how}, and set {variable} to its folder") from error


def checkout(folder: "str | None") -> str:
    """The commit of a clone, or `unknown`: for code that is no package."""
    if not folder:
        return "unknown"
    git = Path(folder) / ".git"
    try:
        head = (git / "HEAD").read_text().strip()
        if not head.startswith("ref: "):
            return head
        name = head[len("ref: ") :]
        loose = git / name
        if loose.is_file():
            return loose.read_text().strip()
        for line in (git / "packed-refs").read_text().splitlines():
            if line.endswith(" " + name):
                return line.split()[0]
    except OSError:
        pass
    return "unknown"

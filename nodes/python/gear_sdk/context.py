"""What a running node may use besides its inputs."""

from __future__ import annotations

import threading
from typing import Callable, List, Set


class Cancelled(Exception):
    """The run was interrupted: let it pass."""


class NodeFailure(Exception):
    """A failure told in a sentence: what was found, what was expected, what to do. Shown without a traceback."""


class Context:
    """Progress, interruption, notes, the seed, and which outputs are wanted."""

    def __init__(
        self,
        seed: int = 0,
        wanted: Set[str] = frozenset(),  # type: ignore[assignment]
        cancelled: "threading.Event | None" = None,
        on_progress: "Callable[[float, str], None] | None" = None,
    ):
        self.seed = seed
        """Depends on the node's type and parameters only; below 2⁵³."""
        self.notes: List[str] = []
        self._wanted = wanted
        self._cancelled = cancelled or threading.Event()
        self._on_progress = on_progress

    def wanted(self, output: str) -> bool:
        """Whether somebody asked for this output. What nobody asked for need not be computed."""
        return not self._wanted or output in self._wanted

    def progress(self, fraction: float, message: str = "") -> None:
        """Tells the share that is done, 0 to 1; then as :meth:`checkpoint`."""
        if self._on_progress is not None:
            self._on_progress(float(fraction), message)
        self.checkpoint()

    def checkpoint(self) -> None:
        """Raises :class:`Cancelled` once the run is interrupted. A node that takes long calls it every half second."""
        if self._cancelled.is_set():
            raise Cancelled()

    def note(self, text: str) -> None:
        """Leaves a note for the user. It is kept with the result, so it must be as deterministic as that."""
        self.notes.append(text)

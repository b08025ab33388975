"""A plugin: its nodes, and the conversation with gear.

Messages are lines of JSON-RPC 2.0. What libraries print must not get among them, so standard output is kept for messages
alone, and everything else that is printed goes to standard error: from the import of this module on where gear started
the program (it sets GEAR_PLUGIN), else from :meth:`Plugin.serve` on. A thread listens, so that a node that computes can be
told to stop; nodes run on the main thread, as GPU libraries like it.
"""

from __future__ import annotations

import inspect
import json
import logging
import os
import queue
import sys
import tempfile
import threading
import traceback
import typing
from pathlib import Path
from typing import Any, BinaryIO, Callable, Dict, Iterator, List, Optional, Tuple

from .context import Cancelled, Context, NodeFailure
from .params import Param
from .values import TYPES, Value

PROTOCOL = 1

_CANCELLED = -32800
_FAILED = -32000
_NO_METHOD = -32601
_BAD_PARAMS = -32602


def _take_stdout() -> BinaryIO:
    """Standard output for messages alone."""
    sys.stdout.flush()
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    sys.stdout = sys.stderr
    return out


_OUT = _take_stdout() if os.environ.get("GEAR_PLUGIN") else None


class Node:
    """A node: a function, and what gear is told of it. Calling it fills in defaults, for tests."""

    def __init__(
        self,
        function: Callable[..., Any],
        outputs: Dict[str, Tuple[Any, str]],
        version: int,
        deterministic: bool,
    ):
        self.function = function
        self.name = function.__name__
        self.outputs = outputs
        self.version = version
        self.deterministic = deterministic
        self.inputs: Dict[str, Dict[str, Any]] = {}
        self.params: Dict[str, Param] = {}
        hints = typing.get_type_hints(function, include_extras=True)
        for name, parameter in list(inspect.signature(function).parameters.items())[1:]:
            if parameter.kind is inspect.Parameter.KEYWORD_ONLY:
                if not isinstance(parameter.default, Param):
                    raise TypeError(f"{self.name}: the default of `{name}` must be made by number(), text(), …")
                self.params[name] = parameter.default
            else:
                self.inputs[name] = _port(self.name, name, hints.get(name))

    def describe(self) -> Dict[str, Any]:
        """The description that gear gets."""
        outputs = [{"name": name, "type": kind.TYPE, "doc": doc} for name, (kind, doc) in self.outputs.items()]
        return {
            "name": self.name,
            "version": self.version,
            "doc": inspect.getdoc(self.function) or "",
            "deterministic": self.deterministic,
            "inputs": list(self.inputs.values()),
            "outputs": outputs,
            "params": [param.describe(name) for name, param in self.params.items()],
        }

    def __call__(self, ctx: Context, *inputs: Any, **given: Any) -> Dict[str, Any]:
        named = dict(zip(self.inputs, inputs))
        for name in list(given):
            if name in self.inputs:
                named[name] = given.pop(name)
        for name, port in self.inputs.items():
            named.setdefault(name, [] if port.get("many") else None)
        params = {name: param.default for name, param in self.params.items()}
        params.update(given)
        result = self.function(ctx, **named, **params)
        return result if isinstance(result, dict) else {next(iter(self.outputs)): result}


def _port(node: str, name: str, hint: Any) -> Dict[str, Any]:
    if typing.get_origin(hint) is not typing.Annotated:
        raise TypeError(f"{node}: input `{name}` must be annotated as Annotated[Image, 'what it holds']")
    kind, doc = typing.get_args(hint)[:2]
    port: Dict[str, Any] = {"name": name, "doc": doc}
    if typing.get_origin(kind) is list:
        port["many"] = True
        (kind,) = typing.get_args(kind)
    elif typing.get_origin(kind) is typing.Union:
        port["optional"] = True
        (kind,) = [part for part in typing.get_args(kind) if part is not type(None)]
    port["type"] = kind.TYPE
    return port


class Plugin:
    """The nodes of a plugin."""

    def __init__(self, name: str):
        self.name = name
        self.nodes: Dict[str, Node] = {}
        self._states: Callable[[], Dict[str, Any]] = dict

    def node(
        self,
        *,
        outputs: Dict[str, Tuple[Any, str]],
        version: int = 1,
        deterministic: bool = True,
    ) -> Callable[[Callable[..., Any]], Node]:
        """Makes a node of a function: positional arguments after the context are inputs, keyword arguments parameters.
        It returns the value of its only output, or values by output."""

        def make(function: Callable[..., Any]) -> Node:
            node = Node(function, outputs, version, deterministic)
            self.nodes[node.name] = node
            return node

        return make

    def states(self, function: Callable[[], Dict[str, Any]]) -> Callable[[], Dict[str, Any]]:
        """Names the function that says what results depend on besides the sources: versions of libraries, digests of
        weights. It is asked at every start, must answer the same as long as results are the same, and should be quick."""
        self._states = function
        return function

    def describe(self) -> List[Dict[str, Any]]:
        """The descriptions of all nodes."""
        return [node.describe() for node in self.nodes.values()]

    def hello(self) -> Dict[str, Any]:
        """The answer to the handshake."""
        return {"protocol": PROTOCOL, "name": self.name, "nodes": self.describe(), "states": self._states()}

    def serve(self) -> None:
        """Talks with gear until it says goodbye."""
        _Server(self, 0, _OUT or _take_stdout()).run()


class _Logs(logging.Handler):
    """Sends the records of `logging` to gear, which puts them into its own log."""

    def __init__(self, server: "_Server"):
        super().__init__(logging.INFO)
        self.server = server

    def emit(self, record: logging.LogRecord) -> None:
        level = "error" if record.levelno >= 40 else "warning" if record.levelno >= 30 else "info"
        self.server.tell("log", {"level": level, "message": record.getMessage()})


class _Server:
    def __init__(self, plugin: Plugin, source: int, out: BinaryIO):
        self.plugin = plugin
        self.source = source
        self.out = out
        self.lock = threading.Lock()
        self.requests: "queue.Queue[Optional[Dict[str, Any]]]" = queue.Queue()
        self.cancelled = threading.Event()
        self.running: Any = None
        self.unwanted: Any = None
        self.scratch = Path(".")

    def run(self) -> None:
        logging.getLogger().addHandler(_Logs(self))
        threading.Thread(target=self._listen, daemon=True).start()
        while True:
            request = self.requests.get()
            if request is None:
                return
            answer = self._answer(request)
            if "id" in request:
                self._send({"jsonrpc": "2.0", "id": request["id"], **answer})
            if request.get("method") == "shutdown":
                return

    def _listen(self) -> None:
        for line in self._lines():
            try:
                request = json.loads(line)
            except ValueError:
                continue
            if not isinstance(request, dict):
                continue
            if request.get("method") == "cancel":
                self.unwanted = request.get("params", {}).get("id")
                if self.unwanted == self.running:
                    self.cancelled.set()
            else:
                self.requests.put(request)
        if self.running is not None:
            # Nobody waits for the result any more.
            os._exit(1)
        self.requests.put(None)

    def _lines(self) -> Iterator[bytes]:
        # Not through sys.stdin: its lock, held by a thread that waits, stops the interpreter from ending.
        rest = b""
        while True:
            more = os.read(self.source, 1 << 16)
            if not more:
                return
            *lines, rest = (rest + more).split(b"\n")
            yield from lines

    def _send(self, message: Dict[str, Any]) -> None:
        with self.lock:
            self.out.write(json.dumps(message, allow_nan=False).encode() + b"\n")
            self.out.flush()

    def tell(self, method: str, params: Dict[str, Any]) -> None:
        self._send({"jsonrpc": "2.0", "method": method, "params": params})

    def _answer(self, request: Dict[str, Any]) -> Dict[str, Any]:
        params = request.get("params") or {}
        try:
            method = request.get("method")
            if method == "initialize":
                self.scratch = Path(params["scratch"])
                return {"result": self.plugin.hello()}
            if method == "run":
                return {"result": self._run(request.get("id"), params)}
            if method == "shutdown":
                return {"result": None}
            return _error(_NO_METHOD, f"there is no method `{method}`")
        except Cancelled:
            return _error(_CANCELLED, "interrupted")
        except NodeFailure as failure:
            return _error(_FAILED, str(failure) or "the node fails without a message")
        except KeyError as error:
            traceback.print_exc()
            return _error(_BAD_PARAMS, f"{error} is missing")
        except Exception as error:  # noqa: BLE001 - whatever a node raises is its answer
            traceback.print_exc()
            return _error(_FAILED, f"{type(error).__name__}: {error}")
        finally:
            self.running = None

    def _run(self, number: Any, params: Dict[str, Any]) -> Dict[str, Any]:
        node = self.plugin.nodes.get(params["node"])
        if node is None:
            raise NodeFailure(f"the plugin `{self.plugin.name}` has no node `{params['node']}`")
        self.cancelled.clear()
        self.running = number
        if self.unwanted == number:
            # It was cancelled before it began.
            self.cancelled.set()
        wanted = params["outputs"]
        ctx = Context(
            int(params["seed"]),
            set(wanted),
            self.cancelled,
            lambda fraction, message: self.tell("progress", {"fraction": fraction, "message": message}),
        )
        inputs = {name: self._load(port, params["inputs"].get(name, [])) for name, port in node.inputs.items()}
        results = node(ctx, **inputs, **params["params"])
        folder = self.scratch / params["folder"]
        outputs = {}
        for name, ending in wanted.items():
            value = results.get(name)
            if not isinstance(value, node.outputs[name][0]):
                raise NodeFailure(f"{node.name} gave {type(value).__name__} as `{name}`, which was wanted")
            outputs[name] = _write(folder, f"{name}.{ending}", value.encode())
        return {"outputs": outputs, "notes": ctx.notes}

    def _load(self, port: Dict[str, Any], files: List[str]) -> Any:
        values: List[Value] = [TYPES[port["type"]].decode((self.scratch / file).read_bytes()) for file in files]
        if port.get("many"):
            return values
        return values[0] if values else None


def _error(code: int, message: str) -> Dict[str, Any]:
    return {"error": {"code": code, "message": message}}


def _write(folder: Path, name: str, data: bytes) -> str:
    """Under another name first, so that no half file stands under its own."""
    handle, temporary = tempfile.mkstemp(dir=folder)
    with os.fdopen(handle, "wb") as file:
        file.write(data)
    os.replace(temporary, folder / name)
    return name

"""A node is a decorated function, and a plugin speaks the protocol."""

import json
import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from typing import List, Optional
from unittest import mock

import numpy as np

from gear_sdk import (
    Annotated,
    Context,
    Image,
    Mask,
    NodeFailure,
    Number,
    Plugin,
    choice,
    flag,
    integer,
    number,
    numbers,
    optional,
    or_auto,
    text,
    variant,
    weights,
)

WORKER = """
import logging, sys
from gear_sdk import Annotated, Context, Number, Plugin, NodeFailure, number

plugin = Plugin("test")
print("what libraries print must not be in the way")

@plugin.node(outputs={"sum": (Number, "The sum.")})
def Add(ctx: Context, a: Annotated[Number, "One."], *, amount: float = number(1, "How much.")):
    '''Adds.'''
    logging.warning("adding %s", amount)
    print("noise")
    if amount == 13:
        raise NodeFailure("13 is no amount; use another")
    ctx.progress(0.5, "half")
    while amount == 99:
        ctx.checkpoint()
    ctx.note("added")
    return Number(a.value + amount)

plugin.states(lambda: {"answer": 42})
plugin.serve()
"""


class Description(unittest.TestCase):
    def test_a_function_says_what_gear_needs(self):
        plugin = Plugin("p")

        @plugin.node(outputs={"image": (Image, "Out.")}, version=3, deterministic=False)
        def Blur(
            ctx: Context,
            image: Annotated[Image, "In."],
            mask: Annotated[Optional[Mask], "Where."],
            more: Annotated[List[Image], "More."],
            *,
            radius: float = number(2.0, "How far.", above=0, max=9, unit="px"),
            count: int = integer(1, "How often.", min=1),
            keep: bool = flag(False, "Keep."),
            name: str = text("x", "Name."),
            box: Optional[List[float]] = optional(numbers(None, "Where.", len=4)),
            beta: float = or_auto(number(None, "Strength.")),
            method: object = choice("plain", "How.", [variant("plain", "P."), variant("soft", "S.", knee=number(1, "K."))]),
        ):
            """Blurs."""
            return image

        told = plugin.describe()[0]
        self.assertEqual((told["name"], told["version"], told["deterministic"], told["doc"]), ("Blur", 3, False, "Blurs."))
        self.assertEqual([port.get("optional", False) for port in told["inputs"]], [False, True, False])
        self.assertTrue(told["inputs"][2]["many"])
        params = {param["name"]: param for param in told["params"]}
        self.assertEqual(params["radius"]["range"], {"above": 0, "max": 9})
        self.assertEqual(params["box"], {"name": "box", "doc": "Where.", "kind": {"optional": {"list": {"of": "number", "len": 4}}}, "default": None})
        self.assertEqual(params["beta"]["default"], "auto")
        self.assertEqual(params["method"]["kind"]["choice"][1]["params"][0]["name"], "knee")
        json.dumps(told)
        out = Blur(Context(), Image(np.zeros((1, 1, 3))))
        self.assertEqual(out["image"].rgb.shape, (1, 1, 3))

    def test_what_gear_could_not_know_is_a_mistake_of_the_author(self):
        plugin = Plugin("p")
        with self.assertRaisesRegex(TypeError, "annotated"):

            @plugin.node(outputs={"image": (Image, "")})
            def A(ctx: Context, image: Image):
                pass

        with self.assertRaisesRegex(TypeError, "number"):

            @plugin.node(outputs={"image": (Image, "")})
            def B(ctx: Context, *, radius: float = 2.0):
                pass


class Conversation(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.scratch = Path(self.folder.name)
        self.worker = subprocess.Popen(
            [sys.executable, "-c", WORKER],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            cwd=Path(__file__).parent.parent,
            env={**os.environ, "GEAR_PLUGIN": "1"},
        )
        self.number = 0

    def tearDown(self):
        self.worker.stdin.close()
        self.worker.wait(10)
        self.worker.stdout.close()
        self.folder.cleanup()

    def send(self, method, params, notify=False):
        self.number += 0 if notify else 1
        message = {"jsonrpc": "2.0", "method": method, "params": params}
        if not notify:
            message["id"] = self.number
        self.worker.stdin.write(json.dumps(message).encode() + b"\n")
        self.worker.stdin.flush()

    def answer(self):
        told = []
        while True:
            message = json.loads(self.worker.stdout.readline())
            if "id" in message:
                return message, told
            told.append((message["method"], message["params"]))

    def ask(self, method, params):
        self.send(method, params)
        return self.answer()

    def start(self):
        return self.ask("initialize", {"protocol": 1, "scratch": str(self.scratch)})[0]["result"]

    def run_node(self, amount, node="Add"):
        (self.scratch / "in").mkdir(exist_ok=True)
        (self.scratch / "out").mkdir(exist_ok=True)
        (self.scratch / "in/a.json").write_text("2.5")
        return {
            "node": node, "params": {"amount": amount}, "inputs": {"a": ["in/a.json"]},
            "outputs": {"sum": "json"}, "folder": "out", "seed": 1,
        }  # fmt: skip

    def test_a_node_runs_and_tells_how_far_it_is(self):
        hello = self.start()
        self.assertEqual((hello["name"], hello["states"], len(hello["nodes"])), ("test", {"answer": 42}, 1))
        answer, told = self.ask("run", self.run_node(4))
        self.assertEqual(answer["result"], {"outputs": {"sum": "sum.json"}, "notes": ["added"]})
        self.assertEqual((self.scratch / "out/sum.json").read_text(), "6.5")
        self.assertIn(("progress", {"fraction": 0.5, "message": "half"}), told)
        self.assertIn(("log", {"level": "warning", "message": "adding 4"}), told)
        self.assertEqual(list((self.scratch / "out").iterdir()), [self.scratch / "out/sum.json"])

    def test_failures_are_answers_and_the_worker_goes_on(self):
        self.start()
        self.assertEqual(self.ask("no-such-method", {})[0]["error"]["code"], -32601)
        self.assertIn("13 is no amount", self.ask("run", self.run_node(13))[0]["error"]["message"])
        self.assertIn("no node", self.ask("run", self.run_node(1, "Sub"))[0]["error"]["message"])
        self.assertIn("missing", self.ask("run", {})[0]["error"]["message"])
        self.assertIn("result", self.ask("run", self.run_node(1))[0])

    def test_a_run_can_be_stopped(self):
        self.start()
        self.send("run", self.run_node(99))
        message = json.loads(self.worker.stdout.readline())
        while message["method"] != "progress":
            message = json.loads(self.worker.stdout.readline())
        self.send("cancel", {"id": self.number}, notify=True)
        self.assertEqual(self.answer()[0]["error"]["code"], -32800)
        self.assertIn("result", self.ask("run", self.run_node(1))[0])

    def test_it_ends_when_gear_is_gone_even_in_the_middle_of_a_node(self):
        self.start()
        self.send("run", self.run_node(99))
        self.worker.stdout.readline()
        self.worker.stdin.close()
        self.assertEqual(self.worker.wait(10), 1)

    def test_it_ends_when_it_is_told_to(self):
        self.start()
        self.assertIsNone(self.ask("shutdown", None)[0]["result"])
        self.assertEqual(self.worker.wait(10), 0)


class Weights(unittest.TestCase):
    def test_code_that_is_cloned_is_found_or_told_how_to_get(self):
        with tempfile.TemporaryDirectory() as folder, mock.patch.dict(os.environ), mock.patch.object(sys, "path", sys.path[:]):
            Path(folder, "a_cloned_module.py").write_text("answer = 42")
            os.environ.pop("CLONE", None)
            with self.assertRaisesRegex(NodeFailure, "Cloned cannot be imported .*clone it, and set CLONE to its folder"):
                with weights.importing("Cloned", "CLONE", "clone it"):
                    import a_cloned_module
            os.environ["CLONE"] = folder
            with weights.importing("Cloned", "CLONE", "clone it"):
                import a_cloned_module
            self.assertEqual(a_cloned_module.answer, 42)

    def test_content_is_told_apart_and_place_is_not(self):
        with tempfile.TemporaryDirectory() as folder:
            a, b = Path(folder, "a"), Path(folder, "b")
            for path in (a, b):
                path.mkdir()
                (path / "w.bin").write_bytes(bytes(range(256)) * 4000)
            self.assertEqual(weights.model(str(a)), weights.model(str(b)))
            (b / "w.bin").write_bytes(bytes(range(256)) * 3999 + bytes(256))
            self.assertNotEqual(weights.model(str(a)), weights.model(str(b)))
        self.assertIn("not downloaded", weights.model("nobody/no-such-model"))
        self.assertEqual(weights.versions("no-such-package"), {"no-such-package": "not installed"})


if __name__ == "__main__":
    unittest.main()

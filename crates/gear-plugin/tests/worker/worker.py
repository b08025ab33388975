"""A worker that needs nothing but Python, and misbehaves on demand. Its node adds to a number, in the way that `mode` says."""

import json
import os
import signal
import sys
import time

MODE_IN_HANDSHAKE = os.environ.get("ODD_HANDSHAKE", "")

NODE = {
    "name": "Odd",
    "doc": "Adds one, or misbehaves.",
    "inputs": [{"name": "number", "type": "Number", "doc": "It."}],
    "outputs": [{"name": "number", "type": "Number", "doc": "One more."}],
    "params": [
        {"name": "mode", "kind": "text", "default": "well", "doc": "How to behave."},
        {"name": "amount", "kind": "number", "default": 1, "doc": "What to add.", "range": {"min": 0, "max": 10}},
    ],
}


def send(message):
    sys.stdout.write(json.dumps({"jsonrpc": "2.0", **message}) + "\n")
    sys.stdout.flush()


def die():
    os.kill(os.getpid(), signal.SIGKILL)


def handshake():
    if "ODD_STARTS" in os.environ:
        with open(os.environ["ODD_STARTS"], "a") as file:
            file.write(f"{os.getpid()}\n")
    if MODE_IN_HANDSHAKE == "exit":
        print("no such model", file=sys.stderr, flush=True)
        sys.exit(3)
    if MODE_IN_HANDSHAKE == "hang":
        time.sleep(600)
    if MODE_IN_HANDSHAKE == "garbage":
        print("Welcome to the worker!", flush=True)
    name = "other" if MODE_IN_HANDSHAKE == "name" else "odd"
    nodes = [NODE] * (1000 if MODE_IN_HANDSHAKE == "many" else 1)
    states = {"pid": os.getpid()} if MODE_IN_HANDSHAKE == "unstable" else {"weights": os.environ.get("ODD_WEIGHTS", "1")}
    if MODE_IN_HANDSHAKE == "environment":
        states = {"environment": sorted(os.environ)}
    return {"protocol": 2 if MODE_IN_HANDSHAKE == "protocol" else 1, "name": name, "nodes": nodes, "states": states}


def run(number, params, scratch):
    mode = params["params"]["mode"]
    with open(os.path.join(scratch, params["inputs"]["number"][0])) as file:
        value = json.load(file) + params["params"]["amount"]
    folder = os.path.join(scratch, params["folder"])
    path = os.path.join(folder, "number.json")
    answer = {"outputs": {"number": "number.json"}, "notes": []}
    if mode == "die":
        send({"method": "progress", "params": {"fraction": 0.5, "message": "half way"}})
        print("Segmentation fault, says the driver\x1b[2J", file=sys.stderr, flush=True)
        with open(path, "w") as file:
            file.write("1")
            file.flush()
            die()
    if mode == "hang":
        time.sleep(600)
    if mode == "garbage":
        print("Loading weights... 100%", flush=True)
    if mode == "flood":
        while True:
            send({"method": "log", "params": {"level": "info", "message": "x" * 1000}})
    if mode == "endless":
        while True:
            sys.stdout.write("x" * 65536)
    if mode == "stranger":
        send({"id": 999, "result": {}})
    if mode == "request":
        send({"id": 1, "method": "open", "params": {"file": "/etc/passwd"}})
    if mode == "huge":
        with open(path, "w") as file:
            file.truncate(1 << 40)
        return answer
    if mode == "link":
        os.symlink("/etc/hostname", path)
        return answer
    if mode == "elsewhere":
        return {"outputs": {"number": "../../../../etc/hostname"}}
    if mode == "absolute":
        return {"outputs": {"number": "/etc/hostname"}}
    if mode == "nothing":
        return {"outputs": {}}
    if mode == "nonsense":
        with open(path, "w") as file:
            file.write("not a number")
        return answer
    if mode == "nan":
        with open(path, "w") as file:
            file.write('"NaN:7ff8000000000000"')
        return answer
    if mode == "fails":
        raise ValueError("the number is not to my taste; give another")
    if mode == "child":
        if os.fork() == 0:
            # Outlives its parent, unless the whole group is ended.
            time.sleep(600)
        with open(os.environ["ODD_OUT"], "w") as file:
            file.write(str(os.getpgrp()))
        die()
    if mode == "slow":
        for i in range(20):
            send({"method": "progress", "params": {"fraction": i / 20, "message": ""}})
            time.sleep(0.05)
    if mode == "note":
        answer["notes"] = ["a note", "a note \x1b[31m in red"]
    if mode == "environment":
        value = len([name for name in os.environ if name == "ODD_SECRET"])
    if mode == "pid":
        value = os.getpid()
    temporary = path + ".part"
    with open(temporary, "w") as file:
        json.dump(value, file)
    os.replace(temporary, path)
    return answer


def main():
    scratch = "."
    for line in sys.stdin:
        request = json.loads(line)
        number = request.get("id")
        method = request["method"]
        params = request.get("params") or {}
        if method == "initialize":
            scratch = params["scratch"]
            send({"id": number, "result": handshake()})
        elif method == "run":
            try:
                if params.get("node") != "Odd":
                    raise ValueError(f"no node {params.get('node')}")
                send({"id": number, "result": run(number, params, scratch)})
            except Exception as error:
                send({"id": number, "error": {"code": -32000, "message": str(error)}})
        elif method == "shutdown":
            send({"id": number, "result": None})
            return
        elif number is not None:
            send({"id": number, "error": {"code": -32601, "message": "no such method"}})


main()

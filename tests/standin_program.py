"""The program of the stand-in engine: releases prepared frames one by one, and misbehaves where it is told to.

The environment variable STANDIN holds, per engine, what it does and after how many frames: {"standin": ["hang", 4]}.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time


def main() -> None:
    name = sys.argv[1]
    mode, after = json.loads(os.environ.get("STANDIN", "{}")).get(name, ["ok", 0])
    prepared = sorted(os.listdir("prepared"))
    print(f"{name} starts with {len(prepared)} frames", flush=True)
    if mode == "ignore":
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
    for k, frame in enumerate(prepared):
        if mode != "ok" and k == after:
            misbehave(mode)
        os.rename(f"prepared/{frame}", f"frames/{frame}")
    if mode == "linger":
        misbehave(mode)
    print(f"{name} is done", flush=True)


def misbehave(mode: str) -> None:
    if mode == "linger":
        signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    if mode in ("hang", "ignore", "linger"):
        child = subprocess.Popen(["sleep", "1000"], start_new_session=True)
        with open("pids", "w") as stream:
            stream.write(f"{os.getpid()} {child.pid}")
        while True:
            time.sleep(0.05)
    if mode == "crash":
        print("something is wrong here", file=sys.stderr, flush=True)
        sys.exit(3)
    if mode == "segfault":
        os.kill(os.getpid(), signal.SIGSEGV)
    if mode == "memory":
        print("MemoryError: std::bad_alloc", file=sys.stderr, flush=True)
        sys.exit(1)
    if mode == "short":
        sys.exit(0)
    if mode == "says":
        with open("failure", "w") as stream:
            stream.write("energy")
        sys.exit(0)


if __name__ == "__main__":
    main()

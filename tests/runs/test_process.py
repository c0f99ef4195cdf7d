"""One supervised process: resources, exit, environment, what it may not leave behind."""

from __future__ import annotations

import os
import sys
import threading

import pytest

from dembench.engines.base import Phase
from dembench.runs.environment import available_cores
from dembench.runs.process import Usage, run_phase


@pytest.fixture
def phase(tmp_path):
    def go(text, *, command=None, **environment):
        usage = Usage()
        made = Phase(name="work", command=command or (sys.executable, "-S", "-c", text), environment=environment)
        ended = run_phase(made, tmp_path, tmp_path, available_cores()[:1], None, threading.Event(), lambda: None, usage)
        return ended, (tmp_path / "work.out").read_text(), (tmp_path / "work.err").read_text()

    return go


def test_cpu_time_and_memory_are_those_of_the_process_and_not_ours(phase):
    ballast = bytearray(b"x") * 300_000_000
    ended, _, _ = phase("import time\nblock = bytearray(b'x') * 60_000_000\nwhile time.process_time() < 0.3: pass")
    assert (ended.exit_code, ended.signal, ended.stopped) == (0, None, None)
    assert 60e6 < ended.usage.peak_memory < 120e6 < len(ballast)
    assert 0.3 <= ended.usage.cpu <= ended.usage.wall + 0.1


def test_memory_and_cpu_of_children_count(phase):
    ended, _, _ = phase(
        "import subprocess, sys\n"
        "text = 'import time; b = bytearray(1) * 50_000_000\\nwhile time.process_time() < 0.2: pass'\n"
        "for k in range(2): subprocess.run([sys.executable, '-S', '-c', text])"
    )
    assert ended.usage.cpu >= 0.4
    assert ended.usage.peak_memory > 50e6


def test_the_environment_and_the_directory_are_those_of_the_phase(phase, tmp_path):
    _, out, _ = phase("import os; print(os.environ['GRAINS'], os.getcwd())", GRAINS="many")
    assert out.split() == ["many", str(tmp_path)]


def test_a_program_that_does_not_exist(phase):
    ended, _, err = phase("", command=("no-such-program",))
    assert ended.exit_code == 127 and "cannot start no-such-program" in err


def test_a_process_that_ends_while_it_is_asked_to(tmp_path):
    """It has ended, unseen so far, when the tick asks for its end: its exit code is still found."""
    guards = []

    def tick():
        os.waitid(os.P_PID, guards[0], os.WEXITED | os.WNOWAIT)
        return "fault"

    made = Phase(name="work", command=(sys.executable, "-S", "-c", "raise SystemExit(3)"), environment={})
    event = threading.Event()
    ended = run_phase(made, tmp_path, tmp_path, available_cores()[:1], None, event, tick, Usage(), guards.append)
    assert (ended.exit_code, ended.stopped) == (3, "fault")


def test_the_command_goes_through_no_shell(phase, tmp_path):
    _, out, _ = phase("", command=("echo", "$(touch evil)", ";", "touch", "evil"))
    assert out.strip() == "$(touch evil) ; touch evil"
    assert not (tmp_path / "evil").exists()


@pytest.mark.parametrize(("code", "name"), [(137, "SIGKILL"), (139, "SIGSEGV"), (255, None), (3, None)])
def test_exit_codes_above_128_tell_of_signals(phase, code, name):
    ended, _, _ = phase(f"raise SystemExit({code})")
    assert (ended.exit_code, ended.signal) == (code, name)

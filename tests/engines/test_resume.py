"""In-tree engines: a run that goes on from a checkpoint gives the bits of one that was never interrupted."""

from __future__ import annotations

import shutil
import signal
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from conftest import wait_for
from hopper import hopper

from dembench.engines import registry
from dembench.engines.base import CHECKPOINTS, Series
from dembench.engines.in_tree_program import simulate
from dembench.scene import Scene
from dembench.solver import Simulation

KINDS = {
    "soft": ("peclet-hertz", {}),
    "soft-2": ("peclet-hertz", {"threads": "2"}),
    "compliant": ("peclet", {"dt": "5e-5"}),
    "rigid": ("peclet", {"rows": "rigid", "dt": "5e-5"}),
}


@pytest.fixture(autouse=True)
def own_handler() -> Iterator[None]:
    before = signal.getsignal(signal.SIGTERM)
    yield
    signal.signal(signal.SIGTERM, before)


class Deck:
    """A deck of an engine for the hopper, simulated in this process."""

    def __init__(self, path: Path, kind: str = "soft", scene: Scene | None = None) -> None:
        name, overrides = KINDS[kind]
        self.path, self.scene, self.engine = path, scene or hopper(), registry.engine(name)
        self.settings = self.engine.settings(self.scene, "closed", overrides)
        self.arguments = (self.scene, self.settings, path)
        path.mkdir()
        self.engine.write(*self.arguments)

    def simulate(self, interrupted_at: float | None = None, start: Path | None = None) -> None:
        """Runs to the end, or until SIGTERM arrives on the way to the first record after a time [s]."""
        make = self.engine.simulation  # type: ignore[attr-defined]
        if interrupted_at is None:
            simulate(self.path, make, self.settings.model_dump(), start=start)
            return
        with pytest.MonkeyPatch.context() as patch, pytest.raises(SystemExit) as ended:
            patch.setattr(Simulation, "step", _asked_to_end(interrupted_at))
            simulate(self.path, make, self.settings.model_dump(), start=start)
        assert ended.value.code == 128 + signal.SIGTERM

    def go_on(self, interrupted_at: float | None = None) -> None:
        (phase,) = self.engine.resume(*self.arguments) or []
        assert phase.command[1:3] == ("-m", "dembench.engines.in_tree_program")
        self.simulate(interrupted_at, self.path / phase.command[-1])

    def read(self) -> Series:
        return self.engine.read(*self.arguments)


def _asked_to_end(time: float) -> Callable[..., None]:
    step = Simulation.step

    def stepped(self: Simulation, n: int, progress: Callable[[int], None] | None = None) -> None:
        if self.time >= time:
            signal.raise_signal(signal.SIGTERM)
        step(self, n, progress)

    return stepped


def same(a: Series, b: Series) -> None:
    """Asserts that two series are the same to the last bit."""
    assert [f.step for f in a.frames] == [f.step for f in b.frames]
    for one, other in zip(a.frames, b.frames, strict=True):
        for name in ("present", "position", "velocity", "angular_velocity"):
            assert getattr(one, name).tobytes() == getattr(other, name).tobytes(), (name, one.time)
        for wall, force in one.wall_forces.items():
            assert force.tobytes() == other.wall_forces[wall].tobytes(), (wall, one.time)
    assert a.tracks is not None and b.tracks is not None
    for name in ("step", "time", "position", "velocity"):
        assert getattr(a.tracks, name).tobytes() == getattr(b.tracks, name).tobytes(), name
    assert (a.time, a.counters, a.failure) == (b.time, b.counters, b.failure)


@pytest.mark.parametrize("kind", list(KINDS))
def test_a_resumed_run_gives_the_same_bits(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Interrupted 16 steps after a track, with looks as in a slow run, while grains leave and walls carry forces."""
    monkeypatch.setattr("dembench.engines.in_tree_program.LOOK_INTERVAL", 0.0)
    straight, broken = Deck(tmp_path / "a", kind), Deck(tmp_path / "b", kind)
    straight.simulate()
    broken.simulate(0.0185)
    found = broken.engine.checkpoint(*broken.arguments)
    assert found is not None and 0.0185 < found.time < 0.02 and found.note == ""
    partial = broken.read()
    assert partial.tracks is not None and partial.tracks.time[-1] == pytest.approx(0.019)
    broken.go_on()
    series = broken.read()
    same(straight.read(), series)
    present = [len(f.present) for f in series.frames]
    assert present[5] < present[0] and present[-1] < present[5], "grains leave before and after"
    for frames in (series.frames[:5], series.frames[5:]):
        assert all(any(f.wall_forces[w].any() for f in frames) for w in ("barrel", "cone")), "forces before and after"
    assert 0 < series.timing.loop < 60 and series.timing.source == "engine"


def test_what_was_written_after_the_checkpoint_goes(tmp_path: Path) -> None:
    """A later end without a checkpoint: what lies beyond the one that there is is cut, then made again."""
    straight, broken = Deck(tmp_path / "a"), Deck(tmp_path / "b")
    straight.simulate()
    broken.simulate(0.01)
    kept = tmp_path / "kept"
    shutil.copytree(broken.path / CHECKPOINTS, kept)
    broken.go_on()
    (broken.path / "timing.json").unlink()
    shutil.rmtree(broken.path / CHECKPOINTS, ignore_errors=True)
    shutil.copytree(kept, broken.path / CHECKPOINTS)
    (broken.path / "frames" / "7000.tmp").write_bytes(b"half a frame")
    with open(broken.path / "tracks.bin", "ab") as stream:
        stream.write(b"half")
    assert broken.engine.resume(*broken.arguments)
    cut = broken.read()
    assert [f.time for f in cut.frames] == pytest.approx([0, 0.004, 0.008])
    assert cut.tracks is not None and cut.tracks.time[-1] == cut.time == pytest.approx(0.01)
    assert not list((broken.path / "frames").glob("*.tmp"))
    broken.go_on()
    same(straight.read(), broken.read())


def _spoilt(path: Path) -> None:
    content = bytearray((path / "state.npz").read_bytes())
    content[len(content) // 2] ^= 1
    (path / "state.npz").write_bytes(content)


def test_a_damaged_checkpoint_falls_back_to_the_one_before(tmp_path: Path) -> None:
    """Two are kept; one bit of the later one differs. Without any, the run cannot be gone on with."""
    straight, broken = Deck(tmp_path / "a"), Deck(tmp_path / "b")
    straight.simulate()
    broken.simulate(0.005)
    for time in (0.01, 0.015):
        broken.go_on(time)
    stored = sorted((broken.path / CHECKPOINTS).iterdir(), key=lambda p: int(p.name))
    assert len(stored) == 2
    _spoilt(stored[1])
    found = broken.engine.checkpoint(*broken.arguments)
    assert found is not None and found.step == int(stored[0].name)
    assert found.note.startswith("damaged: checkpoint at t = 0.016 s")
    kept = tmp_path / "kept"
    shutil.copytree(broken.path, kept)
    broken.go_on()
    same(straight.read(), broken.read())
    shutil.rmtree(broken.path)
    shutil.copytree(kept, broken.path)
    _spoilt(stored[0])
    assert broken.engine.checkpoint(*broken.arguments) is None
    assert broken.engine.resume(*broken.arguments) is None


def test_checkpoints_are_written_in_intervals(tmp_path: Path) -> None:
    """With an interval of 0 as often as their share of the time allows; the two last ones stay."""
    deck = Deck(tmp_path / "a")
    simulate(deck.path, deck.engine.simulation, deck.settings.model_dump(), interval=0.0)  # type: ignore[attr-defined]
    steps = [int(path.name) for path in (deck.path / CHECKPOINTS).iterdir()]
    assert 1 <= len(steps) <= 2 and max(steps) <= 8000


def test_the_program_of_a_deck_ends_with_a_checkpoint_when_asked(tmp_path: Path) -> None:
    """The real process: SIGTERM once the first frame is there, then on to the end."""
    deck = Deck(tmp_path / "a", scene=hopper(duration=4.0))
    (phase,) = deck.engine.write(*deck.arguments)
    child = subprocess.Popen(phase.command, cwd=deck.path)
    try:
        wait_for(lambda: len(deck.read().frames) > 1)
    finally:
        child.terminate()
    assert child.wait(30) == 128 + signal.SIGTERM
    found = deck.engine.checkpoint(*deck.arguments)
    assert found is not None and found.time >= deck.read().frames[-1].time

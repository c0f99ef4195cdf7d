"""The cache of generated beds."""

import multiprocessing

import numpy as np
import pytest

from dembench.initial.cache import cache_directory, cached

ARRAY = np.arange(6.0).reshape(2, 3)


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("DEMBENCH_CACHE", str(tmp_path / "cache"))


def never():
    raise AssertionError("it should have been in the cache")


def test_made_once_and_then_read():
    np.testing.assert_array_equal(cached("bed", {"n": 2}, lambda: ARRAY), ARRAY)
    np.testing.assert_array_equal(cached("bed", {"n": 2}, never), ARRAY)


def test_other_inputs_are_another_entry():
    cached("bed", {"n": 2}, lambda: ARRAY)
    np.testing.assert_array_equal(cached("bed", {"n": 3}, lambda: 2 * ARRAY), 2 * ARRAY)
    np.testing.assert_array_equal(cached("bed", {"n": 2}, never), ARRAY)


def test_nothing_is_left_of_a_failed_bed():
    with pytest.raises(RuntimeError):
        cached("bed", {"n": 2}, lambda: (_ for _ in ()).throw(RuntimeError("no bed")))
    assert not cache_directory().exists()


@pytest.mark.parametrize("damage", [lambda b: b[:50], lambda b: b"", lambda b: b[:-9] + b"garbage!!"])
def test_a_damaged_file_is_made_anew(damage):
    cached("bed", {"n": 2}, lambda: ARRAY)
    (path,) = cache_directory().iterdir()
    path.write_bytes(damage(path.read_bytes()))
    np.testing.assert_array_equal(cached("bed", {"n": 2}, lambda: 3 * ARRAY), 3 * ARRAY)
    np.testing.assert_array_equal(cached("bed", {"n": 2}, never), 3 * ARRAY)


def test_a_file_of_other_inputs_is_not_used():
    cached("bed", {"n": 2}, lambda: ARRAY)
    (path,) = cache_directory().iterdir()
    np.savez(path, array=5 * ARRAY, inputs=np.array("something else"))
    np.testing.assert_array_equal(cached("bed", {"n": 2}, lambda: ARRAY), ARRAY)


def _fill(value):
    cached("bed", {"n": 2}, lambda: np.full((1000, 3), float(value)))


def test_two_processes_at_once_leave_one_whole_file():
    context = multiprocessing.get_context("spawn")
    workers = [context.Process(target=_fill, args=(k,)) for k in (1, 2)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert len(list(cache_directory().iterdir())) == 1
    found = cached("bed", {"n": 2}, never)
    assert found.shape == (1000, 3) and np.ptp(found) == 0

"""The published data set in the cache: fetched once, with checksums that are recorded then and verified ever after."""

from __future__ import annotations

import hashlib
import os
import shutil
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePath, PurePosixPath

from dembench.initial.cache import cache_directory
from dembench.initial.download import download
from dembench.initial.progress import Progress, silent
from dembench.initial.published import names_of
from dembench.initial.rows import CoordinatesError

RECORDS = {"dosta2024": "10.5281/zenodo.8252892"}
"""Data sets by name, with their records."""
MIRROR = "DEMBENCH_DATA_URL"
"""Environment variable with the base address of a mirror."""
SUMS = "sha256sums.txt"
PREFERRED = "initialcoordinates"
"""Directory of the record whose files come first where it has several of a name."""
STORED = {
    **{
        f"silo {orifice} {material}": f"PartCoordinates {material} ({orifice} orifice).txt"
        for orifice in ("large", "small")
        for material in ("M1", "M2")
    },
    "drum": "drum_PartCoordinates.txt",
    **{f"impact {count}k": f"{count}KParticles.txt" for count in (25, 50, 100)},
    **{f"{orifice} silo walls": f"walls ({orifice} orifice).txt" for orifice in ("large", "small")},
    "drum walls": "drum_walls.txt",
    "impact walls": "penetration_walls.txt",
}
"""Names in the cache of the files that the cases use."""


class FetchError(CoordinatesError):
    """A data set that is not there, not complete or not what it was."""


@dataclass(frozen=True)
class Fetched:
    """What is in the cache.

    Attributes:
        directory: Where.
        names: The files that are there, as in `dembench.initial.published.FILES`.
        missing: Those that are not.
    """

    directory: Path
    names: tuple[str, ...]
    missing: tuple[str, ...]


def data_directory(name: str) -> Path:
    """The directory of a data set in the cache, its checksums verified.

    Raises:
        FetchError: It is not known, not there, or a file is not the one that was fetched.
    """
    directory = _place(name)
    if not (directory / SUMS).is_file():
        raise FetchError(f"{name} is not in the cache ({directory}); `dembench data fetch {name}` brings it")
    for file, recorded in _recorded(directory).items():
        found = _sum(directory / file)
        if found != recorded:
            state = "missing" if found is None else f"another file: sha256 {found}, {recorded} when it was fetched"
            raise FetchError(f"{directory / file} is {state}; `dembench data fetch {name} --again` replaces all of it")
    return directory


def initial_state(given: Path | None) -> Path | None:
    """The directory of a data set where one is named and no file has that name; else what is given.

    Raises:
        FetchError: See `data_directory`.
    """
    if given is None or str(given) not in RECORDS or given.exists():
        return given
    return data_directory(str(given))


def fetch(
    name: str,
    source: Path | None = None,
    url: str | None = None,
    progress: Progress = silent,
    again: bool = False,
) -> Fetched:
    """Brings a data set into the cache, beside the files of it that are there.

    Args:
        name: The data set.
        source: Directory or archive with a local copy; None loads the record.
        url: Base address of a mirror; None takes that of the environment variable DEMBENCH_DATA_URL, or the record.
        progress: Called while files are loaded.
        again: Whether it takes the place of what is there, damaged or not, once it has come.

    Raises:
        FetchError: It is not known, has none of the files, several of one name, or others than were recorded at first.
        DownloadError: See `download`.
    """
    directory = _place(name)
    before = _recorded(data_directory(name)) if (directory / SUMS).is_file() and not again else {}
    loaded = directory.with_name(f".{name}.download")
    if source is None:
        address = url or os.environ.get(MIRROR)
        found = _chosen(download(RECORDS[name], address, _is_wanted, loaded, progress), address or RECORDS[name])
    else:
        if not source.exists():
            raise FetchError(f"{source}: no such file or directory")
        found = _chosen([source], str(source))
    for what, data in found.items():
        own = hashlib.sha256(data).hexdigest()
        if before.get(STORED[what], own) != own:
            raise FetchError(
                f"{STORED[what]} is another file than at first: sha256 {own}, {before[STORED[what]]} in {directory}; "
                "--again takes the new one, and no other file that is there"
            )
    _store(directory, found, before)
    shutil.rmtree(loaded, ignore_errors=True)
    there = set(_recorded(directory))
    names = tuple(what for what, file in STORED.items() if file in there)
    return Fetched(directory, names, tuple(what for what in STORED if what not in names))


def _place(name: str) -> Path:
    if name not in RECORDS:
        raise FetchError(f"no data set is called '{name}'; accepted are {', '.join(RECORDS)}")
    return cache_directory() / name


def _is_wanted(name: str) -> bool:
    return name.lower().endswith(".zip") or bool(names_of(PurePosixPath(name)))


def _chosen(paths: list[Path], source: str) -> dict[str, bytes]:
    """Contents of the files that the cases use, by name; several of one name must be equal or one be preferred."""
    found: dict[str, dict[bytes, str]] = {}
    for place, data in _candidates(paths):
        for what in names_of(place):
            found.setdefault(what, {}).setdefault(data, str(place))
    if not found:
        raise FetchError(f"{source}: has none of the files of the cases; they are {', '.join(STORED.values())}")
    chosen = {}
    for what, contents in found.items():
        first = {data: place for data, place in contents.items() if PREFERRED in place.lower()} or contents
        if len(first) > 1:
            raise FetchError(f"{source}: {', '.join(first.values())} differ and can all be the {what}")
        chosen[what] = next(iter(first))
    return chosen


def _candidates(paths: list[Path]) -> Iterator[tuple[PurePath, bytes]]:
    """Files with their contents, those in archives too; only those whose name is known are read."""
    for path in paths:
        if path.is_dir():
            yield from _candidates([p for p in sorted(path.rglob("*")) if p.is_file() and _is_wanted(str(p))])
        elif path.suffix.lower() == ".zip":
            try:
                with zipfile.ZipFile(path) as archive:
                    for member in archive.namelist():
                        if names_of(place := PurePosixPath(member)):
                            yield place, archive.read(member)
            except (zipfile.BadZipFile, OSError) as error:
                raise FetchError(f"{path}: no readable archive: {error}") from None
        else:
            yield path, path.read_bytes()


def _store(directory: Path, found: dict[str, bytes], before: dict[str, str]) -> None:
    """Puts files and checksums into a new directory that then takes the place of the old one."""
    new, old = (directory.with_name(f".{directory.name}.{what}") for what in ("new", "old"))
    shutil.rmtree(new, ignore_errors=True)
    new.mkdir(parents=True)
    try:
        for file in before:
            shutil.copy2(directory / file, new / file)
        sums = dict(before)
        for what, data in found.items():
            (new / STORED[what]).write_bytes(data)
            sums[STORED[what]] = hashlib.sha256(data).hexdigest()
        (new / SUMS).write_text("".join(f"{value}  {file}\n" for file, value in sorted(sums.items())))
        shutil.rmtree(old, ignore_errors=True)
        if directory.exists():
            os.replace(directory, old)
        os.replace(new, directory)
    finally:
        shutil.rmtree(new, ignore_errors=True)
    shutil.rmtree(old, ignore_errors=True)


def _recorded(directory: Path) -> dict[str, str]:
    """Checksums by file name, as `sha256sum` writes them."""
    lines = (directory / SUMS).read_text().splitlines()
    return {file: value for value, _, file in (line.partition("  ") for line in lines)}


def _sum(path: Path) -> str | None:
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        return None

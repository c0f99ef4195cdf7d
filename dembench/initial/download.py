"""Downloads the files of a data record, or of a mirror of it; what was cut off goes on where it ended."""

from __future__ import annotations

import io
import os
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pooch
import requests

from dembench.initial.progress import Progress
from dembench.initial.rows import CoordinatesError

REGISTRY = "registry.txt"
"""List of a mirror: a line per file with its name and checksum, as pooch writes it."""
TIMEOUT = 30
"""Time in which a server must answer [s]."""
CHUNK = 1 << 16
"""Bytes that are written at a time."""


class DownloadError(CoordinatesError):
    """A record or file that could not be had: names it and says why."""


def download(
    doi: str, url: str | None, wanted: Callable[[str], bool], directory: Path, progress: Progress
) -> list[Path]:
    """The files of a record.

    A file that is already there with the right checksum is not loaded again, one that was cut off is completed.

    Args:
        doi: The record.
        url: Base address of a mirror that holds the files and their list; None goes to the record itself.
        wanted: Whether a file of that name is loaded.
        directory: Where to.
        progress: Called while a file is loaded.

    Raises:
        DownloadError: The list or a file cannot be had, is cut off, or is another than the list says.
    """
    pooch.get_logger().setLevel("ERROR")
    source = url or f"doi:{doi}"
    files = pooch.create(path=directory, base_url=f"{source.rstrip('/')}/", registry={})
    _reported(f"the list of files of {source}", lambda: _load_list(files, url))
    names = [name for name in files.registry if wanted(name)]
    if not names:
        raise DownloadError(f"{source} has no file that is known here; it lists {', '.join(files.registry) or 'none'}")
    record = None if url else doi
    found = []
    for name in names:
        load = partial(files.fetch, name, downloader=_Loader(name, directory, record, progress))
        found.append(Path(_reported(f"{name} of {source}", load)))
    return found


def _load_list(files: pooch.Pooch, url: str | None) -> None:
    if url is None:
        files.load_registry_from_doi()
        return
    answer = requests.get(f"{url.rstrip('/')}/{REGISTRY}", timeout=TIMEOUT)
    answer.raise_for_status()
    files.load_registry(io.StringIO(answer.text))


def _reported(what: str, work: Callable[[], object]) -> str:
    """The text of what `work` returns; its failure as one line."""
    try:
        return str(work())
    except requests.HTTPError as error:
        answer = error.response
        reason = f"the server answers {answer.status_code} {answer.reason}" if answer is not None else str(error)
    except requests.exceptions.ChunkedEncodingError:
        reason = "the connection ended before the file did"
    except requests.Timeout:
        reason = "the server does not answer in time"
    except requests.ConnectionError:
        reason = "no connection to the server"
    except (requests.RequestException, ValueError, KeyError, OSError) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
    raise DownloadError(f"{what} could not be had: {reason}; the cache is as it was. `--from DIR` takes a local copy")


class _Loader:
    """Loads one file for pooch, which then compares its checksum."""

    def __init__(self, name: str, directory: Path, record: str | None, progress: Progress) -> None:
        self._name, self._record, self._progress = name, record, progress
        self._part = directory / f".{name.replace('/', '_')}.part"

    def __call__(self, url: str, output_file: str, files: pooch.Pooch) -> None:
        """Loads what an attempt before did not; the file is complete when it gets its name."""
        if self._record is not None:
            url = pooch.downloaders.doi_to_repository(self._record).download_url(self._name)
        before = self._part.stat().st_size if self._part.exists() else 0
        headers = {"Accept-Encoding": "identity"} | ({"Range": f"bytes={before}-"} if before else {})
        with requests.get(url, headers=headers, stream=True, timeout=TIMEOUT) as answer:
            if answer.status_code == requests.codes.requested_range_not_satisfiable:
                self._part.unlink()
            answer.raise_for_status()
            if answer.status_code != requests.codes.partial_content:
                before = 0
            total = before + int(answer.headers.get("content-length", 0))
            with open(self._part, "ab" if before else "wb") as stream:
                for chunk in answer.iter_content(CHUNK):
                    stream.write(chunk)
                    done = stream.tell()
                    self._progress(min(1.0, done / total) if total else 0.0, f"{self._name}, {done / 1e6:.1f} MB")
        os.replace(self._part, output_file)

"""Downloads the files of a data record, or of a mirror of it; nothing half-written stays."""

from __future__ import annotations

import io
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pooch
import requests

from dembench.initial.progress import Progress
from dembench.initial.rows import CoordinatesError

REGISTRY = "registry.txt"
"""List of a mirror: a line per file with its name and checksum, as pooch writes it."""
MEGABYTE = 1e6


class DownloadError(CoordinatesError):
    """A record or file that could not be had: names it and says why."""


def download(
    doi: str, url: str | None, wanted: Callable[[str], bool], directory: Path, progress: Progress
) -> list[Path]:
    """The files of a record; a file that is already there with the right checksum is not loaded again.

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
    kind = pooch.HTTPDownloader if url else pooch.DOIDownloader
    found = []
    for name in names:
        load = partial(files.fetch, name, downloader=kind(progressbar=_Shown(progress, name)))
        found.append(Path(_reported(f"{name} of {source}", load)))
    return found


def _load_list(files: pooch.Pooch, url: str | None) -> None:
    if url is None:
        files.load_registry_from_doi()
        return
    answer = requests.get(f"{url.rstrip('/')}/{REGISTRY}", timeout=30)
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
    raise DownloadError(f"{what} could not be had: {reason}; nothing of it was kept. `--from DIR` takes a local copy")


class _Shown:
    """What pooch calls while it loads a file."""

    def __init__(self, progress: Progress, name: str) -> None:
        self.total, self._done, self._progress, self._name = 0, 0, progress, name

    def update(self, size: int) -> None:
        self._done += size
        share = min(1.0, self._done / self.total) if self.total else 0.0
        self._progress(share, f"{self._name}, {self._done / MEGABYTE:.1f} MB")

    def reset(self) -> None:
        self._done = 0

    def close(self) -> None:
        """Nothing is left open."""

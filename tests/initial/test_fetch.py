"""The published data set comes from a record, a mirror or a local copy; what goes wrong leaves nothing half-written."""

import hashlib
import json
import threading
import zipfile
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pooch
import pytest
from pooch.downloaders import ZenodoRepository
from typer.testing import CliRunner

from dembench.cli import app
from dembench.initial.download import DownloadError
from dembench.initial.fetch import MIRROR, RECORDS, STORED, SUMS, FetchError, data_directory, fetch, initial_state
from dembench.initial.published import FILES, find_file, names_of

BED = "Case 3 - Impact/25KParticles.txt"
SILO = "Case 1 - SiloFlow/PartCoordinates M1 (large orifice).txt"
HEADER = "Radius[m] PosX[m] PosY[m] PosZ[m]\r\n"


def sum_of(data):
    return hashlib.sha256(data).hexdigest()


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("DEMBENCH_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv(MIRROR, raising=False)
    return tmp_path / "cache"


@pytest.fixture
def archive(tmp_path):
    """The record's archive: the published names, a second copy elsewhere that differs, and what no case needs."""
    path = tmp_path / "SupplementaryMaterial.zip"
    with zipfile.ZipFile(path, "w") as out:
        out.writestr(f"SupplementaryMaterial/InitialCoordinates/{BED}", HEADER + " 0.001 1 2 3\r\n")
        out.writestr(f"SupplementaryMaterial/InitialCoordinates/{SILO}", "1 2 3\r\n")
        out.writestr("SupplementaryMaterial/Scripts/SomeCode/25KParticles.txt", HEADER + " 0.001 9 9 9\r\n")
        out.writestr("SupplementaryMaterial/Scripts/../../readme.txt", "no case needs this")
    return path


class Server:
    """Answers from a table: path to bytes, to a status, or to bytes of which only the first half is sent."""

    def __init__(self):
        self.answers, self.asked, self.ranges = {}, [], []
        answers, asked, ranges = self.answers, self.asked, self.ranges

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self):
                asked.append(self.path)
                answer = answers.get(self.path, 404)
                if isinstance(answer, int):
                    self.send_error(answer)
                    return
                data, sent = answer if isinstance(answer, tuple) else (answer, len(answer))
                start = int(self.headers.get("Range", "bytes=0-").removeprefix("bytes=").removesuffix("-"))
                ranges.append(start)
                if start >= len(data):
                    self.send_error(416)
                    return
                data = data[start:]
                self.send_response(206 if start else 200)
                self.send_header("Content-Length", str(len(data)))
                self.end_headers()
                self.wfile.write(data[:sent])

            def log_message(self, *_):
                """Nothing is printed."""

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self._server.server_port}"
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def close(self):
        self._server.shutdown()
        self._server.server_close()


@pytest.fixture
def server():
    found = Server()
    yield found
    found.close()


def serve(server, archive, checksum=None):
    data = archive.read_bytes()
    server.answers["/registry.txt"] = f"{archive.name} sha256:{checksum or sum_of(data)}\nraw.bin md5:0\n".encode()
    server.answers[f"/{archive.name}"] = data


def is_clean(cache):
    """Whether the cache has no file but the beginning of one that was cut off."""
    return not any(path.is_file() and path.suffix != ".part" for path in cache.rglob("*"))


def test_a_good_download(cache, server, archive):
    """Files get names of their own in the cache, checksums are recorded, the copy of another code is left alone."""
    serve(server, archive)
    seen = []
    found = fetch("dosta2024", url=server.url, progress=lambda share, text: seen.append((share, text)))
    assert found.names == ("silo large M1", "impact 25k") and "drum" in found.missing
    assert data_directory("dosta2024") == found.directory == cache / "dosta2024"
    bed = find_file(found.directory, "impact 25k")
    assert bed.read_bytes() == (HEADER + " 0.001 1 2 3\r\n").encode()
    assert f"{sum_of(bed.read_bytes())}  {bed.name}" in (found.directory / SUMS).read_text()
    assert seen[-1][0] == 1.0 and seen[-1][1].startswith(archive.name)
    assert sorted(path.name for path in cache.iterdir()) == ["dosta2024"]
    assert server.asked == ["/registry.txt", f"/{archive.name}"]


def test_the_address_of_a_mirror_comes_from_the_environment(cache, server, archive, monkeypatch):
    serve(server, archive)
    monkeypatch.setenv(MIRROR, server.url + "/")
    assert fetch("dosta2024").names == ("silo large M1", "impact 25k")


def test_the_record_itself(cache, server, archive, monkeypatch):
    """The record's own list says which files there are and their checksums."""
    data = archive.read_bytes()
    listed = {
        "key": archive.name,
        "checksum": f"md5:{hashlib.md5(data).hexdigest()}",
        "links": {"self": f"{server.url}/content"},
    }
    server.answers["/api/8252892"] = json.dumps({"files": [listed]}).encode()
    server.answers["/content"] = data
    monkeypatch.setattr(pooch.downloaders, "doi_to_url", lambda doi, **_: "https://zenodo.org/records/8252892")
    monkeypatch.setattr(ZenodoRepository, "base_api_url", f"{server.url}/api")
    assert fetch("dosta2024").names == ("silo large M1", "impact 25k")


@pytest.mark.parametrize(
    "fault,message",
    [
        (
            lambda s, n: s.answers.update({f"/{n}": (s.answers[f"/{n}"], 100)}),
            "the connection ended before the file did",
        ),
        (
            lambda s, n: s.answers.update({f"/{n}": b"other"}),
            "hash of downloaded file .* does not match the known hash",
        ),
        (lambda s, n: s.answers.update({f"/{n}": 404}), "SupplementaryMaterial.zip of http.* answers 404"),
        (lambda s, n: s.answers.update({f"/{n}": 500}), "the server answers 500"),
        (lambda s, n: s.answers.update({"/registry.txt": 503}), "the list of files of http.* the server answers 503"),
        (lambda s, n: s.answers.update({"/registry.txt": b"a b c d e\n"}), "the list of files of .* could not be had"),
        (
            lambda s, n: s.answers.update({"/registry.txt": b"movie.avi md5:0\n"}),
            "no file that is known.*movie.avi",
        ),
        (lambda s, n: s.close(), "no connection to the server"),
    ],
    ids=["cut off", "checksum", "missing", "server error", "no list", "bad list", "other files", "no server"],
)
def test_a_failed_download_keeps_nothing(cache, server, archive, fault, message):
    serve(server, archive)
    fault(server, archive.name)
    with pytest.raises(DownloadError, match=message):
        fetch("dosta2024", url=server.url)
    assert is_clean(cache)
    with pytest.raises(FetchError, match=r"not in the cache.*`dembench data fetch dosta2024` brings it"):
        data_directory("dosta2024")


def test_a_failed_download_is_completed_by_the_next(cache, server, archive, tmp_path):
    """What was loaded to its end is not loaded again."""
    second = tmp_path / "walls.zip"
    with zipfile.ZipFile(second, "w") as out:
        out.writestr("Case 2 - Mixer/walls.txt", "x")
    serve(server, archive)
    server.answers["/registry.txt"] += f"{second.name} {sum_of(second.read_bytes())}\n".encode()
    server.answers[f"/{second.name}"] = 500
    with pytest.raises(DownloadError, match="500"):
        fetch("dosta2024", url=server.url)
    server.answers[f"/{second.name}"] = second.read_bytes()
    assert fetch("dosta2024", url=server.url).names == ("silo large M1", "impact 25k", "drum walls")
    assert server.asked.count(f"/{archive.name}") == 1
    assert sorted(path.name for path in cache.iterdir()) == ["dosta2024"]


@pytest.mark.parametrize("kept", [100, 10**6], ids=["beginning", "longer than the file"])
def test_a_download_that_was_cut_off_goes_on_where_it_ended(cache, server, archive, kept, monkeypatch):
    """The rest is asked for; a beginning that is longer than the file is thrown away by the attempt that finds it."""
    monkeypatch.setattr("dembench.initial.download.CHUNK", 20)
    serve(server, archive)
    name = f"/{archive.name}"
    whole, server.answers[name] = server.answers[name], (server.answers[name], 100)
    with pytest.raises(DownloadError, match="the connection ended before the file did"):
        fetch("dosta2024", url=server.url)
    (part,) = cache.rglob("*.part")
    assert part.read_bytes() == whole[:100]
    part.write_bytes((whole + bytes(10**6))[:kept])
    server.answers[name] = whole
    if kept > len(whole):
        with pytest.raises(DownloadError, match="416"):
            fetch("dosta2024", url=server.url)
    assert fetch("dosta2024", url=server.url).names == ("silo large M1", "impact 25k")
    assert server.ranges[-1] == (100 if kept == 100 else 0)
    assert sorted(path.name for path in cache.iterdir()) == ["dosta2024"]


def test_a_beginning_of_another_file_is_not_taken_for_its_own(cache, server, archive):
    """The checksum of the whole tells, and the next attempt begins anew."""
    serve(server, archive)
    folder = cache / ".dosta2024.download"
    folder.mkdir(parents=True)
    (folder / f".{archive.name}.part").write_bytes(bytes(50))
    with pytest.raises(DownloadError, match="does not match"):
        fetch("dosta2024", url=server.url)
    assert fetch("dosta2024", url=server.url).names == ("silo large M1", "impact 25k")


def test_a_local_copy(cache, archive, tmp_path):
    """A directory, or the archive; files of both names are found, and later copies join the first."""
    folder = tmp_path / "copy"
    folder.mkdir()
    (folder / "drum_PartCoordinates.txt").write_text(HEADER + " 0.001 0 0 0\r\n")
    assert fetch("dosta2024", folder).names == ("drum",)
    assert fetch("dosta2024", archive).names == ("silo large M1", "drum", "impact 25k")
    (folder / "drum_PartCoordinates.txt").write_text(HEADER + " 0.001 0 0 1\r\n")
    with pytest.raises(FetchError, match=r"drum_PartCoordinates.txt is another file than at first: sha256"):
        fetch("dosta2024", folder)
    assert find_file(data_directory("dosta2024"), "drum").read_text().endswith(" 0 0 0\n")


def test_copies_that_cannot_be_used(cache, tmp_path):
    with pytest.raises(FetchError, match="no such file or directory"):
        fetch("dosta2024", tmp_path / "none")
    folder = tmp_path / "copy"
    (folder / "a").mkdir(parents=True)
    with pytest.raises(FetchError, match="has none of the files of the cases; they are PartCoordinates M1"):
        fetch("dosta2024", folder)
    (folder / "a" / "25KParticles.txt").write_text("1")
    (folder / "25KParticles.txt").write_text("2")
    with pytest.raises(FetchError, match="differ and can all be the impact 25k"):
        fetch("dosta2024", folder)
    (tmp_path / "a.zip").write_text("no archive")
    with pytest.raises(FetchError, match=r"a\.zip: no readable archive"):
        fetch("dosta2024", tmp_path / "a.zip")
    with pytest.raises(FetchError, match="no data set is called 'dosta'; accepted are dosta2024"):
        fetch("dosta")
    assert is_clean(cache)


@pytest.mark.parametrize(
    "change,message", [(lambda p: p.write_text("x"), "another file: sha256"), (Path.unlink, "missing")]
)
def test_a_file_that_changed_in_the_cache(cache, archive, change, message):
    directory = fetch("dosta2024", archive).directory
    change(find_file(directory, "impact 25k"))
    with pytest.raises(FetchError, match=f"25KParticles.txt is {message}.*; `dembench data fetch dosta2024 --again`"):
        data_directory("dosta2024")
    with pytest.raises(FetchError, match="--again"):
        fetch("dosta2024", archive)
    done = CliRunner().invoke(app, ["data", "fetch", "dosta2024", "--from", str(archive), "--again"])
    assert done.exit_code == 0 and data_directory("dosta2024") == directory


def test_the_word_stands_for_the_directory(cache, archive, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(FetchError, match="dembench data fetch dosta2024"):
        initial_state(Path("dosta2024"))
    directory = fetch("dosta2024", archive).directory
    assert initial_state(Path("dosta2024")) == directory
    assert initial_state(Path("beds")) == Path("beds") and initial_state(None) is None
    Path("dosta2024").mkdir()
    assert initial_state(Path("dosta2024")) == Path("dosta2024")


def test_every_file_of_the_cases_has_its_name_in_the_cache(tmp_path):
    assert STORED.keys() == FILES.keys() and RECORDS.keys() == {"dosta2024"}
    for name, file in STORED.items():
        assert names_of(tmp_path / "dosta2024" / file) == [name]


def test_the_verb(cache, archive):
    done = CliRunner().invoke(app, ["data", "fetch", "dosta2024", "--from", str(archive), "--json"])
    assert done.exit_code == 0 and json.loads(done.stdout)["files"] == ["silo large M1", "impact 25k"]
    wrong = CliRunner().invoke(app, ["data", "fetch", "dosta2024", "--from", "nowhere"])
    assert wrong.exit_code == 2 and "no such file" in wrong.output

"""A study served on this machine: its pages, and nothing else to nobody else."""

import http.client
import json
import re
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from headform_studies import by_formula, mcstudy, run_text, study_text, told

from mcstudy.execution.results import ResultsFolder
from studies.serving import Server, serve_study

CRASHES = """\
format = "mcstudy-study/1"
kind = "monte-carlo"
name = "crashes"
title = "Two <b>crashes</b> </script>"
[model]
name = "multibody"
[design]
method = "monte-carlo"
n = 3
[inputs.impact_speed]
distribution = "uniform"
unit = "km/h"
low = 35.0
high = 45.0
[report]
outputs = ["hic15"]
histories = 0
"""


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    place = tmp_path_factory.mktemp("served")
    (place / "s.toml").write_text(CRASHES)
    answer = mcstudy("run", place / "s.toml", "--out", place / "out", "--workers", "1")
    assert (answer.code, answer.err) == (0, "")
    with serve_study(ResultsFolder(place / "out")) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield server
        server.shutdown()


def ask(server: Server, path: str, **headers: str) -> tuple[int, str, dict[str, str]]:
    """Return status, text and headers of a request."""
    connection = http.client.HTTPConnection(*server.server_address[:2], timeout=60)
    connection.putrequest("GET", path, skip_host="Host" in headers)
    for name, value in headers.items():
        connection.putheader(name, value)
    connection.endheaders()
    found = connection.getresponse()
    return found.status, found.read().decode(), dict(found.getheaders())


def content(page: str) -> dict:
    found = re.search(r'(?s)id="content">(.*?)</script>', page)
    assert found is not None
    return dict(json.loads(found[1]))


def test_the_explorer_and_any_run_are_served(served: Server) -> None:
    status, page, headers = ask(served, f"/{served.token}/")
    assert status == 200
    assert content(page)["address"] == "run/"
    assert content(page)["title"] == "Two <b>crashes</b> </script>"
    assert "default-src 'none'" in headers["Content-Security-Policy"]
    status, page, _ = ask(served, f"/{served.token}/run/2")
    assert status == 200
    assert content(page)["runs"][0]["label"] == "run 2"
    status, text, _ = ask(served, f"/{served.token}/run/3")
    assert status == 404
    assert "has no run 3, only 0 to 2" in text


@pytest.mark.parametrize(
    "path",
    ["/", "/run/0", "/wrong/", "/{t}x/", "/{t}/../../etc/passwd", "/{t}/%2e%2e/%2e%2e/etc/passwd",
     "/{t}/run/../../s.toml", "/{t}/study.toml", "/{t}/runs.parquet", "/{t}/run/0/", "/{t}/run/-1",
     "/{t}/run/0%00", "/{t}/run/99999999999999999999", "/{t}//etc/passwd"],
)  # fmt: skip
def test_no_other_path_gives_anything(served: Server, path: str) -> None:
    status, text, _ = ask(served, path.replace("{t}", served.token))
    assert status == 404
    assert text == "there is no such page"


def test_other_hosts_and_origins_are_refused(served: Server) -> None:
    path = f"/{served.token}/"
    assert ask(served, path, Origin="http://evil.example")[0] == 403
    assert ask(served, path, Origin="null")[0] == 403
    assert ask(served, path, Host="evil.example")[0] == 403
    assert ask(served, path, Host=f"localhost:{served.server_address[1]}")[0] == 403
    assert ask(served, path, Origin=served.origin)[0] == 200
    assert served.server_address[0] == "127.0.0.1"
    assert len(served.token) >= 32


def test_only_reading_is_possible(served: Server) -> None:
    connection = http.client.HTTPConnection(*served.server_address[:2], timeout=60)
    connection.request("POST", f"/{served.token}/", body="x")
    assert connection.getresponse().status == 501


def test_two_servers_have_different_tokens_and_a_map_is_refused(
    served: Server, tmp_path: Path
) -> None:
    with Server(lambda _: None) as other:
        assert other.token != served.token
    folder = ResultsFolder(tmp_path / "morris")
    with by_formula():
        run_text(study_text("morris"), folder)
    assert "Morris" in told(mcstudy("view", folder.path))

"""A study served on this machine: its explorer, and any run in three dimensions on demand.

Bound to the loopback address. The address holds a random token, hosts and origins other than its
own are refused, and only two kinds of pages exist: no path reaches a file.
"""

import re
import secrets
import threading
from collections.abc import Callable
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from mcstudy.errors import StudyError, UserError
from mcstudy.execution.results import ResultsFolder
from studies import api
from studies.explorer import explore_runs
from studies.inference.evidence import load_bank
from studies.viewing import view_runs

HOST = "127.0.0.1"
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; frame-src 'self'"
)
"""Content security policy: pages load nothing from anywhere."""

Page = Callable[[str], str | None]
"""Content of a page by its path below the token, None if there is none."""


class Server(ThreadingHTTPServer):
    """A server of pages below a random token.

    Parameters
    ----------
    page : callable
        Content of a page.
    port : int
        0 for a free one.
    """

    daemon_threads = True

    def __init__(self, page: Page, port: int = 0) -> None:
        self.page, self.token = page, secrets.token_urlsafe(24)
        super().__init__((HOST, port), _Handler)

    @property
    def origin(self) -> str:
        """Scheme, host and port."""
        return f"http://{HOST}:{self.server_address[1]}"

    @property
    def address(self) -> str:
        """Address of the first page."""
        return f"{self.origin}/{self.token}/"


class _Handler(BaseHTTPRequestHandler):
    """Answers GET requests of its own pages."""

    server: Server
    protocol_version = "HTTP/1.1"

    def do_GET(self) -> None:  # the name that the library calls
        """Answer with a page, or refuse."""
        own = self.server.origin
        host, origin = self.headers.get("Host", ""), self.headers.get("Origin", own)
        if f"http://{host}" != own or origin != own:
            self._send(HTTPStatus.FORBIDDEN, "this address is for pages of its own only")
            return
        begin = f"/{self.server.token}/"
        given = self.path[: len(begin)].encode("utf-8", "replace")
        if not secrets.compare_digest(given, begin.encode()):
            self._send(HTTPStatus.NOT_FOUND, "there is no such page")
            return
        try:
            content = self.server.page(self.path[len(begin) :])
        except (UserError, StudyError, ValueError) as error:
            self._send(HTTPStatus.NOT_FOUND, str(error))
            return
        if content is None:
            self._send(HTTPStatus.NOT_FOUND, "there is no such page")
        else:
            self._send(HTTPStatus.OK, content, "text/html")

    def _send(self, status: HTTPStatus, text: str, kind: str = "text/plain") -> None:
        body = text.encode("utf-8")
        self.send_response(status)
        self.send_header("Content-Type", f"{kind}; charset=utf-8")
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Content-Security-Policy", POLICY)
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("Referrer-Policy", "no-referrer")
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: object) -> None:
        """Print nothing: the token is in every line."""


def serve_study(results: ResultsFolder, port: int = 0) -> Server:
    """Return the server of a study's folder, not yet started.

    Parameters
    ----------
    results : ResultsFolder
        Of a posterior, Monte Carlo or Sobol' study.
    port : int
        0 for a free one.

    Raises
    ------
    UserError
        If the folder's runs are no sample of the inputs.
    """
    study, model, runs = load_bank(results)
    busy = threading.Lock()

    def page(path: str) -> str | None:
        if path == "":
            return explore_runs(study, model, runs, address="run/")
        found = re.fullmatch(r"run/(\d{1,9})(?:\+(\d{1,9}))?", path)
        if found is None:
            return None
        numbers = [int(text) for text in found.groups() if text]
        # A model's arrays are its own: one run at a time.
        with busy:
            shown = {f"run {number}": api.rerun(results, number) for number in numbers}
        return view_runs(" and ".join(shown), shown) or None

    return Server(page, port)

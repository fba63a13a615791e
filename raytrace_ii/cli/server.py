"""Web server of --serve: one folder, on the local host only; results of observers."""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Callable
from functools import partial
from http import HTTPStatus
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote

if TYPE_CHECKING:
    from metrics.observers.store import ResultFolder

RANGE = re.compile(
    r"bytes=(\d{1,18})-(\d{1,18})?"
)  # a single range with a first byte; other forms get the whole file


class FilePart:
    """Reader of the bytes ``first`` … ``end`` − 1 of a file."""

    def __init__(self, path: str, first: int, end: int) -> None:
        self.file = Path(path).open("rb")  # noqa: SIM115
        self.left = end - first
        self.file.seek(first)

    def read(self, size: int) -> bytes:
        """Return at most ``size`` of the bytes that are left."""
        data = self.file.read(min(size, self.left))
        self.left -= len(data)
        return data

    def close(self) -> None:
        """Close the file."""
        self.file.close()


class PageServer(ThreadingHTTPServer):
    """Server that ignores connections closed early by the browser."""

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Report errors of the server, not of the connection."""
        if not isinstance(sys.exception(), ConnectionError):
            super().handle_error(request, client_address)


class Pages(SimpleHTTPRequestHandler):
    """Handler of requests for files of one folder, for host names of this machine only.

    The check of the host name prevents DNS rebinding: a page of another site, resolved to 127.0.0.1, sends its own.
    """

    def send_head(self) -> Any:
        """Refuse other hosts and invalid file names; send whole files or ranges of bytes."""
        if self.misdirected():
            return None
        if "\0" in unquote(self.path):
            self.send_error(HTTPStatus.BAD_REQUEST)
            return None
        wanted = RANGE.fullmatch(self.headers.get("Range", ""))
        path = self.translate_path(self.path)
        if wanted is None or not os.path.isfile(path):
            return super().send_head()
        return self._send_part(path, int(wanted[1]), int(wanted[2]) if wanted[2] else None)

    def _send_part(self, path: str, first: int, last: int | None) -> Any:
        """Answer a request for the bytes ``first`` to ``last`` of a file, RFC 9110 §14."""
        size = os.path.getsize(path)
        end = size if last is None else min(last + 1, size)
        if first >= end:
            self.send_response(HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE)
            self.send_header("Content-Range", f"bytes */{size}")
            self.send_header("Content-Length", "0")
            self.end_headers()
            return None
        self.send_response(HTTPStatus.PARTIAL_CONTENT)
        self.send_header("Content-Type", self.guess_type(path))
        self.send_header("Content-Range", f"bytes {first}-{end - 1}/{size}")
        self.send_header("Content-Length", str(end - first))
        self.end_headers()
        return FilePart(path, first, end)

    def misdirected(self) -> bool:
        """Refuse a request for a host name of another machine."""
        assert isinstance(self.server, PageServer)
        port = self.server.server_port
        if self.headers.get("Host", "").lower() in (f"127.0.0.1:{port}", f"localhost:{port}"):
            return False
        self.send_error(HTTPStatus.MISDIRECTED_REQUEST)
        return True

    def log_message(self, format: str, *args: Any) -> None:
        """Print nothing."""


class Answers(Pages):
    """Handler that also receives answers of observers: POST results for a number, POST results/NUMBER with all lines.

    Pages of other sites cannot send JSON here: the browser sends a preflight request, which this server refuses.
    """

    def __init__(self, *args: Any, kept: ResultFolder, **kwargs: Any) -> None:
        self.kept = kept
        super().__init__(*args, **kwargs)

    @classmethod
    def into(cls, kept: ResultFolder) -> Callable[..., Answers]:
        """Return a maker of handlers that keep results in a folder."""
        return partial(cls, kept=kept)

    def do_POST(self) -> None:
        """Return a number for a new observer, or store an observer's lines."""
        if self.misdirected():
            return
        found = re.fullmatch(r"/results(?:/(\d{1,9}))?", self.path)
        if found is None:
            self.send_error(HTTPStatus.NOT_FOUND)
        elif self.headers.get_content_type() != "application/json":
            self.send_error(HTTPStatus.UNSUPPORTED_MEDIA_TYPE)
        elif found[1] is None:
            self._reply({"observer": self.kept.new_observer()})
        else:
            self._keep(int(found[1]))

    def _keep(self, number: int) -> None:
        from metrics.observers.results import MOST_BYTES

        size = self.headers.get("Content-Length", "")
        if not (size.isdecimal() and int(size) <= MOST_BYTES):
            self.send_error(HTTPStatus.REQUEST_ENTITY_TOO_LARGE)
            return
        try:
            self.kept.extend(number, self.rfile.read(int(size)))
        except FileNotFoundError:
            self.send_error(HTTPStatus.NOT_FOUND)
        except ValueError:
            self.send_error(HTTPStatus.CONFLICT)
        except OSError:
            self.send_error(HTTPStatus.INSUFFICIENT_STORAGE)
        else:
            self._reply({})

    def _reply(self, value: dict[str, Any]) -> None:
        body = json.dumps(value).encode()
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)


def serve_folder(folder: str, port: int, handler: Callable[..., Pages] = Pages) -> None:
    """Serve a folder on this machine only, until interrupted."""
    try:
        server = PageServer(("127.0.0.1", port), partial(handler, directory=folder))
    except OSError as error:
        raise OSError(f"port {port} cannot be served: {error.strerror}") from None
    with server:
        print(f"http://127.0.0.1:{server.server_port}/ shows the page; Ctrl-C ends the server", flush=True)
        server.serve_forever()

"""Web server of ``raytrace-ii view --serve``: one folder, on the local host only."""

from __future__ import annotations

import sys
from http import HTTPStatus
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import unquote


class PageServer(ThreadingHTTPServer):
    """Server that ignores connections closed early by the browser."""

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Report errors of the server, not of the connection."""
        if not isinstance(sys.exception(), ConnectionError):
            super().handle_error(request, client_address)


class Pages(SimpleHTTPRequestHandler):
    """Handler of requests for files of one folder, for host names of this machine only.

    This refuses DNS rebinding: a page of another site, resolved to 127.0.0.1, sends its own host name.
    """

    def send_head(self) -> Any:
        """Refuse other hosts and invalid file names."""
        assert isinstance(self.server, PageServer)
        port = self.server.server_port
        if self.headers.get("Host", "").lower() not in (f"127.0.0.1:{port}", f"localhost:{port}"):
            self.send_error(HTTPStatus.MISDIRECTED_REQUEST)
            return None
        if "\0" in unquote(self.path):
            self.send_error(HTTPStatus.BAD_REQUEST)
            return None
        return super().send_head()

    def log_message(self, format: str, *args: Any) -> None:
        """Print nothing."""

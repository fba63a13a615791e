"""Commands with --serve in this process."""

import threading

from raytrace_ii.cli.server import PageServer


def served(monkeypatch, run, words, visit):
    """Run a command that serves a page, call ``visit`` with its address, end the server; return what `run` does."""
    real = PageServer.serve_forever

    def serve(server):
        thread = threading.Thread(target=real, args=(server, 0.01))  # looks for its end every 10 ms
        thread.start()
        try:
            visit(f"http://127.0.0.1:{server.server_port}/")
        finally:
            server.shutdown()
            thread.join()

    monkeypatch.setattr(PageServer, "serve_forever", serve)
    return run(*words)

"""A running job in the browser: one page on loopback that asks for its data again and again."""

import json
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

from talus import version, watch_data
from talus.faults import FaultError

HERE = Path(__file__).parent
LOOPBACK = "127.0.0.1"
HOSTS = (LOOPBACK, "localhost")


class Server(ThreadingHTTPServer):
    """Serves the page and the data of one folder on loopback."""

    daemon_threads = True

    def __init__(self, folder: Path, port: int):
        """Take the port (0: any free one); E634 where it is taken."""
        self.folder = folder
        try:
            super().__init__((LOOPBACK, port), Handler)
        except (OSError, OverflowError) as fault:
            say = f"port {port} cannot be used: {getattr(fault, 'strerror', '') or fault}"
            raise FaultError("E634", say, "another --port, or none: a free one is taken") from fault

    @property
    def address(self) -> str:
        """Return the address for the browser."""
        return f"http://{LOOPBACK}:{self.server_port}/"


class Handler(BaseHTTPRequestHandler):
    """Answers three kinds of questions: the page, what there is, one history, the last frame."""

    server: Server

    def do_GET(self) -> None:
        """Answer a question of the page; refuse other hosts' names and unknown paths."""
        if self.headers.get("Host", "").partition(":")[0] not in HOSTS:
            self.send_error(HTTPStatus.FORBIDDEN)
            return
        url = urlsplit(self.path)
        folder = self.server.folder
        try:
            if url.path == "/":
                page = (HERE / "watch.html").read_text("utf-8")
                self.answer("text/html", page.replace("@STAMP@", f"Talus {version()}"))
            elif url.path == "/state.json":
                self.answer_json(state(folder))
            elif url.path == "/frame.json":
                self.answer_json(watch_data.frame(folder))
            elif url.path == "/curve.json":
                name = parse_qs(url.query).get("file", [""])[0]
                if name not in watch_data.tables(folder):
                    raise FaultError("E545", f"no history '{name}'")
                self.answer_json(watch_data.curve(folder, name))
            else:
                self.send_error(HTTPStatus.NOT_FOUND)
        except (FaultError, OSError) as fault:
            self.answer_json({"fault": str(fault)}, HTTPStatus.NOT_FOUND)

    def answer_json(self, value: object, status: HTTPStatus = HTTPStatus.OK) -> None:
        """Send a value as JSON."""
        self.answer("application/json", json.dumps(value), status)

    def answer(self, kind: str, text: str, status: HTTPStatus = HTTPStatus.OK) -> None:
        """Send a text."""
        body = text.encode()
        self.send_response(status)
        self.send_header("Content-Type", f"{kind}; charset=utf-8")
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: object) -> None:
        """Say nothing of each question."""


def state(folder: Path) -> dict:
    """Return the progress of every program and the names of the histories."""
    runs = [watch_data.progress(folder, log) for log in watch_data.logs(folder)]
    return {"folder": folder.resolve().name, "runs": runs, "tables": watch_data.tables(folder)}


def serve(folder: Path, port: int) -> None:
    """Serve until Ctrl-C; E633 where no program has written a log."""
    if not folder.is_dir() or not watch_data.logs(folder):
        hint = "name the folder in which the programs run, once they have begun"
        raise FaultError("E633", f"no run of Talus in {folder}", hint)
    with Server(folder, port) as server:
        print(f"{server.address} (Ctrl-C ends it)", flush=True)
        try:
            server.serve_forever(poll_interval=0.1)
        except KeyboardInterrupt:
            print("talus watch: ended; the run goes on", flush=True)

"""A web server on this machine that serves archives and breaks on demand."""

import hashlib
import http.server
import threading
from pathlib import Path

from jointsdf.abc_dataset import chunks


class Server:
    """A web server on this machine that breaks as it is told to."""

    def __init__(self) -> None:
        self.files: dict[str, bytes] = {}
        self.ranges: list[str | None] = []  # of each request
        self.cuts: list[int] = []  # bytes after which each of the next answers breaks off
        self.codes: list[int] = []  # of the next answers
        self.knows_ranges = True
        served = self

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                served.ranges.append(self.headers.get("Range"))
                data = served.files.get(self.path)
                if data is None or served.codes:
                    self.send_error(served.codes.pop(0) if served.codes else 404)
                    return
                start = int(served.ranges[-1][6:-1]) if served.ranges[-1] and served.knows_ranges else 0
                self.send_response(206 if start else 200)
                if start:
                    self.send_header("Content-Range", f"bytes {start}-{len(data) - 1}/{len(data)}")
                self.send_header("Content-Length", str(len(data) - start))
                self.end_headers()
                self.wfile.write(data[start:][: served.cuts.pop(0) if served.cuts else None])

            def log_message(self, *_: object) -> None:
                pass

        self.web = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.thread = threading.Thread(target=self.web.serve_forever, kwargs={"poll_interval": 0.01})
        self.thread.start()

    def chunk(self, kind: str, path: Path, **wrong: object) -> chunks.Chunk:
        """The served file as the list would give it."""
        data = path.read_bytes()
        self.files[f"/{kind}"] = data
        url = f"http://127.0.0.1:{self.web.server_port}/{kind}"
        right = {"kind": kind, "chunk": "0000", "url": url, "md5": hashlib.md5(data).hexdigest(), "bytes": len(data)}
        return chunks.Chunk(**{**right, **wrong})

    def close(self) -> None:
        self.web.shutdown()
        self.thread.join()
        self.web.server_close()

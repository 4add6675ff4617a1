"""The benchmark page over http, beside the Dagster UI: ``/site`` of the server that ``trace-dag ui`` starts.

It serves the files that its pages link to, by their paths below the root, and nothing else.

A browser opens no local file from a page that a server sent, so the links in the UI lead here. Pages are made of
untrusted reports and maps. They are sent with a sandbox that gives them an origin of their own, so that nothing in them
can act as the user of the UI.
"""

from __future__ import annotations

import mimetypes
from typing import Final

from trace_dag.assets.asgi import App, Message, Receive, Send, send_bytes
from trace_dag.common.errors import Failure, UserError
from trace_dag.common.stage import Stage
from trace_dag.common.storage.files import Storage, check_name
from trace_dag.export.build import INDEX
from trace_dag.export.crash_files import FOLDER
from trace_dag.pages.replay_library import PAGE

PREFIX: Final = "/site"
_HOME: Final = f"{PREFIX}/{FOLDER}/"
REPLAY: Final = f"{_HOME}{PAGE}"
"""The one page that is shown in frames, those of the crashes' pages: their origins are nobody's, not even their own."""
_SERVED: Final = (FOLDER, "pictures", Stage.ROAD_MAP.value, Stage.VERDICT.value)
_SANDBOX: Final = b"sandbox allow-scripts allow-popups allow-popups-to-escape-sandbox allow-downloads"


class BenchmarkSite:
    """An ASGI application in front of another: it serves files of a root below ``/site``."""

    def __init__(self, app: App, storage: Storage) -> None:
        self._app = app
        self._storage = storage

    def _inside(self, name: str) -> str:
        """Return the name, unless a symbolic link leads out of the root."""
        root = self._storage.local_root
        if root is not None and not (root / name).resolve().is_relative_to(root.resolve()):
            raise FileNotFoundError(name)
        return name

    async def __call__(self, scope: Message, receive: Receive, send: Send) -> None:
        """Send a file of the site, or pass the request on if it is for another path."""
        path = str(scope.get("path", ""))
        if scope["type"] != "http" or not (path == PREFIX or path.startswith(f"{PREFIX}/")):
            await self._app(scope, receive, send)
            return
        if path in (PREFIX, f"{PREFIX}/", _HOME.rstrip("/")):
            await send_bytes(send, 307, b"", [(b"location", _HOME.encode())])
            return
        name = INDEX if path == _HOME else path.removeprefix(f"{PREFIX}/")
        try:
            if name.partition("/")[0] not in _SERVED:
                raise FileNotFoundError(name)
            data = self._storage.read(self._inside(check_name(name)))
        except (FileNotFoundError, IsADirectoryError, ValueError, UserError, Failure):
            await send_bytes(
                send,
                404,
                f"There is no {name} in the site; trace-dag run makes it, of many crashes trace-dag open.\n".encode(),
            )
            return
        kind = mimetypes.guess_type(name)[0] or "application/octet-stream"
        headers = [(b"content-security-policy", _SANDBOX), (b"x-content-type-options", b"nosniff")]
        await send_bytes(send, 200, b"" if scope["method"] == "HEAD" else data, headers, kind)

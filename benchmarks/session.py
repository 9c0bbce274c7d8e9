"""A user of the dashboard without a browser: Streamlit's own messages over its websocket.

For load.py and faults.py.
"""

from __future__ import annotations

import asyncio
import time

from streamlit.proto.BackMsg_pb2 import BackMsg
from streamlit.proto.ForwardMsg_pb2 import ForwardMsg
from tornado.httpclient import HTTPRequest
from tornado.websocket import websocket_connect

VALUES = {bool: "bool_value", int: "int_value", float: "double_value", str: "string_value"}


class User:
    """One session on the server at ``port`` of this machine."""

    def __init__(self, port: int):
        self.port = port
        self.ids: dict[str, str] = {}  # of the widgets shown, by their keys
        self.states: dict[
            str, tuple[str, object]
        ] = {}  # what was set: by id, the field of WidgetState and its value
        self.hashes: dict[
            str, str
        ] = {}  # of the pages, by their names in addresses; "" is the home page
        self.page, self.query = "", ""
        self.errors: list[str] = []  # exceptions that the pages showed
        self.red: list[
            str
        ] = []  # what else they showed in red: verdicts, and what is wrong with a value
        self.cached: dict[str, ForwardMsg] = {}

    async def connect(self) -> None:
        """Open the session."""
        request = HTTPRequest(
            f"ws://127.0.0.1:{self.port}/_stcore/stream",
            headers={"Origin": f"http://127.0.0.1:{self.port}"},
        )
        self.socket = await websocket_connect(
            request, subprotocols=["streamlit"], max_message_size=200_000_000
        )

    def close(self) -> None:
        """End the session."""
        self.socket.close()

    async def run(self, **trigger: str) -> float:
        """Run the page with all that was set; seconds until it is ready.

        ``button``: the key of one that is pressed.
        """
        message = BackMsg()
        state = message.rerun_script
        state.page_script_hash, state.page_name, state.query_string = (
            self.hashes.get(self.page, ""),
            self.page,
            self.query,
        )
        for name, (field, value) in self.states.items():
            widget = state.widget_states.widgets.add(id=name)
            if field == "string_array_value":
                widget.string_array_value.data.extend(value)
            else:
                setattr(widget, field, value)
        if trigger:
            state.widget_states.widgets.add(id=self.ids[trigger["button"]], trigger_value=True)
        began = time.perf_counter()
        await self.socket.write_message(message.SerializeToString(), binary=True)
        while not await self.take():
            pass
        return time.perf_counter() - began

    async def take(self) -> bool:
        """Take the next message; whether it ends a run of the page."""
        data = await asyncio.wait_for(self.socket.read_message(), 120)
        if data is None:
            raise ConnectionError("the server has closed the session")
        message = ForwardMsg.FromString(data)
        if message.WhichOneof("type") == "ref_hash":
            message = self.cached[message.ref_hash]
        elif message.metadata.cacheable:
            self.cached[message.hash] = message
        kind = message.WhichOneof("type")
        if kind in ("new_session", "navigation"):
            for page in getattr(message, kind).app_pages:
                self.hashes["" if page.is_default else page.url_pathname] = page.page_script_hash
        if kind == "new_session":
            self.ids = {}
        elif kind == "delta" and message.delta.WhichOneof("type") == "new_element":
            element = message.delta.new_element
            what = element.WhichOneof("type")
            shown = getattr(element, what)
            if what == "exception":
                self.errors.append(f"{self.page}: {shown.type}: {shown.message}")
            elif what == "alert" and shown.format == shown.ERROR:
                self.red.append(f"{self.page}: {shown.body}")
            name = getattr(shown, "id", "")
            if isinstance(name, str) and name.startswith("$$ID-"):
                self.ids[name.removeprefix("$$ID-").partition("-")[2]] = name
        # a rerun asked for by the page itself ends the first run early and is followed by a second
        return kind == "script_finished" and message.script_finished in (
            ForwardMsg.FINISHED_SUCCESSFULLY,
            ForwardMsg.FINISHED_FRAGMENT_RUN_SUCCESSFULLY,
            ForwardMsg.FINISHED_WITH_COMPILE_ERROR,
        )

    async def open(self, page: str, query: str = "") -> float:
        """Open a page by its name in addresses, "" is home; seconds until it is ready."""
        self.page, self.query = page, query
        self.states = {}
        return await self.run()

    async def set(self, key: str, value) -> float:
        """Set a widget of the page; seconds until the page is ready.

        A list is what buttons side by side have chosen.
        """
        field = "string_array_value" if isinstance(value, list) else VALUES[type(value)]
        self.states[self.ids[key]] = field, value
        return await self.run()

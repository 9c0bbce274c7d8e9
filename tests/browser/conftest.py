"""What browser tests share: the tools that also take the pictures of docs/, and where theirs go."""

import pytest

from tests.conftest import ROOT, load_script

OUTPUT = ROOT / "test-output"


@pytest.fixture(scope="session")
def tools():
    """docs/take_pictures.py as a module: a server of its own, pages in Chromium."""
    module = load_script("docs/take_pictures.py")
    OUTPUT.mkdir(exist_ok=True)
    return module


@pytest.fixture(scope="session")
def address(chromium, tools):
    """A server for all that needs none of its own."""
    with tools.dashboard() as found:
        yield found


class Watched:
    """What the browser complains of, and asks of others, in all pages opened."""

    def __init__(self, address):
        self.address, self.messages, self.requests = address, [], []

    def add(self, page):
        page.on("console", self._console)
        page.on("pageerror", lambda error: self.messages.append(str(error)))
        page.on("request", lambda request: self.requests.append(request.url))
        return page

    def _console(self, entry):
        # on an address with a page's name Streamlit looks for its server below that name first, and
        # tells the 404
        if entry.type == "error" and not (
            "404" in entry.text and "/_stcore/" in entry.location["url"]
        ):
            self.messages.append(f"{entry.text} {entry.location}")

    def check(self):
        assert not self.messages, self.messages
        allowed = (f"{self.address}/", self.address.replace("http", "ws") + "/", "data:", "blob:")
        assert self.requests and all(url.startswith(allowed) for url in self.requests), (
            self.requests
        )

"""The command ``spab dashboard``: the dashboard, started from any folder."""

from __future__ import annotations

import socket
from argparse import Namespace

from spab_core.cli import options
from spab_core.cli.options import Answer, Commands
from spab_core.common.errors import InputError
from spab_core.common.paths import HOME
from spab_core.common.validation import check_number
from spab_core.trajectory import compiling

ADDRESS, PORT = "127.0.0.1", 8501


def add_commands(commands: Commands) -> None:
    """Add the command to the parser's."""
    text = "open the dashboard in the browser"
    sub = commands.add_parser("dashboard", help=text, description=text, allow_abbrev=False)
    sub.add_argument("--port", type=options.whole, default=PORT, help=f"default: {PORT}")
    sub.add_argument(
        "--address",
        default=ADDRESS,
        help=f"default: {ADDRESS}, this machine alone; 0.0.0.0: open to the network",
    )
    sub.add_argument("--headless", action="store_true", help="open no browser")
    sub.set_defaults(run=_dashboard, prog=sub.prog, json=False)


def check_free(address: str, port: int) -> None:
    """Raise ``InputError`` unless a server can listen at the address and port."""
    check_number("--port", port, 1, 65535)
    try:
        family, kind, protocol, _, place = socket.getaddrinfo(
            address, port, type=socket.SOCK_STREAM
        )[0]
    except (OSError, UnicodeError):
        raise InputError(
            f"--address = {address[:100]!r} is no address of this machine, such as {ADDRESS}"
        ) from None
    with socket.socket(family, kind, protocol) as trial:
        # as the server does: a port just left is free; on Windows two servers would share a port
        if not hasattr(socket, "SO_EXCLUSIVEADDRUSE"):
            trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            trial.bind(place)
        except PermissionError:
            raise InputError(
                f"--port = {port} is reserved on this machine: give one from 1024 to 65535"
            ) from None
        except OSError as error:
            raise InputError(
                f"--port = {port} cannot be used on {address} ({error.strerror or error}): is a "
                "dashboard open there already? Give another --port"
            ) from None


def _dashboard(args: Namespace) -> Answer:
    check_free(args.address, args.port)
    compiling.start()  # before a page asks for the kernels
    from streamlit.web.cli import main  # half a second that other commands need not wait

    # .streamlit/config.toml beside app.py is read by Streamlit itself
    options = {
        "server.address": args.address,
        "server.port": args.port,
        "server.headless": str(args.headless).lower(),
        # no offer over the inputs to install tools for writers of apps
        "logger.hideWelcomeMessage": "true",
    }
    host = f"[{args.address}]" if ":" in args.address else args.address
    print(f"The dashboard: http://{host}:{args.port} (Ctrl+C ends it)", flush=True)
    main(
        ["run", str(HOME / "app.py"), *(f"--{key}={value}" for key, value in options.items())],
        standalone_mode=False,
    )
    return {}

"""What `pip install` of the built wheel gives: `spab dashboard` from any folder, with its pages,
data and documents.
"""

import os
import shutil
import socket
import subprocess
import sys
import time
import urllib.request

import pytest

from spab_core.cli.main import main
from tests.conftest import ROOT

_OPEN = """
import sys
from streamlit.testing.v1 import AppTest
from spab_core.common.paths import HOME
import spab_core.reporting.report  # opens its template
for name in ("Surrogate_map", "Model_ranking", "Where_to_solve_next", "About_the_model"):
    page = next((HOME / "pages").glob(f"*_{name}.py"))
    at = AppTest.from_file(str(page), default_timeout=60).run()
    print(name, [e.value for e in (*at.exception, *at.error)])
"""


@pytest.mark.slow
def test_dashboard_out_of_the_wheel(tmp_path):
    source, target, elsewhere = tmp_path / "source", tmp_path / "installed", tmp_path / "elsewhere"
    elsewhere.mkdir()
    # a copy, because setuptools leaves a build folder behind and packs what lies in an old one
    shutil.copytree(
        ROOT,
        source,
        ignore=shutil.ignore_patterns(
            ".*", "build", "dist", "test-output", "__pycache__", "*.parts"
        ),
    )
    shutil.copytree(ROOT / ".streamlit", source / ".streamlit")
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    subprocess.run(
        [*pip, "wheel", "--no-deps", "--no-build-isolation", "--wheel-dir", tmp_path, source],
        check=True,
    )
    wheel = next(tmp_path.glob("*.whl"))
    subprocess.run(
        [*pip, "install", "--no-deps", "--no-index", "--target", target, wheel], check=True
    )
    assert (target / "bin" / "spab").exists() or (target / "Scripts").exists()
    assert not [
        p
        for p in target.iterdir()
        if p.name not in ("bin", "Scripts", "spab_core") and p.suffix != ".dist-info"
    ]
    environment = os.environ | {"PYTHONPATH": str(target)}
    opened = subprocess.run(
        [sys.executable, "-c", _OPEN],
        cwd=elsewhere,
        env=environment,
        capture_output=True,
        text=True,
    )
    assert opened.stdout.splitlines() == [
        f"{name} []"
        for name in ("Surrogate_map", "Model_ranking", "Where_to_solve_next", "About_the_model")
    ], opened.stdout + opened.stderr
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [
        sys.executable,
        "-m",
        "spab_core.cli.main",
        "dashboard",
        "--port",
        str(port),
        "--headless",
    ]
    with (tmp_path / "log").open("w") as log:
        server = subprocess.Popen(command, cwd=elsewhere, env=environment, stdout=log, stderr=log)
    try:
        assert _get(f"http://127.0.0.1:{port}/_stcore/health") == b"ok", (
            tmp_path / "log"
        ).read_text()
        assert b"<title>Streamlit</title>" in _get(f"http://127.0.0.1:{port}/")
        second = subprocess.run(
            command, cwd=elsewhere, env=environment, capture_output=True, text=True, timeout=30
        )
        assert (
            second.returncode == 2
            and f"--port = {port} cannot be used on 127.0.0.1" in second.stderr
        )
    finally:
        server.terminate()
        server.wait(timeout=20)
    told = (tmp_path / "log").read_text()
    assert (
        f"http://127.0.0.1:{port}" in told
        and "usage statistics" not in told
        and "Traceback" not in told
    ), told


def _get(address):
    for _ in range(200):
        try:
            with urllib.request.urlopen(address, timeout=5) as answer:
                return answer.read()
        except OSError:
            time.sleep(0.1)
    return b"no answer"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--port", "0"), "--port = 0 is out of range: allowed is from 1 to 65535"),
        (("--port", "many"), "'many' is not a whole number"),
        (
            ("--address", "nowhere.invalid"),
            "--address = 'nowhere.invalid' is no address of this machine",
        ),
        (("--address", "192.0.2.1"), "cannot be used on 192.0.2.1"),
    ],
)
def test_wrong_places_are_refused_in_words(options, words, capsys):
    try:
        code = main(["dashboard", *options])
    except SystemExit as stop:
        code = stop.code
    assert code == 2 and words in capsys.readouterr().err

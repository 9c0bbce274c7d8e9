"""Pages of the docs site that are no files of docs/: README and its like, examples, API reference.

A hook of MkDocs (mkdocs.yml). The reference follows the folders of spab_core: a new package or
module appears by itself.
"""

import ast
import html
import re
from collections.abc import Iterable
from pathlib import Path

from latex2mathml.converter import convert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parent.parent
CORE = ROOT / "spab_core"
FROM_ROOT = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "SECURITY.md": "security.md",
    "CHANGELOG.md": "changelog.md",
}
_RULE = re.compile(r"-{3,}  -{3,}")  # under the heads of a docstring's table
_ROLE = re.compile(r":(?:func|class|mod|data|meth|attr):<code>~?([\w.]+)</code>")
_MATH = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)


def _in_order(names: Iterable[str], table: Path) -> list[str]:
    """Names as the table in a package's docstring has them, those that it lacks last."""
    text = _docstring(table)
    return sorted(names, key=lambda n: (text.find(f"| {n} ") % (len(text) + 1), n))


def _packages() -> list[str]:
    return _in_order(
        (path.parent.name for path in CORE.glob("*/__init__.py")), CORE / "__init__.py"
    )


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Put a page for each package under "API reference"."""
    for entry in config.nav:
        if "API reference" in entry:
            entry["API reference"] = ["api/index.md", *({p: f"api/{p}.md"} for p in _packages())]
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages."""
    pages = {page: _from_root(name) for name, page in FROM_ROOT.items()}
    pages["examples.md"] = _examples()
    pages["api/index.md"] = _public_surface()
    for package in _packages():
        pages[f"api/{package}.md"] = _reference(package)
    for page, text in pages.items():
        files.append(File.generated(config, page, content=text))
    return files


def on_page_content(content: str, **_: object) -> str:
    """Set formulas as MathML, and roles such as ``:func:`` as links where their target is here."""

    def formula(found: re.Match) -> str:
        display = "block" if found[2] == "[" else "inline"
        return convert(html.unescape(found[3]).strip(), display=display)

    def link(found: re.Match) -> str:
        name = found[1]
        return f'<autoref optional identifier="{name}"><code>{name.split(".")[-1]}</code></autoref>'

    return _ROLE.sub(link, _MATH.sub(formula, content))


def _from_root(name: str) -> str:
    """A file of the top folder; links to docs/ lead to the pages, other files are only named."""
    text = (ROOT / name).read_text("utf-8")

    def target(found: re.Match) -> str:
        words, address = found.groups()
        if re.match(r"[a-z]+:|#", address):
            return found[0]
        if address.startswith("docs/"):
            return f"[{words}]({address.removeprefix('docs/')})"
        return f"[{words}]({FROM_ROOT[address]})" if address in FROM_ROOT else words

    return re.sub(r"(?<!!)\[([^\]]+)\]\(([^)\s]+)\)", target, text).replace("](docs/", "](")


def _examples() -> str:
    """The scripts of examples/, each under the first line of its docstring."""
    parts = [
        "# Examples",
        "Scripts of the folder `examples/`; tests run them and check what they print.",
    ]
    for path in sorted((ROOT / "examples").glob("*.py")):
        source = path.read_text("utf-8")
        tree = ast.parse(source)
        title, _, body = (ast.get_docstring(tree) or path.stem).partition("\n")
        code = "\n".join(source.splitlines()[tree.body[0].end_lineno :]).strip()
        parts += [
            f"## {title.rstrip('.')}",
            body.strip(),
            f'```python title="examples/{path.name}"\n{code}\n```',
        ]
    return "\n\n".join(parts)


def _docstring(path: Path) -> str:
    """The docstring of a module, a table in it turned into one of Markdown."""
    lines = (ast.get_docstring(ast.parse(path.read_text("utf-8"))) or "").splitlines()
    for k, line in enumerate(lines):
        if _RULE.match(line):
            end = next((i for i in range(k, len(lines)) if not lines[i].strip()), len(lines))
            rows = [re.split(r" {2,}", row.strip(), maxsplit=1) for row in lines[k - 1 : end]]
            rows[1] = ["---", "---"]
            lines[k - 1 : end] = [f"| {' | '.join(row)} |" for row in rows]
            break
    return "\n".join(lines)


def _public_surface() -> str:
    """What ``from spab_core import`` offers, each name a link to where it is told."""
    tree = ast.parse((CORE / "__init__.py").read_text("utf-8"))
    names = {
        alias.name: node.module
        for node in tree.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if not (alias.asname or alias.name).startswith("_")
    }
    listed = (f"- [`{name}`][{module}.{name}]" for name, module in sorted(names.items()))
    return "\n\n".join(
        [
            "# API reference",
            _docstring(CORE / "__init__.py"),
            "## What `from spab_core import` offers",
            "\n".join(listed),
        ]
    )


def _reference(package: str) -> str:
    """The modules of a package."""
    table = CORE / package / "__init__.py"
    modules = _in_order(
        (path.stem for path in table.parent.glob("*.py") if not path.stem.startswith("_")), table
    )
    return "\n\n".join(
        [
            f"# {package}",
            _docstring(table),
            *(f"::: spab_core.{package}.{module}" for module in modules),
        ]
    )

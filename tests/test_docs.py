"""README and the pages: they build without a warning, link to what is there, stay short, and say what was printed."""

import re
import subprocess
import sys
import tomllib
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
README = ROOT / "README.md"
PAGES = [path for path in sorted(DOCS.rglob("*.md")) if path.parent.name != "tables"]
LONGEST, LONGEST_README = 250, 180
"""Lines of a page, with what it includes, and of README."""
LARGEST = {"pictures": 3e6, "sand.webp": 1.5e6}
"""Most bytes of all pictures, and of the moving one."""


class Links(HTMLParser):
    """The places that a page links to, and those in it that can be linked to."""

    def __init__(self, text):
        super().__init__()
        self.to, self.anchors = set(), set()
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        self.to |= {given[name] for name in ("href", "src") if given.get(name)}
        self.anchors |= {given[name] for name in ("id", "name") if given.get(name)}


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The site, built as `make docs` builds it."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html", "-d", folder / "trees", DOCS]
    done = subprocess.run([*command, folder / "html"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-4000:]
    return folder / "html"


def test_links_of_the_site_lead_somewhere(site):
    """Every page, picture and anchor that a page names is there."""
    pages = {path: Links(path.read_text()) for path in site.rglob("*.html")}
    assert len(pages) > len(PAGES)
    lost = []
    for path, page in pages.items():
        for link in page.to:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not target.is_file() or (
                parts.fragment and target in pages and unquote(parts.fragment) not in pages[target].anchors | {""}
            ):
                lost.append(f"{path.name}: {link}")
    assert lost == []


@pytest.mark.parametrize("path", [README, ROOT / "CONTRIBUTING.md", *PAGES], ids=lambda path: path.name)
def test_links_of_a_source_lead_somewhere(path):
    """As somebody reads it beside the code."""
    links = re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", path.read_text())
    assert [link for link in links if "://" not in link and not (path.parent / link).exists()] == []


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.name)
def test_a_page_is_short(path):
    """With the tables that it includes, but for the changelog."""
    text = path.read_text()
    included = re.findall(r"\{(?:literal)?include\} (\S+/tables/\S+|tables/\S+)", text)
    tables = sum(len((path.parent / name).read_text().splitlines()) for name in included)
    assert len(text.splitlines()) + tables <= LONGEST


def test_readme_is_short():
    assert len(README.read_text().splitlines()) <= LONGEST_README


def test_numbers_of_readme_are_printed():
    """Each number of the table of costs and errors stands in the table that the command of its row printed."""
    rows = re.findall(r"^\| (.*?) \| ([^|]+) \| \[`(rftsim [^`]+)`\]", README.read_text(), re.MULTILINE)
    assert len(rows) == 7
    for what, numbers, command in rows:
        *_, kind, name = command.split()
        table = DOCS / "tables" / (f"{name}.txt" if kind == "bench" else f"validate-{name}.md")
        for number in re.findall(r"-?\d+\.?\d*", numbers):
            assert re.search(rf"(?<![\d.]){re.escape(number)}(?![\d.])", table.read_text()), (what, number)


def test_tables_say_their_command():
    """A text begins with it and a table in Markdown ends with it; all are those that docs/tables.py writes."""
    sys.path.insert(0, str(DOCS))
    try:
        from tables import TABLES
    finally:
        sys.path.remove(str(DOCS))
    for path in (DOCS / "tables").iterdir():
        lines = path.read_text().splitlines()
        assert TABLES[path.name] == lines[0].removeprefix("$ ") or TABLES[path.name] == lines[-1].strip()


def test_tables_are_read():
    """Each is included by a page."""
    text = "".join(path.read_text() for path in PAGES)
    assert [path.name for path in (DOCS / "tables").iterdir() if f"tables/{path.name}" not in text] == []


def test_pictures_are_small():
    """All of the repository's pictures lie in docs/pictures, and each is shown."""
    pictures = list((DOCS / "pictures").iterdir())
    assert sum(path.stat().st_size for path in pictures) < LARGEST["pictures"]
    assert (DOCS / "pictures" / "sand.webp").stat().st_size < LARGEST["sand.webp"]
    text = "".join(path.read_text() for path in PAGES)
    assert [path.name for path in pictures if f"pictures/{path.name}" not in text] == []


def test_one_version():
    """That of pyproject.toml is the changelog's newest, and the one to cite."""
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    newest, date = re.search(r"^## (\S+) \((\S+)\)", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE).groups()
    citation = (ROOT / "CITATION.cff").read_text()
    assert newest == version
    assert f"version: {version}\n" in citation
    assert f'date-released: "{date}"' in citation

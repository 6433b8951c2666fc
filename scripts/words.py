"""Check the words of pages, code, messages, templates and names against the glossary; count the words of the pages.

    python scripts/words.py            # one line per finding; exit status 1 if there are any
    python scripts/words.py --ease     # Flesch reading ease of each page

A user page is README.md or a page of docs/ or docs/notebooks/; docs/research/ is for readers of studies. Code in blocks
and backticks, and formulas, are not prose: only the word count includes them.
"""

import ast
import re
import tokenize
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated

import typer

from scripts.rooms import ROOT, source_files

MOST_WORDS = 20_000
"""Limit for all user pages together, code and tables included: two hours of reading."""

REPLACED = {
    r"unseen": "held out",
    r"valleys?": "local minimum",
    r"at work": "active",
    r"left over": "unexplained",
    r"stand-ins?": "estimated landmark",
    r"ladders?|rungs?": "gap budget",
    r"relie(?:f|ved)": "thorax down-weighting",
    r"bones of their own": "own bones",
    r"sizes of (?:others|other persons)": "population amplitude",
    r"persons' own sizes|sizes of their own": "subject-level amplitude",
}
"""Words that the glossary replaces, each with its term in ``docs/glossary.md``."""

NAMES_THAT_STAY = {
    "left_over_share": "key of diagnosis.json",
    "_unseen": "frames in which no camera saw a marker",
    "unseen": "frames in which no camera saw a marker",
}
"""Names in the code with a word that the glossary replaces elsewhere, each with the reason."""

_FOR_USERS = ("adapt/cli", "adapt/report", "adapt/diagnosis", "motions")
"""Folders whose strings users read: terminal, report, options, warnings and errors."""

_TEMPLATES = "adapt/report/templates"

HISTORY = {
    r"looked at": "docs/research/ says how often data were used",
    r"\b(?=[0-9a-f]*[a-f])(?=[0-9a-f]*[0-9])[0-9a-f]{7,40}\b": "a commit belongs to docs/research/",
    r"[Aa]n? earlier version|[Ee]arlier versions|used to be": "a user page says what is",
}

NOBODY_UNDERSTOOD = (
    "As many causes at random leave",
    "more than halves the gap of living people elsewhere",
    "is the gap of persons with the sizes that the others have",
    "the most probable is taken that predicts persons who were not seen",
    "they are numbers more, which the person's own motions set",
    "say of the bones what they can",
    "along the courses of persons who all have sizes of their own",
    "those of others do",
    "which is none of the search's",
)
"""Parts of sentences that readers of the pages had to read twice."""

REPLACED_IN_PAGES = {r"not seen|have seen|has seen|had not seen": "held out of"}
"""Words that are replaced in pages only: in code a marker is "not seen"."""

NO_SUBJECT = re.compile(r"(?:What|That|Those|Whose|Who|Whoever|Which|How|Of|By(?! default)|And|Nor)\b")
"""Openings of sentences without a noun as their subject. Questions may begin so: they are headings."""

_BLOCK = re.compile(r"^```[^\n]*\n.*?^```|\$\$.*?\$\$|`[^`\n]*`|\$[^$\n]+\$|\]\([^)\s]*\)", re.MULTILINE | re.DOTALL)
_TABLE = re.compile(r"^\|.*$|^#.*$", re.MULTILINE)
_SENTENCE = re.compile(r"[.!?:](?=\s)|\n\n|\n(?=- )")
_WHOLE_SENTENCE = re.compile(r"\S.*?(?:[.!?][*)\"']*(?=\s|$)|(?=\n\s*\n|\n\s*(?:[-*]|\d+\.) |$))", re.DOTALL)
_LIST_MARK = re.compile(r"^(?:[-*#>|]+|\d+\.)?[\s*\"'(#]*")
_VOWELS = re.compile(r"[aeiouy]+")


def user_pages() -> list[Path]:
    """List README.md and the pages of docs/ and docs/notebooks/."""
    docs = ROOT / "docs"
    return [ROOT / "README.md", *sorted(docs.glob("*.md")), *sorted((docs / "notebooks").glob("*.md"))]


def word_count() -> int:
    """Count what white space separates in all user pages, marks of tables included: as `wc -w` does."""
    return sum(len(page.read_text("utf-8").split()) for page in user_pages())


def prose(text: str) -> str:
    """Remove code, formulas and the targets of links, but keep the lines."""
    return _BLOCK.sub(lambda found: "\n" * found.group().count("\n") or " ", text)


def findings(page: Path) -> Iterator[str]:
    """List words of a page that the glossary replaces or that tell history, and sentences that begin without a noun."""
    name, text = str(page.relative_to(ROOT)), page.read_text("utf-8")
    yield from (f"{name}: nobody understood '{one}'" for one in NOBODY_UNDERSTOOD if one in " ".join(text.split()))
    patterns = {**_whole_words(REPLACED), **_whole_words(REPLACED_IN_PAGES), **HISTORY}
    for number, line in enumerate(prose(text).splitlines(), 1):
        yield from _wrong(line, patterns, f"{name}:{number}")
    yield from _without_subject(_TABLE.sub("", text), name)


def code_findings(file: Path) -> Iterator[str]:
    """List the words in docstrings and comments that the glossary replaces, and sentences that begin without a noun."""
    patterns = _whole_words(REPLACED)
    with file.open("rb") as lines:
        for token in tokenize.tokenize(lines.readline):
            if token.type == tokenize.COMMENT or token.string.startswith('"""'):
                where = f"{file.relative_to(ROOT)}:{token.start[0]}"
                yield from _wrong(prose(token.string), patterns, where)
                yield from _without_subject(token.string.strip('#"'), where)


def string_findings(file: Path) -> Iterator[str]:
    """List the words in the strings of a module that the glossary replaces. A string without a blank is a key."""
    tree = ast.parse(file.read_text("utf-8"))
    docstrings = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings:
            where = f"{file.relative_to(ROOT)}:{node.lineno}"
            yield from _wrong(node.value if " " in node.value else "", _whole_words(REPLACED), where)


def name_findings(file: Path) -> Iterator[str]:
    """List the names in a module, and of it, with a word that the glossary replaces."""
    names = {file.stem: 1}
    for node in ast.walk(ast.parse(file.read_text("utf-8"))):
        for kind in ("id", "attr", "arg", "name", "asname"):
            if isinstance(name := getattr(node, kind, None), str):
                names.setdefault(name, getattr(node, "lineno", 1))
    for name, line in names.items():
        if name not in NAMES_THAT_STAY:
            words = re.sub(r"(?<=[a-z])(?=[A-Z])|_", " ", name).lower()
            either = f"{words}, {words.replace(' ', '-')}"
            yield from _wrong(either, _whole_words(REPLACED), f"{file.relative_to(ROOT)}:{line}, {name}")


def text_findings(file: Path) -> Iterator[str]:
    """List the words in the lines of a text, such as a template, that the glossary replaces."""
    for number, line in enumerate(file.read_text("utf-8").splitlines(), 1):
        yield from _wrong(line, _whole_words(REPLACED), f"{file.relative_to(ROOT)}:{number}")


def terms() -> set[str]:
    """Return the terms of ``docs/glossary.md``: the first cells of its tables."""
    text = (ROOT / "docs" / "glossary.md").read_text("utf-8")
    return set(re.findall(r"^\| ([^|]+?) \|", text, re.MULTILINE)) - {"term"}


def _everywhere_in_code() -> Iterator[str]:
    yield from (f"docs/glossary.md: no term '{term}'" for term in REPLACED.values() if term not in terms())
    for file in source_files().values():
        yield from code_findings(file)
        yield from name_findings(file)
        if str(file.relative_to(ROOT)).startswith(_FOR_USERS):
            yield from string_findings(file)
    for text in (ROOT / "Makefile", *sorted((ROOT / _TEMPLATES).iterdir())):
        yield from text_findings(text)


def _without_subject(text: str, where: str) -> Iterator[str]:
    """List the sentences that begin without a noun."""
    code_as_noun = _BLOCK.sub("X", text.replace("``", "`"))
    for found in _WHOLE_SENTENCE.finditer(code_as_noun):
        sentence = _LIST_MARK.sub("", found.group())
        if NO_SUBJECT.match(sentence) and not sentence.rstrip("*)\"' ").endswith("?"):
            yield f"{where}: '{' '.join(sentence.split())[:60]}' begins without a noun"


def _whole_words(replaced: Mapping[str, str]) -> dict[str, str]:
    return {rf"\b(?:{word})\b": term for word, term in replaced.items()}


def _wrong(text: str, patterns: Mapping[str, str], where: str) -> Iterator[str]:
    for pattern, term in patterns.items():
        if found := re.search(pattern, text):
            yield f"{where}: '{found.group()}': {term}"


def reading_ease(text: str) -> float:
    """Compute Flesch's reading ease, 206.835 - 1.015 words a sentence - 84.6 syllables a word, of the running text.

    Syllables are groups of vowels, without a silent e at the end. 30 to 50 is the ease of a scientific paper, 60 to 70
    that of a newspaper (R. Flesch, J. Appl. Psychol. 32 (1948) 221-233).
    """
    running = _TABLE.sub("", prose(text))
    words = re.findall(r"[A-Za-z]{2,}", running)
    sentences = [one for one in _SENTENCE.split(running) if re.search(r"[A-Za-z]{2,}", one)]
    syllables = sum(max(1, len(_VOWELS.findall(re.sub(r"e$", "", word.lower())))) for word in words)
    return 206.835 - 1.015 * len(words) / len(sentences) - 84.6 * syllables / len(words)


app = typer.Typer(add_completion=False)


@app.command()
def main(
    ease: Annotated[bool, typer.Option("--ease", help="Print Flesch's reading ease of each page instead.")] = False,
) -> None:
    """Report everything that is wrong with the words of pages, code and templates; exit status 1 if anything is."""
    if ease:
        for page in user_pages():
            print(f"{reading_ease(page.read_text('utf-8')):5.1f}  {page.relative_to(ROOT)}")
        return
    wrong = [one for page in user_pages() for one in findings(page)]
    wrong += _everywhere_in_code()
    if (count := word_count()) > MOST_WORDS:
        wrong.append(f"user pages have {count} words, at most {MOST_WORDS}")
    if wrong:
        print(*wrong, sep="\n")
        raise typer.Exit(1)


if __name__ == "__main__":
    app()

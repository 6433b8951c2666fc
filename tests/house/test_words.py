"""User pages are short and have one language: the terms of the glossary, no history (`scripts/words.py`)."""

import re

import pytest

from scripts import words
from scripts.rooms import ROOT

MOST_LINES_OF_CHANGELOG = 60
"""Limit for the changelog of a version that is not released."""

MOST_CELLS = 4
"""Limit for the columns of the README's tables: as many as a phone shows."""


def test_user_pages_are_a_few_hours_of_reading():
    assert words.word_count() <= words.MOST_WORDS


def test_words_are_counted_as_wc_counts_them(tmp_path, monkeypatch):
    """The marks of a table and the pages of the notebooks count too."""
    monkeypatch.setattr(words, "ROOT", tmp_path)
    (tmp_path / "docs" / "notebooks").mkdir(parents=True)
    (tmp_path / "docs" / "research").mkdir()
    (tmp_path / "README.md").write_text("| two | words |\n|---|---|\n", encoding="utf-8")
    (tmp_path / "docs" / "page.md").write_text("# One\n\na + b\n", encoding="utf-8")
    (tmp_path / "docs" / "notebooks" / "first.md").write_text("Run it.\n", encoding="utf-8")
    (tmp_path / "docs" / "research" / "study.md").write_text("not for users\n", encoding="utf-8")
    assert words.word_count() == 6 + 5 + 2


@pytest.mark.parametrize("page", words.user_pages(), ids=lambda page: page.name)
def test_a_page_has_the_words_of_the_glossary_and_no_history(page):
    assert not list(words.findings(page))


@pytest.mark.parametrize(
    "line",
    ["the gap on unseen motions", "it ended in another valley", "as in 4de8b3b", "looked at 30 times", "one at work"],
)
def test_a_wrong_word_is_noticed(tmp_path, monkeypatch, line):
    monkeypatch.setattr(words, "ROOT", tmp_path)
    page = tmp_path / "page.md"
    page.write_text(f"# Page\n\n`unseen` is a key.\n{line}\n", encoding="utf-8")
    (found,) = words.findings(page)
    assert found.startswith("page.md:4: ")


def test_short_words_in_short_sentences_read_more_easily():
    """A sentence with 5 words and 5 syllables: 206.835 - 1.015 * 5 - 84.6."""
    assert words.reading_ease("The dog sat on it. ") == pytest.approx(206.835 - 1.015 * 5 - 84.6)
    assert words.reading_ease("Identifiability necessitates regularisation, considering ellipsoids. ") < 0.0


def test_the_unreleased_part_of_the_changelog_is_short():
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    _, first, *_ = re.split(r"^## ", text, flags=re.MULTILINE)
    assert len(first.splitlines()) <= MOST_LINES_OF_CHANGELOG


def test_every_figure_of_the_evidence_has_its_command_date_and_version():
    """Each section of docs/evidence.md with a table has a command to type, a month and a version."""
    text = (ROOT / "docs" / "evidence.md").read_text(encoding="utf-8")
    sections = [one for one in re.split(r"^##+ ", text, flags=re.MULTILINE)[1:] if "|---" in one]
    assert len(sections) >= 5
    for section in sections:
        assert re.search(r"^\.venv/bin/\w+ ", section, re.MULTILINE), section
        assert re.search(r"\b[A-Z][a-z]+ 20\d\d, (?:this\s+)?version", section), section


def test_tables_of_the_readme_are_narrow():
    rows = re.findall(r"^\|(.*)\|$", (ROOT / "README.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert max(row.count("|") + 1 for row in rows) <= MOST_CELLS


def test_every_term_has_a_sentence():
    """Each row of docs/glossary.md has term, meaning, symbol and unit, source."""
    text = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
    rows = [row.split("|")[1:-1] for row in text.splitlines() if re.match(r"\| (?!term )", row)]
    assert len(rows) >= 30
    assert [row[0] for row in rows if len(row) != 4 or len(row[1].split()) < 5] == []


def test_a_wrong_word_in_a_docstring_or_comment_is_noticed_and_a_name_is_not(tmp_path, monkeypatch):
    monkeypatch.setattr(words, "ROOT", tmp_path)
    module = tmp_path / "module.py"
    module.write_text(
        '"""It ended in another valley."""\n\nunseen = "gap_unseen_deg"  # the `unseen` gap\n# one at work\n'
    )
    assert [one.split(":")[1] for one in words.code_findings(module)] == ["1", "4"]


def test_a_wrong_word_in_a_message_is_noticed_and_a_key_is_not(tmp_path, monkeypatch):
    monkeypatch.setattr(words, "ROOT", tmp_path)
    module = tmp_path / "module.py"
    module.write_text(
        '"""Unexplained."""\n\nkeys = {"left over": "unseen"}\nprint(f"{1} % is left over")\n', encoding="utf-8"
    )
    assert [one.split(":")[1] for one in words.string_findings(module)] == ["3", "4"]


def test_a_wrong_word_in_a_name_is_noticed(tmp_path, monkeypatch):
    monkeypatch.setattr(words, "ROOT", tmp_path)
    module = tmp_path / "valleys.py"
    module.write_text("class StandIns:\n    left_over_share = 1\n\n\ndef f(at_work): ...\n", encoding="utf-8")
    assert [one.split(":")[1] for one in words.name_findings(module)] == ["1, valleys", "1, StandIns", "5, at_work"]


def test_a_wrong_word_in_a_template_is_noticed(tmp_path, monkeypatch):
    monkeypatch.setattr(words, "ROOT", tmp_path)
    template = tmp_path / "page.html"
    template.write_text("<p>\n<p>the gap on unseen motions\n", encoding="utf-8")
    assert list(words.text_findings(template)) == ["page.html:2: 'unseen': held out"]


def test_every_replacement_is_a_term_of_the_glossary(monkeypatch):
    assert set(words.REPLACED.values()) <= words.terms()
    monkeypatch.setitem(words.REPLACED, "ravines?", "no such term")
    assert "docs/glossary.md: no term 'no such term'" in list(words._everywhere_in_code())


def test_a_sentence_without_a_noun_is_noticed_and_a_question_is_not(tmp_path, monkeypatch):
    monkeypatch.setattr(words, "ROOT", tmp_path)
    page, module = tmp_path / "page.md", tmp_path / "module.py"
    page.write_text(
        "# What is\n\nWhat is this? A gap.\n- What is left\n  is noise. Of ten.\n\n| What |\n", encoding="utf-8"
    )
    assert [one.split("'")[1] for one in words.findings(page)] == ["What is left is noise.", "Of ten."]
    module.write_text('x = """Of each group."""\n\n# By default 1. Those of `f`.\ny = "Of each group."\n')
    assert [one.split("'")[1] for one in words.code_findings(module)] == ["Of each group.", "Those of X."]

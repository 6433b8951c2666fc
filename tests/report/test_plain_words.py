"""Plain names: every cause has one, and text from a file never becomes markup."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from adapt.report.plain_words import GLOSSARY, explained, with_hover
from models.effects import EFFECTS

PAGE = Path(__file__).parents[2] / "docs" / "glossary.md"

WITHIN = {
    "SC": "landmark",
    "AC": "landmark",
    "TS": "landmark",
    "AI": "landmark",
    "conoid": "conoid length",
    "prior thorax points": "thorax down-weighting",
    "noise alone": "noise",
}
"""Terms of the report that the glossary explains with another term, and that one."""


def test_every_effect_says_its_plain_name_and_no_two_causes_the_same():
    by_cause = {effect.cause: effect.plain_name for effect in EFFECTS.values()}
    assert all(by_cause.values())
    assert len(set(by_cause.values())) == len(by_cause)
    for name, effect in EFFECTS.items():
        assert f">{effect.plain_name}</abbr> <code>{name}</code>" in explained(name, effect.what)


def test_a_name_has_its_description_on_hover_and_focus_and_its_identifier_beside_it():
    what = EFFECTS["conoid_strain:posture"].what
    found = str(explained("conoid_strain:posture", what))
    assert found.startswith(f'<abbr tabindex="0" title="{what}">conoid stretches</abbr>')
    assert found.endswith("<code>conoid_strain:posture</code>")
    assert str(explained("<b>", "")) == "<code>&lt;b&gt;</code>"


def test_identifiers_in_a_sentence_have_their_plain_name_on_hover():
    found = str(with_hover("The gap of s_1 & <s_2> shrinks with clavicle_frame_bias (or sc_offset)."))
    assert '<abbr tabindex="0" title="clavicle frame turned">clavicle_frame_bias</abbr>' in found
    assert '<abbr tabindex="0" title="SC joint elsewhere on the thorax">sc_offset</abbr>' in found
    assert "s_1 &amp; &lt;s_2&gt;" in found


def test_an_effect_from_elsewhere_has_its_own_name_alone():
    own = replace(EFFECTS["conoid_strain"], name="my_effect")
    assert str(explained(own.name, own.what)) == "<code>my_effect</code>"


@pytest.mark.parametrize("text", ["the gap, the gap", "a held-out and a held out motion", "AC and SC, not SC and AC"])
def test_every_term_of_a_sentence_is_explained_once_where_it_stands_first(text):
    words = [word for word in ("gap", "held-out", "AC", "SC") if word in text]
    found = str(with_hover(text))
    assert found.count("<abbr") == len(words)
    for word in words:
        meaning = GLOSSARY[word.replace("-", " ")]
        assert found.partition(word + "</abbr>")[0].endswith(f'title="{meaning}">')
    assert re.sub("<[^>]*>", "", found) == text


@pytest.mark.parametrize("text", ["no overgap", "gap-free", "inactive", "the TSX", "scapula_AI"])
def test_a_part_of_a_word_is_no_term(text):
    assert "<abbr" not in with_hover(text)


@pytest.mark.parametrize("term", GLOSSARY)
def test_every_term_of_the_report_has_its_entry_in_the_glossary(term):
    rows = [line.split("|")[1:3] for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith("| ")]
    entries = {name.strip(): f"{name}{meaning}" for names, meaning in rows for name in names.split(",")}
    entry = entries[({term: term} | WITHIN)[term]]
    assert all(re.search(rf"\b{word}\b", entry) for word in term.removeprefix("prior ").removesuffix(" alone").split())

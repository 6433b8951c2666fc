"""Plain names: every cause has one, and text from a file never becomes markup."""

from dataclasses import replace

from adapt.report.plain_words import explained, with_hover
from models.effects import EFFECTS


def test_every_effect_says_its_plain_name_and_no_two_causes_the_same():
    by_cause = {effect.cause: effect.plain_name for effect in EFFECTS.values()}
    assert all(by_cause.values())
    assert len(set(by_cause.values())) == len(by_cause)
    for name, effect in EFFECTS.items():
        assert f">{effect.plain_name}</abbr> <code>{name}</code>" in explained(name)


def test_a_name_has_its_description_on_hover_and_focus_and_its_identifier_beside_it():
    found = str(explained("conoid_strain:posture"))
    what = EFFECTS["conoid_strain:posture"].what
    assert found.startswith(f'<abbr tabindex="0" title="{what}">conoid stretches</abbr>')
    assert found.endswith("<code>conoid_strain:posture</code>")
    assert str(explained("<b>")) == "<code>&lt;b&gt;</code>"


def test_identifiers_in_a_sentence_have_their_plain_name_on_hover():
    found = str(with_hover("The gap of s_1 & <s_2> shrinks with clavicle_frame_bias (or sc_offset)."))
    assert '<abbr tabindex="0" title="clavicle frame turned">clavicle_frame_bias</abbr>' in found
    assert '<abbr tabindex="0" title="SC joint elsewhere on the thorax">sc_offset</abbr>' in found
    assert "s_1 &amp; &lt;s_2&gt;" in found


def test_an_effect_from_elsewhere_has_its_own_name_alone():
    own = replace(EFFECTS["conoid_strain"], name="my_effect")
    assert str(explained(own.name)) == "<code>my_effect</code>"

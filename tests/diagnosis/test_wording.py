"""A diagnosis in words: the sentence, of at most thirty words, and the notes."""

import math
import re
from dataclasses import replace

import pytest
from diagnoses import (
    BLIND,
    BY_KIND,
    LONE,
    MANY,
    NO_POSITIONS,
    NOTHING,
    ONE,
    OUTSIDE,
    POSITIONS,
    TWO,
    UNTESTED,
    amplitude,
    cause,
    gap_of,
    verdict,
)

from adapt.diagnosis.result import EFFECT, Extent, Gaps, Interval, Noise
from adapt.diagnosis.texts.cause_sentences import cause_sentence
from adapt.diagnosis.texts.measure_next import measure_next
from adapt.diagnosis.texts.notes import notes
from adapt.diagnosis.texts.wording import (
    MOST_WORDS,
    amplitude_text,
    answer_text,
    gap_text,
    held_out_kind_text,
    held_out_text,
    interval_text,
    listed,
    number,
    percent_text,
    probability_text,
    sentence,
    step_text,
    with_unit,
)
from models.effects import EFFECTS

BEYOND = "Beyond own bones the gap of 6 shoulders on held-out {} deg with {}; noise alone leaves 0.3."
OWN = "{} on held-out {} with own bones; noise alone leaves 0.3."

SENTENCES = {
    "one": BEYOND.format("motions shrinks from 2.0 to 0.9", "scapula_landmark_bias"),
    "two": BEYOND.format(
        "motions shrinks from 2.0 to 0.9", "ac_translation (or conoid_strain) and what acts like scapulothoracic_gap"
    ),
    "many": BEYOND.format(
        "motions shrinks from 2.0 to 0.9",
        "ac_translation, scapulothoracic_gap, clavicle_length, scapula_size and clavicle_frame_bias",
    ),
    "nothing": OWN.format("People differ, nothing else shows: the gap of 1 shoulder", "motions stays at 0.5 deg"),
    "outside": OWN.format("No listed cause explains the rest: the gap of 6 shoulders", "motions stays at 2.8 deg"),
    "lone": BEYOND.format("postures shrinks from 1.8 to 0.7", "scapula_landmark_bias"),
    "untested": OWN.format(
        "One motion of one person cannot show a cause: the gap", "postures goes from 2.6 to 1.8 deg"
    ),
    "blind": OWN.format("People differ, nothing else shows: the gap of 1 shoulder", "motions is not known"),
}


@pytest.mark.parametrize("kind", BY_KIND)
def test_the_sentence_says_the_answer_in_thirty_words(kind):
    said = sentence(BY_KIND[kind])
    assert said == SENTENCES[kind]
    assert len(said.split()) <= MOST_WORDS == 30


def test_causes_that_positions_show_are_not_said_to_shrink_a_gap_that_grows():
    """Check that the sentence reports both gaps where landmarks come nearer and angles do not."""
    moving = [replace(cause(name), tested_on=("positions",)) for name in ("sc_translation", "ac_translation")]
    apart = {"base": 3.1, "adapted": 3.04, "with_causes": 2.48}
    both = replace(ONE, positions=replace(ONE.positions, other_motion=apart), verdict=verdict(EFFECT, *moving))
    said = sentence(replace(both, gaps=gap_of(1.6, 0.7, 0.6)))
    assert said == (
        "Positions show sc_translation and ac_translation: landmarks of held-out motions are 2.5 mm off (adapted 3.0); "
        "the gap of 6 shoulders goes from 0.6 to 0.7 deg, noise alone leaves 0.3."
    )
    assert len(said.split()) <= MOST_WORDS
    assert sentence(replace(both, gaps=gap_of(1.6, 0.5, 0.6))).startswith("Beyond own bones")
    assert sentence(replace(both, positions=ONE.positions, gaps=gap_of(1.6, 0.7, 0.6))).startswith("Beyond own bones")


@pytest.mark.parametrize("names", [1, 2, 3, 12])
@pytest.mark.parametrize("causes", [1, 2, 3, 4, 7, 20])
def test_the_sentence_stays_short_whatever_the_number_of_causes_and_of_their_names(causes, names):
    many = [cause(*(f"cause{k}_{n}" for n in range(names))) for k in range(causes)]
    said = sentence(replace(ONE, verdict=verdict(EFFECT, *many)))
    assert len(said.split()) <= MOST_WORDS
    assert "cause0_0" in said


def test_a_cause_is_named_without_what_it_goes_with():
    both = cause("ac_translation:posture", "ac_translation", "conoid_strain")
    assert answer_text(verdict(EFFECT, both)) == "ac_translation (or conoid_strain)"


def test_the_sentence_does_not_say_that_a_gap_shrinks_which_grows():
    assert "goes from 1.0 to 1.1 deg" in sentence(replace(ONE, gaps=gap_of(1.5, 1.1, 1.0)))


def test_the_sentence_has_a_second_digit_where_the_first_shows_no_difference():
    assert "shrinks from 1.34 to 1.31 deg" in sentence(replace(ONE, gaps=gap_of(2.0, 1.31, 1.34)))


@pytest.mark.parametrize(
    ("diagnosis", "said"),
    [
        (TWO, "ac_translation (or conoid_strain) and scapulothoracic_gap"),
        (NOTHING, "none"),
        (OUTSIDE, "unknown"),
    ],
)
def test_the_answer_in_a_table_names_everything(diagnosis, said):
    assert answer_text(diagnosis.verdict) == said


def test_of_several_gaps_that_is_named_of_which_most_was_held_out():
    motions, persons = ONE.gaps.other_motion, ONE.gaps.other_person

    def said(gaps: Gaps) -> tuple[str, str]:
        return held_out_kind_text(gaps), held_out_text(gaps)

    assert said(ONE.gaps) == ("held-out motions", "each motion in turn, with causes found in other persons")
    assert said(replace(ONE.gaps, other_person=None)) == ("held-out motions", "each motion in turn")
    assert said(LONE.gaps) == ("held-out postures", "every third posture in turn")
    one_kind = replace(ONE.gaps, other_motion=None)
    assert said(one_kind) == ("held-out persons", "every third posture in turn, with causes found in other persons")
    assert ONE.gaps.hardest is persons
    assert replace(ONE.gaps, other_person=None).hardest is motions


def test_numbers_have_the_digits_that_they_deserve():
    assert [number(value) for value in (0.123, 1.23, math.nan, None)] == ["0.12", "1.2", "-", "-"]
    assert [probability_text(value) for value in (0.0, 0.001, 0.62)] == ["0.00", "<0.01", "0.62"]
    assert [percent_text(value) for value in (0.275, math.nan)] == ["28 %", "-"]
    assert [gap_text(value) for value in (1.234, math.nan)] == ["1.23", "-"]
    assert interval_text(Interval(1.0, 0.9, math.nan)) == "1.00 [0.90, -]"
    assert (with_unit("3", "1"), with_unit("3", "mm")) == ("3", "3 mm")
    assert amplitude_text(TWO.amplitude["ac_translation"]) == "4.0 [3.9, 4.1] mm"
    assert [listed(["a", "b", "c"][:n], "or") for n in range(4)] == ["", "a", "a or b", "a, b or c"]
    assert [step_text(one.step) for one in ONE.budget] == [
        "model as it is",
        "adapted",
        "+ own bones",
        "+ scapula_landmark_bias",
        "noise alone",
    ]


# --- notes -----------------------------------------------------------------------------------------------------------


def test_the_notes_say_what_the_numbers_rest_on():
    marked = replace(
        TWO, left_out={"s11": "2 postures"}, declared_effects=("scapula_landmark_bias",), axial_is_computed=True
    )
    assert notes(marked) == [
        "Parameter set R2.",
        "Noise: 1.40 deg an angle, estimated from 166 degrees of freedom.",
        "The motion file says of its angles that scapula_landmark_bias is active.",
        "The clavicle's axial rotation is computed from the other angles: an estimate, no measurement.",
        "scapulothoracic_gap: larger than such an effect is: something that acts like it.",
        "Left out: s11: 2 postures.",
        "These data cannot tell apart conoid_strain and clavicle_axial_estimate.",
        "To adapt with ac_translation and scapulothoracic_gap: girdle adapt ... --own-bones "
        "--effects-of FOLDER, the folder of this diagnosis.",
    ]


@pytest.mark.parametrize("other", [NOTHING, OUTSIDE])
def test_no_adaptation_is_proposed_where_no_cause_is_named(other):
    assert not [note for note in notes(other) if "girdle adapt" in note]


def test_the_notes_say_what_one_motion_and_one_person_cannot_tell():
    motion, person = "nothing can be said of held-out motions", "nothing can be said of held-out persons"
    for diagnosis, said in ((ONE, []), (NOTHING, [person]), (LONE, [motion]), (UNTESTED, [motion, person])):
        found = " ".join(notes(diagnosis))
        assert [one for one in (motion, person) if one in found] == said


def test_the_notes_do_not_list_every_candidate():
    every = list(ONE.verdict.inclusion)
    assert f"These data cannot tell apart any of the {len(every)} candidates." in notes(
        replace(ONE, indistinguishable=[every])
    )


@pytest.mark.parametrize(
    ("source", "said"),
    [("given", "1.40 deg an angle, as given"), ("assumed", "too few to estimate it; give --noise-deg")],
)
def test_the_notes_say_where_the_noise_comes_from(source, said):
    assert said in notes(replace(BLIND, noise=Noise(1.4, source, math.inf)))[1]


def test_all_causes_go_together_into_one_adaptation():
    assert all(name in notes(MANY)[-1] for name in MANY.verdict.names)
    assert notes(MANY)[-1].endswith("--effects-of FOLDER, the folder of this diagnosis.")


def test_nothing_is_asked_for_that_is_told_apart_as_it_is():
    """A log evidence of 4 is a probability of 0.98."""
    told = replace(ONE, next_measurement=[replace(one, separation_now=4.0) for one in ONE.next_measurement])
    assert any("ac_translation and conoid_strain are 0.40 deg apart" in one.gain for one in measure_next(ONE))
    assert not any("apart" in one.gain for one in measure_next(told))


@pytest.mark.parametrize("positions", [NO_POSITIONS, POSITIONS], ids=["angles", "positions"])
@pytest.mark.parametrize("rivals", [True, False], ids=["rivals", "alone"])
@pytest.mark.parametrize("kind", BY_KIND)
def test_two_measurements_are_always_proposed_with_a_number_and_a_gain(kind, rivals, positions):
    asked = replace(BY_KIND[kind], positions=positions)
    asked = asked if rivals else replace(asked, next_measurement=[])
    first, second = measure_next(asked)
    assert first.what != second.what
    for one in (first, second):
        assert any(letter.isdigit() for letter in one.how_many)
        if math.isnan(one.gain_deg):
            assert "not computed" in one.gain
            continue
        assert f"{one.gain_deg:.2f}" in one.gain or one.gain_deg == pytest.approx(_fall(one.gain), abs=0.01), one.gain
        assert all(len(part.split()) <= MOST_WORDS for part in one.sentences.split(". "))


def _fall(gain: str) -> float:
    """Return by how much the first number of a gain is above or below the next one."""
    first, other = (float(number) for number in re.findall(r"\d+\.\d\d", gain)[:2])
    return abs(first - other)


def test_more_persons_narrow_an_interval_by_the_root_of_their_number():
    """Half widths of 0.1 become 0.07 with 10 persons in place of 5."""
    one = measure_next(replace(ONE, next_measurement=[]))[0]
    assert (one.what, one.how_many) == ("more persons", "10 in place of 5")
    assert one.gain == (
        "the gap on held-out motions is known to within 0.07 deg in place of 0.10, "
        "the size of scapula_landmark_bias to 0.07 deg in place of 0.10"
    )
    assert one.gain_deg == pytest.approx(0.1 * (1.0 - math.sqrt(0.5)))


@pytest.mark.parametrize(
    ("what", "said"),
    [
        ("abduction of twice as many persons", "more of abduction: 10 in place of 5 persons, measured as before."),
        ("twice as many persons", "more persons: 10 in place of 5, by the same motions."),
        ("positions of SC, to 2 mm", "positions of SC: in the 84 postures of the 5 persons, to 2 mm, with girdle"),
    ],
)
def test_a_proposal_between_two_names_says_how_many_and_how(what, said):
    one = replace(ONE.next_measurement[0], what=what)
    assert measure_next(replace(ONE, next_measurement=[one]))[0].sentences.startswith(said)


def test_without_a_cause_the_gain_is_at_most_the_gap_that_nothing_explains():
    first, second = measure_next(replace(OUTSIDE, next_measurement=[]))
    assert first.sentences == (
        "positions of SC and AC: in the 84 postures of the 5 persons, with girdle convert. Gain: joints that move show "
        "there; at most 2.50 deg, the held-out gap that own bones and noise leave."
    )
    assert second.sentences == (
        "again abduction at 0 to 30 deg: 10 postures more of the 5 persons, measured anew, to tell errors of "
        "measurement from a cause. Gain: the noise of an angle falls from 1.40 to 0.99 deg where scapula protraction "
        "has 70 % of the gap beyond noise."
    )
    assert math.isnan(measure_next(BLIND)[0].gain_deg)
    assert "not computed" in measure_next(BLIND)[0].gain


def test_a_cause_says_size_extent_and_direction_and_no_number_twice():
    first, second = (cause_sentence(TWO, one).split(". ")[0] for one in TWO.verdict.causes)
    assert first == (
        "AC joint moves (ac_translation): 4.0 [3.9, 4.1] mm over the postures, up to 6.0 mm, mostly away from SC as "
        "the scapula protracts; typical 3.0 mm"
    )
    assert "up to 18.0 mm, mostly outward at TS as the arm rises; typical 5.0 mm" in second
    assert cause_sentence(ONE, ONE.verdict.causes[0]).startswith(
        "Scapula frame turned (scapula_landmark_bias): 7.0 [6.9, 7.1] deg in every posture, mostly about x; typical"
    )


@pytest.mark.parametrize("name", EFFECTS)
def test_the_sentence_on_any_cause_has_thirty_words(name):
    """Check every effect with its two last directions, both the other way, and no quantity that it follows."""
    effect = EFFECTS[name]
    one = amplitude(effect.cause, 4.0, 3.0, effect.basis.word, name.removeprefix(effect.cause))
    names = list(dict.fromkeys(direction.partition(" by ")[0] for direction in effect.directions))
    names = names[-2:] if names[2:] else names[:1]  # of two, one has half
    for follows in ("", "elevation", "scapula_z") if effect.basis.word else ("",):
        extent = Extent(6.0, dict.fromkeys(names, -0.4), follows)
        said = cause_sentence(
            replace(ONE, amplitude={effect.cause: replace(one, extent=extent)}), cause(effect.cause)
        ).split(". ")[0]
        assert len(said.split()) <= MOST_WORDS, said
        assert said.count("4.0") == 1


def test_a_gap_that_does_not_change_stays():
    steps = [replace(step, gap_deg=Interval(0.7, 0.6, 0.8)) for step in ONE.budget]
    said = cause_sentence(replace(ONE, budget=tuple(steps)), ONE.verdict.causes[0])
    assert "With it the gap on held-out motions stays at 0.70 deg." in said
    assert "stays at 0.7 deg with scapula" in sentence(replace(ONE, gaps=gap_of(1.5, 0.7, 0.7)))

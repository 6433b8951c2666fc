"""Effects that are known to be active: fits and adaptations with them, on simulated subjects that have them."""

import pickle
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from command import girdle, refused

from adapt import Adaptations, adapt_subjects, fit_postures
from adapt.diagnosis import diagnose
from adapt.evaluation.model_subjects import simulate_model_subjects
from models import load_model
from models.effects import EFFECTS, ActiveEffects
from models.effects.amplitudes import (
    PersonalSize,
    active_effects,
    as_option,
    described,
    read_amplitudes,
    rounded,
    warn_of_sizes,
)
from motions import InputError, Motions, read_motions, write_motions
from motions.errors import InputWarning
from motions.rhythm_subjects import simulate_subjects
from motions.rotations import DEG

MODEL = load_model("R2")
EFFECT = EFFECTS["thorax_extension"]
"""Effect that turns the measured frames; effects that change the girdle take the same path through the code."""

NOTHING = {EFFECT.name: (0.0, 0.0, 0.0)}

SAME_DEG = 1e-6
"""Tolerance in degrees: fits by hand-written and by automatic derivatives end within 1e-9 rad of each other."""

SAME_MM = 1e-6
"""Tolerance for adaptations: they end within 1e-9 mm of each other, in the ellipsoid's flat direction too."""

OPTION_DIGITS = 5e-4
"""Relative rounding of options, which have four digits."""

CLOSED_MM = 1e-6
"""Constraint tolerance of a fitted chain."""


def simulated(noise_deg: float, spread: float) -> tuple[Motions, dict[str, tuple[float, ...]]]:
    """Simulate one subject with the effect; return the amplitudes too: the first term of each of three directions."""
    made = simulate_model_subjects(MODEL, EFFECT, 1, noise_deg, seed=5, spread=spread)
    return made.motions, {EFFECT.name: tuple(float(made.truth[f"amplitude_{k + 1}"].iloc[0]) for k in (0, 3, 6))}


@pytest.fixture(scope="module")
def plain() -> tuple[Motions, dict[str, tuple[float, ...]]]:
    """Subject without noise whose girdle is that of the set."""
    return simulated(0.0, 0.0)


@pytest.fixture(scope="module")
def noisy() -> tuple[Motions, dict[str, tuple[float, ...]], Adaptations]:
    """Subject with noise and an individual girdle, and the adaptation with the effect."""
    motions, effects = simulated(1.5, 0.5)
    return motions, effects, adapt_subjects(motions, MODEL, held_out=(), effects=effects)


def test_what_the_girdle_has_with_its_effect_it_can_take(plain):
    motions, effects = plain
    without, found = fit_postures(motions, MODEL), fit_postures(motions, MODEL, effects=effects)
    assert (found.by_model["R2"].status == "ok").all()
    assert without.by_model["R2"].j_deg2.max() > 1.0
    np.testing.assert_allclose(found.by_model["R2"].angles.T * DEG, motions.angles_deg, atol=SAME_DEG)


def test_an_adaptation_with_the_effect_finds_the_girdle_that_there_is(plain):
    motions, effects = plain
    found = adapt_subjects(motions, MODEL, effects=effects)
    np.testing.assert_allclose(found.adapted["R2"].theta_mm[:, 0], MODEL.girdle.adapted_mm, atol=SAME_MM)
    gaps = found.heldout.filter(regex="gap_.*_deg").to_numpy()
    assert len(gaps) == 2
    np.testing.assert_allclose(gaps, 0.0, atol=SAME_DEG)


def test_of_size_zero_it_changes_nothing(noisy):
    motions, _, _ = noisy
    models = [MODEL, load_model("R4")]
    found, expected = (adapt_subjects(motions, models, held_out=(), effects=one) for one in (NOTHING, {}))
    for model in models:
        ours, theirs = found.adapted[model.name], expected.adapted[model.name]
        np.testing.assert_allclose(ours.theta_mm, theirs.theta_mm, atol=SAME_MM)
    np.testing.assert_allclose(found.uncertainty.sd_mm, expected.uncertainty.sd_mm, rtol=SAME_MM)
    ours, theirs = (one.fits.select_dtypes("number").to_numpy() for one in (found, expected))
    np.testing.assert_allclose(ours, theirs, atol=SAME_DEG)


def test_it_is_iterated_in_float64_whatever_is_asked_for(noisy):
    motions, effects, found = noisy
    again = adapt_subjects(motions, MODEL, held_out=(), dtype=np.float32, effects=effects)
    np.testing.assert_array_equal(again.adapted["R2"].theta_mm, found.adapted["R2"].theta_mm)


def over(*elevation_deg: float) -> Motions:
    """Return postures with these elevations of the arm."""
    some = simulate_subjects(1, seed=4).select(np.arange(14) < len(elevation_deg))
    return replace(some, humerus_elevation_deg=np.array(elevation_deg))


def test_what_goes_with_elevation_grows_along_its_first_term_and_acts_in_its_place():
    motions = over(0.0, 75.0, 150.0, 30.0)
    found = active_effects({"thorax_asymmetry": (5.0,), "thorax_extension": (8.0, 0.0, -3.0)}, motions)
    assert [effect.name for effect in found.effects] == ["thorax_extension", "thorax_asymmetry"]
    grows, constant = map(np.asarray, found.strengths)
    np.testing.assert_allclose(grows, np.outer([8.0, 0.0, -3.0], motions.humerus_elevation_deg / 150.0))
    np.testing.assert_array_equal(constant, np.full((1, 4), 5.0))


def test_all_terms_of_each_direction_may_be_given():
    motions, effect = over(0.0, 75.0, 150.0, 30.0), EFFECTS["scapulothoracic_gap"]
    terms = (4.0, 1.0, -0.5, -2.0, 0.3, 0.1)
    (found,) = active_effects({effect.name: terms}, motions).strengths
    np.testing.assert_allclose(found, effect.strengths(np.array(terms), motions))
    (short,) = active_effects({effect.name: (4.0, -2.0)}, motions).strengths
    (long,) = active_effects({effect.name: (4.0, 0.0, 0.0, -2.0, 0.0, 0.0)}, motions).strengths
    np.testing.assert_array_equal(short, long)


@pytest.mark.parametrize(
    ("effects", "cause", "remedy"),
    [
        ({"extension": (8.0,)}, "there is no effect 'extension'", "Did you mean thorax_extension?"),
        ({"thorax_extension": (8.0,)}, r"thorax_extension has \[8.0\]", "Give 3, in deg: about x, about y, about z"),
        ({"thorax_extension": (8.0,) * 6}, "thorax_extension has", "Give 3, in deg: about x, about y, about z"),
        ({"thorax_asymmetry": (np.nan,)}, "thorax_asymmetry has", "Give 1, in mm"),
        ({"thorax_asymmetry": 5.0}, "thorax_asymmetry has 5.0", "Give 1, in mm"),
    ],
)
def test_numbers_that_do_not_fit_an_effect_are_named(effects, cause, remedy):
    with pytest.raises(InputError, match=cause) as error:
        active_effects(effects, over(0.0, 90.0))
    assert remedy in str(error.value)


def test_a_number_alone_and_a_name_alone_are_named_from_python():
    motions = over(0.0, 90.0)
    with pytest.raises(InputError, match="thorax_asymmetry has 30"):
        adapt_subjects(motions, load_model("R2"), effects={"thorax_asymmetry": 30.0})  # type: ignore[dict-item]
    with pytest.raises(InputError, match=r"'R6' is no parameter set\. Load it: models\.load_model"):
        adapt_subjects(motions, ["R6"])  # type: ignore[list-item]
    with pytest.raises(InputError, match=r"'R6' is no parameter set"):
        fit_postures(motions, "R6")  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"this is a str, not Motions\. Read a motion file"):
        fit_postures("P01.csv", load_model("R2"))  # type: ignore[arg-type]
    with pytest.raises(InputError, match="this is a str, not Motions"):
        diagnose("P01.csv", load_model("R2"))  # type: ignore[arg-type]


def test_no_posture_no_model_and_a_model_twice_are_named_from_python():
    motions, R2 = over(0.0, 90.0), load_model("R2")
    with pytest.raises(InputError, match="there is no posture in them"):
        fit_postures(motions.select(motions.subject == "nobody"), R2)
    with pytest.raises(InputError, match="models: there is none"):
        fit_postures(motions, [])
    with pytest.raises(InputError, match="two are called 'R2'"):
        adapt_subjects(motions, [R2, R2])


def test_the_command_line_does_what_python_does_and_says_with_what(noisy, tmp_path):
    motions, effects, _ = noisy
    file, out, again = tmp_path / "motions.csv", tmp_path / "out", tmp_path / "again"
    write_motions(motions, file)
    expected = adapt_subjects(read_motions(file), MODEL, effects=effects).fits
    given = f"{EFFECT.name}={','.join(map(repr, effects[EFFECT.name]))}"
    ended = girdle("adapt", file, "--effect", given, "--out", out)
    assert ended.status == 0, ended.err
    found = pd.read_csv(out / "fits.csv")
    numbers = expected.select_dtypes("number").columns
    np.testing.assert_allclose(found[numbers].to_numpy(float), expected[numbers].to_numpy(float), rtol=1e-12)

    said = described(effects)
    assert f"With {said} active in every subject." in " ".join(ended.out.split())
    assert f"<b>With {said}</b> active" in (out / "report.html").read_text()
    assert all(f"with {said})" in path.read_text() for path in (out / "models").iterdir())

    assert girdle("adapt", "--repeat", out / "run.json", "--out", again).status == 0
    assert (again / "fits.csv").read_bytes() == (out / "fits.csv").read_bytes()
    before = found[found["adapted"] == 0]
    assert girdle("fit", file, "--effect", given, "--out", again).status == 0
    np.testing.assert_array_equal(pd.read_csv(again / "fits.csv")["j_deg2"], before["j_deg2"])


def test_a_size_of_each_person_is_in_the_table_of_parameters(noisy, tmp_path):
    motions, effects, _ = noisy
    file, out = tmp_path / "motions.csv", tmp_path / "out"
    write_motions(motions, file)
    mean = effects[EFFECT.name]
    ended = girdle("adapt", file, "--effect", f"{EFFECT.name}={','.join(map(repr, mean))}~2,0,3", "--out", out)
    assert ended.status == 0, ended.err
    assert f"With {EFFECT.name}" in ended.out
    assert "on average" in ended.out
    personal = {EFFECT.name: PersonalSize(mean, (2.0, 0.0, 3.0))}
    expected = adapt_subjects(read_motions(file), MODEL, effects=personal)
    sizes = expected.adapted["R2"].sizes
    columns = [f"{EFFECT.name} about x term 1", f"{EFFECT.name} about z term 1"]
    found = pd.read_csv(out / "parameters.csv")
    assert list(found.columns)[-2:] == columns
    np.testing.assert_allclose(found[columns].to_numpy().T, np.array([[mean[0]], [mean[2]]]) + [[2.0], [3.0]] * sizes)
    assert np.abs(sizes).min() > 1e-3


def test_points_on_the_thorax_that_count_less_are_a_larger_weight(noisy):
    motions, _, _ = noisy
    less = adapt_subjects(motions, MODEL, held_out=(), thorax_downweighting=30.0).adapted["R2"]
    more = adapt_subjects(motions, MODEL, weight=300.0, held_out=()).adapted["R2"]
    np.testing.assert_array_equal(less.theta_mm, more.theta_mm)
    np.testing.assert_array_equal(less.E, more.E)


@pytest.mark.parametrize("k", [0.0, 0.01, -1.0, 2e4, np.inf, np.nan])
def test_a_down_weighting_that_cannot_be_is_named(noisy, k):
    motions, _, _ = noisy
    with pytest.raises(InputError, match=f"thorax_downweighting: .* is {k}. Give a number from 1 to 10000"):
        adapt_subjects(motions, MODEL, thorax_downweighting=k)


def test_the_command_line_down_weights_thorax_points_by_its_option_or_as_an_effect(noisy, tmp_path):
    """Check the option against ``--effect thorax_points=30``, as in diagnosis.json; a posture fit ignores both."""
    motions, _, _ = noisy
    file, outs = tmp_path / "motions.csv", [tmp_path / name for name in ("option", "effect", "again")]
    write_motions(motions, file)
    expected = adapt_subjects(read_motions(file), MODEL, thorax_downweighting=30.0).parameters
    named = ("--effect", "thorax_points=30")
    ended = [
        girdle("adapt", file, "--thorax-downweighting", "30", "--out", outs[0]),
        girdle("adapt", file, *named, "--out", outs[1]),
        girdle("adapt", "--repeat", outs[1] / "run.json", "--out", outs[2]),
    ]
    assert [one.status for one in ended] == [0, 0, 0], [one.err for one in ended]
    tables = [(out / "parameters.csv").read_bytes() for out in outs]
    assert tables[0] == tables[1] == tables[2]
    found = pd.read_csv(outs[0] / "parameters.csv")["A_z_mm"]
    np.testing.assert_allclose(found, expected["A_z_mm"], rtol=1e-12)
    assert "Prior thorax points down-weighted 30 times." in ended[0].out
    assert "active in every subject" not in ended[0].out
    assert "Prior thorax points down-weighted:</b> they count 1/30 in" in (outs[0] / "report.html").read_text()
    assert all(
        "prior thorax points down-weighted 30 times" in path.read_text() for path in (outs[0] / "models").iterdir()
    )
    plain, same = tmp_path / "plain", tmp_path / "same"
    assert girdle("fit", file, "--out", plain).status == girdle("fit", file, *named, "--out", same).status == 0
    assert (plain / "fits.csv").read_bytes() == (same / "fits.csv").read_bytes()


@pytest.mark.parametrize("option", ["--thorax-downweighting=0", "--effect=thorax_points=0"])
def test_a_down_weighting_that_cannot_be_is_refused(option, tmp_path):
    ended = girdle("adapt", "no.csv", option, "--out", tmp_path / "out")
    refused(ended, "--thorax-downweighting", "is 0", "Give a number from 1 to 10000")
    assert not (tmp_path / "out").exists()


def test_a_down_weighting_that_is_there_twice_is_refused(tmp_path):
    options = ("--effect", "thorax_points=30", "--thorax-downweighting", "10")
    ended = girdle("adapt", "no.csv", *options, "--out", tmp_path / "out")
    refused(ended, "--thorax-downweighting", "it is there twice", "Give it once")


def test_amplitudes_are_read_from_words_and_can_be_sent_to_a_worker():
    words = ["thorax_extension=8,0,-3", "thorax_asymmetry = 5"]
    found = read_amplitudes(words)
    assert found == {"thorax_extension": (8.0, 0.0, -3.0), "thorax_asymmetry": (5.0,)}
    assert pickle.loads(pickle.dumps(found)) == found
    assert described(found) == "thorax_extension of (8, 0, -3) deg, thorax_asymmetry of 5 mm"
    assert read_amplitudes([]) == {}


@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("conoid_strain=100", "length of conoid_strain is 100 mm, 125 times its typical size"),
        ("thorax_shape=-3", "exponent of thorax_shape is -3, 10 times its typical size"),
        ("sc_offset=0,150,0~1,1,1", "y of sc_offset is 150 mm, 15 times its typical size"),
        ("scapula_size=0.08", "scapula_size of 0.08 % is at most 1.0% of its typical size. Check its unit"),
        ("thorax_tilt=0.1,0,0~0.01,0,0", "thorax_tilt of (0.1, 0, 0) deg is at most 1.7% of its typical size"),
        ("skin_artefact=100", "share of skin_artefact is 100 of the measured lag, 100 times its typical size"),
    ],
)
def test_an_amplitude_far_beyond_its_typical_size_is_named(word, said):
    with pytest.warns(InputWarning, match=re.escape(said)):
        warn_of_sizes(read_amplitudes([word]))
    assert described({}) == ""


def test_python_doubts_an_amplitude_as_the_command_line_does(noisy, tmp_path):
    motions, _, _ = noisy
    far = {"conoid_strain": (100.0,)}
    with pytest.warns(InputWarning, match="effects: length of conoid_strain is 100 mm, 125 times its typical size"):
        adapt_subjects(motions, MODEL, held_out=(), effects=far)
    with pytest.warns(InputWarning, match="125 times its typical size"):
        fit_postures(motions, MODEL, effects=far)
    write_motions(motions, tmp_path / "m.csv")
    for command in ("adapt", "fit"):
        said = girdle(
            command, tmp_path / "m.csv", "--effect", "conoid_strain=100", "--out", tmp_path / command
        ).messages
        assert sum("125 times its typical size" in line for line in said) == 1


def test_an_amplitude_that_may_be_small_or_has_a_spread_is_not_doubted():
    for word in ("scapula_size=0.5", "scapula_size=0~8", "conoid_strain=0.3", "thorax_tilt=0,0,1", "skin_artefact=1"):
        warn_of_sizes(read_amplitudes([word]))  # a warning would be an error


@pytest.mark.parametrize(
    ("words", "cause", "remedy"),
    [
        (["extension=8"], "there is no effect 'extension'", "Did you mean thorax_extension?"),
        (["thorax_extension=8"], "thorax_extension has [8.0]", "Give 3, in deg: about x, about y, about z"),
        (["thorax_extension=8,x,0"], "'8,x,0' is not a list of numbers", "thorax_extension=0,0,0"),
        (["thorax_asymmetry"], "'' is not a list of numbers", "thorax_asymmetry=0"),
        (["thorax_asymmetry=nan"], "thorax_asymmetry has", "Give 1, in mm"),
        (["thorax_asymmetry=1", "thorax_asymmetry=2"], "thorax_asymmetry is there twice", "once"),
        (["thorax_points=1,2"], "thorax_points has '1,2'", "--thorax-downweighting 30"),
        (["thorax_points=30~1"], "thorax_points has '30~1'", "--thorax-downweighting 30"),
        (["thorax_points=x"], "thorax_points has 'x'", "--thorax-downweighting 30"),
        (["thorax_points"], "thorax_points has ''", "--thorax-downweighting 30"),
        (["thorax_asymmetry=5~1,2"], "thorax_asymmetry has 1 sizes and the SDs [1.0, 2.0]", "one SD"),
        (["thorax_asymmetry=5~-1"], "thorax_asymmetry has 1 sizes and the SDs [-1.0]", "0 or more"),
        (["thorax_asymmetry=5~inf"], "thorax_asymmetry has 1 sizes and the SDs [inf]", "0 or more"),
        (["thorax_asymmetry=5~"], "'5~' is not a list of numbers", "thorax_asymmetry=0"),
        (["thorax_asymmetry=5~1~2"], "'5~1~2' is not a list of numbers", "thorax_asymmetry=0"),
    ],
)
@pytest.mark.parametrize("command", ["fit", "adapt"])
def test_a_command_line_that_does_not_fit_an_effect_is_refused(command, words, cause, remedy, tmp_path):
    options = [part for word in words for part in ("--effect", word)]
    refused(girdle(command, "no.csv", *options, "--out", tmp_path / "out"), "--effect", cause, remedy)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("effect", EFFECTS.values(), ids=EFFECTS)
def test_an_option_is_read_as_it_was_written(effect):
    """Check that options keep all terms exactly as rounded, to four digits, and that the effect acts with them."""
    motions = over(0.0, 60.0, 120.0)
    _, prior_sd = effect.amplitude_prior(motions)
    amplitude = prior_sd * np.linspace(-1.0, 1.234567, effect.amplitudes)
    sd = np.abs(amplitude) + prior_sd
    found, personal = rounded(amplitude.tolist()), PersonalSize(rounded(amplitude.tolist()), rounded(sd.tolist()))
    for one in (found, personal):
        assert read_amplitudes([as_option(effect.name, one)]) == {effect.name: one}
    np.testing.assert_allclose(personal.mean, amplitude, rtol=OPTION_DIGITS)
    np.testing.assert_allclose(personal.sd, sd, rtol=OPTION_DIGITS)
    (strength,) = active_effects({effect.name: found}, motions).strengths
    largest = np.abs(effect.columns(motions)).max() * np.abs(amplitude).max()
    np.testing.assert_allclose(
        strength, effect.strengths(amplitude, motions), atol=len(amplitude) * OPTION_DIGITS * largest
    )


SIMULATED = ("thorax_extension", "skin_artefact", "conoid_strain:posture")
"""One effect of each kind of basis, because each takes a compilation."""


@pytest.mark.parametrize("name", ["none", *SIMULATED])
def test_subjects_are_simulated_with_an_effect_at_its_typical_size(name):
    """Check that each subject's true parameters and amplitudes close the chain at its motions, without noise."""
    effect = EFFECTS.get(name)
    made = simulate_model_subjects(MODEL, effect, 2, 0.0, seed=5)
    motions, truth = made.motions, made.truth
    assert truth["effect"].tolist() == [effect.name if effect else "none"] * 2
    assert len(motions.posture) >= 24
    amplitudes = truth.filter(regex="^amplitude_").to_numpy()
    if effect is None:
        assert amplitudes.shape == (2, 0)
        return
    assert amplitudes.shape == (2, effect.amplitudes)
    terms = len(effect.basis.sd)
    mean, sd = effect.amplitude_prior(motions)
    typical = np.where(mean > 0.0, mean, sd)
    assert (np.abs(amplitudes[:, ::terms]) < 2.0 * typical[::terms]).all()
    assert (np.abs(amplitudes[:, ::terms]) > 0.2 * typical[::terms]).all()
    assert not np.delete(amplitudes, np.s_[::terms], axis=1).any()
    for sign, column in zip(effect.prior.sign, amplitudes[:, ::terms].T, strict=False):
        assert sign == 0 or (np.sign(column) == sign).all()
    for k, subject in enumerate(motions.subjects):
        one = motions.select(motions.subject == subject)
        girdle = MODEL.girdle.with_adapted(truth.filter(regex="_mm$").to_numpy()[k])
        acting = ActiveEffects((effect.strengths(amplitudes[k], one),), (effect,))
        if effect.name == "skin_artefact":
            continue  # its direction depends on the motions, and is slightly different for those before the simulation
        residuals = acting.on(girdle.over_axes(1)).residuals_mm(one.angles_deg.T / DEG)
        np.testing.assert_allclose(residuals, 0.0, atol=CLOSED_MM)

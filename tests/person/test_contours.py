"""Contours in synthetic slices: discs of known size, with noise, loops, jumps; the path against brute force."""

from itertools import product

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from models.person.contours.band import Inside, Settings
from models.person.contours.closed_contour import (
    corrected_line,
    drawn_contour,
    found_contour,
    smoothed,
    vectorised,
)
from models.person.contours.edge_path import area_px2, closed_path, detect, evenly, slopes_of
from models.person.contours.slice_stack import SliceClicks, doubtful, follow

SIZE = 100

CONTRAST = 100.0
"""Grey levels between a disc and its surroundings."""

NOISE = 8.0
"""SD of a pixel, in grey levels."""

WITHIN_PX = 0.1
"""Tolerance for the root mean square distance of a contour from the disc's edge, and for the bias of its radius."""

FAILED_PX = 3.0
"""Largest distance from the edge above which a contour counts as failed."""

CENTRE, RADIUS = np.array([47.3, 52.6]), 24.4


def painted(away_px: np.ndarray, noise: float, seed: int = 0) -> np.ndarray:
    """Paint an image: bright where ``away_px`` is negative, blurred as by a scanner, with noise."""
    sharp = CONTRAST * np.clip(0.5 - away_px, 0.0, 1.0)
    return gaussian_filter(sharp, 0.7) + noise * np.random.default_rng(seed).standard_normal(sharp.shape)


def pixels() -> np.ndarray:
    return np.stack(np.meshgrid(np.arange(SIZE), np.arange(SIZE)))


def from_disc(at: np.ndarray, centre=CENTRE, radius: float = RADIUS) -> np.ndarray:
    """Compute the signed distance to a circle, positive outside."""
    return np.linalg.norm(at - np.reshape(centre, (2, *[1] * (at.ndim - 1))), axis=0) - radius


def disc(noise: float = NOISE, seed: int = 0) -> np.ndarray:
    return painted(from_disc(pixels()), noise, seed)


def clicked(*angles_deg: float, off_px: float = 0.0, centre=CENTRE, radius: float = RADIUS) -> np.ndarray:
    """Return clicks around a circle, alternately ``off_px`` outside and inside its edge."""
    radii = radius + off_px * (-1.0) ** np.arange(len(angles_deg))
    a = np.radians(angles_deg)
    return np.reshape(centre, (2, 1)) + radii * np.stack([np.cos(a), np.sin(a)])


@pytest.mark.parametrize("seed", range(5))
def test_the_contour_of_a_noisy_disc_lies_within_a_tenth_of_a_pixel(seed):
    """Check a contour from four clicks, two pixels off the edge."""
    found = drawn_contour(slopes_of(disc(seed=seed)), clicked(10, 100, 190, 280, off_px=2.0), Settings("bright"))
    away = from_disc(found.points_px)
    assert np.sqrt(np.mean(away**2)) < WITHIN_PX
    assert abs(away.mean()) < WITHIN_PX
    assert found.weakest > 0.1 * CONTRAST


def test_without_noise_the_polygon_of_the_contour_keeps_half_a_pixel():
    found = drawn_contour(slopes_of(disc(0.0)), clicked(0, 120, 240), Settings("either"))
    polygon = vectorised(found.points_px)
    assert polygon.shape[1] < found.points_px.shape[1] / 4
    corners = np.abs(from_disc(polygon)).max()
    middles = np.abs(from_disc((polygon + np.roll(polygon, 1, axis=1)) / 2.0)).max()
    assert corners < WITHIN_PX
    assert middles < 0.5 + WITHIN_PX


@pytest.mark.parametrize("clockwise", [False, True])
def test_the_gradient_knows_which_side_is_inside(clockwise):
    """Check a bright ring, where a band finds the edge of its direction: the outer edge, or the hole's."""
    hole = np.abs(from_disc(pixels(), radius=22.0)) - 3.0
    slopes = slopes_of(painted(hole, NOISE))
    clicks = clicked(*(range(0, 360, 40) if clockwise else range(320, -1, -40)), radius=22.0)
    directions: tuple[tuple[Inside, float], ...] = (("bright", 25.0), ("dark", 19.0))
    for inside, radius in directions:
        found = drawn_contour(slopes, clicks, Settings(inside))
        assert np.sqrt(np.mean(from_disc(found.points_px, radius=radius) ** 2)) < WITHIN_PX


@pytest.mark.parametrize("seed", range(20))
def test_the_path_is_that_of_brute_force(seed):
    generator = np.random.default_rng(seed)
    rows, columns = generator.integers(3, 7), generator.integers(2, 5)
    cost = generator.uniform(size=(rows, columns))
    every = np.array(list(product(range(columns), repeat=int(rows))))
    connected = np.abs(every - np.roll(every, 1, axis=1)).max(axis=1) <= 1
    best = every[connected][np.argmin(cost[np.arange(rows), every[connected]].sum(axis=1))]
    np.testing.assert_array_equal(closed_path(cost), best)


def test_an_edge_between_pixels_is_found_between_them():
    """Check a straight edge at x = 30.25 of a smooth step, beside the right side of a rectangle."""
    x = pixels()[0]
    image = CONTRAST / (1.0 + np.exp((x - 30.25) / 0.8))
    line = evenly(np.array([[28.5, 28.5, 10.0, 10.0, 28.5], [20.0, 80.0, 80.0, 20.0, 20.0]]))
    line = line if area_px2(line) > 0.0 else line[:, ::-1]
    found = detect(slopes_of(image), line, 5.0, "bright")
    straight = (line[0] == 28.5) & (line[1] > 30.0) & (line[1] < 70.0)
    assert straight.sum() > 20
    np.testing.assert_allclose(found[0, straight], 30.25, rtol=0.0, atol=0.02)


def test_loops_are_cut_off_and_an_ellipse_stays_what_it_is():
    a = np.linspace(0.0, 2.0 * np.pi, 181)[:-1]
    ellipse = np.array([50.0 + 30.0 * np.cos(a), 50.0 + 20.0 * np.sin(a)])
    smooth = smoothed(ellipse)
    off = ((smooth[0] - 50.0) / 30.0) ** 2 + ((smooth[1] - 50.0) / 20.0) ** 2 - 1.0
    assert np.abs(off).max() < 5e-3
    crossed = ellipse.copy()
    crossed[:, 40:44] = crossed[:, 43:39:-1]  # the line goes back on itself
    crossed[:, 100] = (20.0, 50.0)
    repaired = smoothed(crossed)
    assert area_px2(repaired) == pytest.approx(area_px2(smooth), rel=0.01)
    with pytest.raises(ValueError, match="no area"):
        smoothed(np.array([[0.0, 1.0, 2.0, 1.0], [0.0, 0.0, 0.0, 0.0]]))


def bumped(at: np.ndarray) -> np.ndarray:
    """Compute the distance to the disc with a second bone on its right, which reaches 13 px farther."""
    return np.minimum(from_disc(at), from_disc(at, CENTRE + np.array([24.0, 0.0]), 14.0))


def stack() -> list[np.ndarray]:
    """Paint slices 1-3 with the disc and slices 4-6 with the second bone too, each with its own noise."""
    shapes = [from_disc] * 3 + [bumped] * 3
    return [painted(shape(pixels()), NOISE, seed) for seed, shape in enumerate(shapes)]


def followed(clicks: dict[int, SliceClicks], images=None) -> dict:
    slopes = [slopes_of(image) for image in images or stack()]
    return follow(slopes.__getitem__, len(slopes), clicks, Settings("bright"))


def test_propagation_fails_at_a_jump_and_recovers_after_one_correction():
    clicks = {1: SliceClicks(clicked(10, 100, 190, 280))}
    alone = followed(clicks)
    assert list(alone) == [0, 1, 2, 3, 4, 5]
    for k in (0, 1, 2):
        assert np.abs(from_disc(alone[k].points_px)).max() < 4.0 * WITHIN_PX
    for k in (3, 4):
        assert np.abs(bumped(alone[k].points_px)).max() > FAILED_PX
    assert doubtful(alone, clicks) == [3, 4]
    on_disc = clicked(-32.0, 32.0)
    via = CENTRE + np.array([38.0, 0.0])
    clicks[3] = SliceClicks(corrections=(np.column_stack([on_disc, via]),))
    corrected = followed(clicks)
    assert doubtful(corrected, clicks) == []
    for k in (3, 4, 5):
        away = bumped(corrected[k].points_px)
        assert np.abs(away).max() < FAILED_PX / 2.0  # the notches between the disc and the bone are rounded off
        assert np.mean(np.abs(away)) < 2.0 * WITHIN_PX
    for k in (0, 1, 2):
        np.testing.assert_array_equal(corrected[k].points_px, alone[k].points_px)


def test_a_slice_that_lost_its_bone_is_doubtful():
    """Check a disc that jumps by more than the band in the third slice; clicks there recover it."""
    aside = CENTRE + np.array([16.0, 9.0])
    images = [painted(from_disc(pixels(), c), NOISE, k) for k, c in enumerate((CENTRE, CENTRE, aside, aside))]
    clicks = {0: SliceClicks(clicked(10, 100, 190, 280))}
    assert doubtful(followed(clicks, images), clicks) == [2, 3]
    clicks[2] = SliceClicks(clicked(0, 90, 180, 270, centre=aside))
    again = followed(clicks, images)
    assert doubtful(again, clicks) == []
    assert np.sqrt(np.mean(from_disc(again[3].points_px, aside) ** 2)) < WITHIN_PX


def test_a_correction_replaces_the_part_next_to_its_third_point():
    circle = clicked(*range(0, 360, 3))
    for a, b in ((-30.0, 30.0), (30.0, -30.0)):
        line = corrected_line(circle, np.column_stack([clicked(a, b), CENTRE + np.array([30.0, 0.0])]))
        assert line[0].max() == pytest.approx(CENTRE[0] + 30.0, abs=0.1)
        left = line[:, line[0] < CENTRE[0]]
        assert np.abs(from_disc(left)).max() < WITHIN_PX
        assert area_px2(line) > np.pi * RADIUS**2


def test_what_cannot_be_drawn_is_said():
    with pytest.raises(ValueError, match="no slice has clicks"):
        followed({2: SliceClicks(corrections=(np.zeros((2, 3)),))})
    with pytest.raises(ValueError, match="slice 1: a closed line needs three"):
        followed({0: SliceClicks(np.array([[3.0, 3.0, 9.0], [4.0, 4.0, 9.0]]))})


def test_an_image_without_an_edge_gives_the_line_itself():
    found = found_contour(slopes_of(np.full((SIZE, SIZE), 7.0)), clicked(*range(0, 360, 3)), Settings())
    assert found.weakest == 0.0
    assert np.abs(from_disc(found.points_px)).max() < WITHIN_PX

"""How far measured postures are from what the girdle with its effects can take, in units of the noise.

What is measured in one posture, x = (six angles, landmark coordinates), obeys g(x, z) = 0 with z the adapted parameters
and the amplitudes of the effects: A1-A3, and one equation for each coordinate. With x* the nearest such point to the
measured s (distances in units of the noise N), G = dg/dx N and V = G G' there,

    y = V^(-1/2) G N^-1 (s - x*),   |y| = the distance,   dy/dz = V^(-1/2) dg/dz

up to the curvature of g; what was not measured follows x* and changes nothing. y is standard normal for the right z,
and y' dy/dz is the exact derivative of |y|^2 / 2 (envelope theorem). Six angles leave three numbers a posture: y is the
posture fit in units of the noise.
"""

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from adapt.diagnosis.fit.measurement_noise import Noise
from adapt.diagnosis.fit.observations import Observed
from adapt.engine.batching import compiled, in_chunks
from adapt.solvers.linalg import jacobian
from adapt.solvers.reference.elimination import STEP_LIMIT_RAD
from models.adapted_parameters import ADAPTED
from models.effects import ActiveEffects, Effect, ExtendedGirdle
from models.girdle import Girdle
from motions.table import ANGLES

_POSTURES = 512
"""Postures compiled together, of whatever problem: fewer are padded, more go in chunks."""


@dataclass(frozen=True)
class Misfit:
    """L problems (a subject under a hypothesis), P postures with m informative numbers each; padding postures are 0."""

    nearest: Float[np.ndarray, "quantities postures problems"]
    """x*."""
    y: Float[np.ndarray, "problems postures m"]
    slopes: Float[np.ndarray, "problems postures m columns"]
    """dy/dz of the chosen columns of z; a column of -1 gives zeros."""
    root: Float[np.ndarray, "problems postures m m"]
    """V^(-1/2), lower triangular: what one unit of each equation of g adds to y."""
    by_angle: Float[np.ndarray, "problems postures m 6"]
    """V^(-1/2) dg/dx of the six angles: what one rad of each measured angle adds to y."""
    open_mm: Float[np.ndarray, "problems postures"]
    """How far the chain is from closing at x*: more than rounding where no posture closes it."""
    noise_variance: Float[np.ndarray, "quantities postures problems"]
    """Variance of s - x* that noise alone leaves: N G' V^-1 G N, on the diagonal."""


def columns_of(effects: tuple[Effect, ...], active: tuple[str, ...]) -> Int[np.ndarray, " amplitudes"]:
    """Find the columns of z that hold the amplitudes of the active effects."""
    ends = _ends(effects)
    spans = [range(a, b) for effect, (a, b) in zip(effects, itertools.pairwise(ends), strict=True)
             if effect.name in active]  # fmt: skip
    return np.array([column for span in spans for column in span], int)


def prior_sd_of(effects: Iterable[Effect]) -> Float[np.ndarray, " amplitudes"]:
    """Concatenate the prior SD of the amplitudes of these effects, one after the other; of none, none."""
    return np.concatenate([np.zeros(0), *(effect.prior_sd for effect in effects)])


def spans_of(effects: Iterable[Effect]) -> list[slice]:
    """Locate the amplitudes of each of these effects among those of all, one after the other."""
    ends = np.cumsum([0, *(effect.amplitudes for effect in effects)]).tolist()
    return list(itertools.starmap(slice, itertools.pairwise(ends)))


def free_columns(
    effects: tuple[Effect, ...], hypotheses: Sequence[tuple[str, ...]]
) -> Int[np.ndarray, "free hypotheses"]:
    """List the columns of z that each hypothesis frees: the adapted parameters, then its amplitudes, padded with -1."""
    free = [np.concatenate([np.arange(len(ADAPTED)), columns_of(effects, hypothesis)]) for hypothesis in hypotheses]
    width = max(map(len, free))
    return np.stack([np.pad(f, (0, width - len(f)), constant_values=-1) for f in free], axis=1)


def _ends(effects: tuple[Effect, ...]) -> list[int]:
    return np.cumsum([len(ADAPTED), *(effect.amplitudes for effect in effects)]).tolist()


def prior_z(girdle: Girdle, effects: tuple[Effect, ...]) -> Float[np.ndarray, " parameters"]:
    """Build z of the model as it is: its own adapted parameters, every amplitude 0."""
    return np.concatenate([np.asarray(girdle.adapted_mm), np.zeros(_ends(effects)[-1] - len(ADAPTED))])


def misfit(
    girdle: Girdle,
    effects: tuple[Effect, ...],
    data: Observed,
    noise: Noise,
    z: Float[np.ndarray, "parameters problems"],
    columns: Int[np.ndarray, "columns problems"] | None = None,
    nearest: Float[np.ndarray, "quantities postures problems"] | None = None,
    projections: int = 4,
) -> Misfit:
    """Compute the misfit of each problem at its z. ``data`` has one subject a problem; ``nearest`` is where to begin.

    ``columns`` of z are those of ``slopes``; by default the adapted parameters.
    """
    if columns is None:
        columns = np.repeat(np.arange(len(ADAPTED))[:, None], z.shape[1], axis=1)
    sd = data.standard_deviations(noise)
    x = data.values if nearest is None else nearest
    for _ in range(projections):
        g, G = _equations(effects, girdle, x, z, data.elevation_deg)
        scaled = G * sd.T[:, :, None, :]
        violation = g + np.einsum("lpmn,npl->lpm", G, np.where(data.measured, data.values - x, 0.0))
        V = scaled @ np.swapaxes(scaled, -1, -2)
        multipliers = np.linalg.solve(V, violation[..., None])[..., 0]
        back = sd * np.einsum("lpmn,lpm->npl", scaled, multipliers)
        step = np.where(data.measured, data.values - x, 0.0) - back
        longest = np.abs(step[:6]).max(axis=0)
        x = x + step * np.minimum(1.0, STEP_LIMIT_RAD / np.maximum(longest, STEP_LIMIT_RAD))
    g, G = _equations(effects, girdle, x, z, data.elevation_deg)
    scaled = G * sd.T[:, :, None, :]
    violation = g + np.einsum("lpmn,npl->lpm", G, np.where(data.measured, data.values - x, 0.0))
    T = _chosen(effects, _sensitivities(effects, girdle, x, z, data.elevation_deg), columns, data.elevation_deg)
    real = data.counted.T[..., None]
    root = np.linalg.inv(np.linalg.cholesky(scaled @ np.swapaxes(scaled, -1, -2)))
    whitened = root @ G
    return Misfit(
        nearest=x,
        y=np.where(real, (root @ violation[..., None])[..., 0], 0.0),
        slopes=np.where(real[..., None], root @ T, 0.0),
        root=np.where(real[..., None], root, 0.0),
        by_angle=np.where(real[..., None], whitened[..., : len(ANGLES)], 0.0),
        open_mm=np.where(data.counted.T, np.abs(g).max(axis=2), 0.0),
        noise_variance=np.einsum("lpmn->npl", whitened**2) * sd**4,
    )


def _at_postures(function, girdle: Girdle, angles, z, elevation_deg) -> tuple[np.ndarray, ...]:
    """The function at every posture of every problem; results with the problems and postures first.

    A posture needs nothing of the others: all are one batch, whose size alone is compiled for."""
    postures, problems = elevation_deg.shape
    flat = (angles.reshape(len(angles), -1), np.tile(z, postures), elevation_deg.ravel())
    results = in_chunks(partial(function, girdle), _POSTURES, *flat)
    return tuple(np.moveaxis(x.reshape(*x.shape[:-1], postures, problems), (-1, -2), (0, 1)) for x in results)


def _chosen(
    effects,
    slopes: Float[np.ndarray, "problems postures m inputs"],
    columns: Int[np.ndarray, "columns problems"],
    elevation_deg,
) -> Float[np.ndarray, "problems postures m columns"]:
    """dg/dz of each problem's columns: dg by the adapted parameters and the strengths, times the term of the course."""
    inputs, first = [np.arange(len(ADAPTED))], len(ADAPTED)
    over = [np.ones((len(ADAPTED), *elevation_deg.shape))]
    for effect in effects:
        channels, course = len(effect.channels), effect.course(elevation_deg)
        inputs.append(np.repeat(first + np.arange(channels), len(course)))
        over.append(np.tile(course, (channels, 1, 1)))
        first += channels
    problems = np.arange(columns.shape[1])
    at = np.concatenate(over)[columns, :, problems].transpose(0, 2, 1)
    factor = np.where(columns[:, None] >= 0, at, 0.0)
    picked = slopes[problems[:, None], :, :, np.concatenate(inputs)[columns].T]
    return picked.transpose(0, 2, 3, 1) * factor.transpose(2, 1, 0)[:, :, None]


def _inputs(effects, z, elevation_deg) -> Float[Array, " inputs postures"]:
    """The adapted parameters and the strength of every channel of every effect, at each posture."""
    amplitudes = (z[a:b] for a, b in itertools.pairwise(_ends(effects)))
    strengths = [effect.at(a, elevation_deg) for effect, a in zip(effects, amplitudes, strict=True)]
    return jnp.concatenate([z[: len(ADAPTED)], *strengths])


def _chain(effects, girdle: Girdle, inputs) -> ExtendedGirdle:
    ends = np.cumsum([len(ADAPTED), *(len(effect.channels) for effect in effects)]).tolist()
    strengths = tuple(inputs[a:b] for a, b in itertools.pairwise(ends))
    return ExtendedGirdle(girdle.over_axes(1).with_adapted(inputs[: len(ADAPTED)]), ActiveEffects(strengths, effects))


def _closure(chain: ExtendedGirdle, angles):
    """A1-A3."""
    return chain.residuals_mm(angles)


def _positions(chain: ExtendedGirdle, angles):
    """The coordinates of SHOWN, landmark by landmark."""
    points = jnp.swapaxes(chain.landmarks_mm(angles), 0, 1)
    return points.reshape(-1, *points.shape[2:])


def _equations(effects, girdle: Girdle, x, z, elevation_deg) -> tuple[np.ndarray, np.ndarray]:
    """g (problems, postures, m) and dg/dx (problems, postures, m, quantities)."""
    g, G = _at_postures(partial(_by_angles, _closure, effects), girdle, x[:6], z, elevation_deg)
    if len(x) == len(ANGLES):
        return g, G
    predicted, slopes = _at_postures(partial(_by_angles, _positions, effects), girdle, x[:6], z, elevation_deg)
    landmarks = np.transpose(x[6:], (2, 1, 0))
    itself = np.broadcast_to(np.eye(landmarks.shape[2]), (*landmarks.shape, landmarks.shape[2]))
    none = np.zeros((*g.shape, landmarks.shape[2]))
    G = np.concatenate([np.concatenate([G, none], axis=3), np.concatenate([-slopes, itself], axis=3)], axis=2)
    return np.concatenate([g, landmarks - predicted], axis=2), G


def _sensitivities(effects, girdle: Girdle, x, z, elevation_deg) -> Float[np.ndarray, "problems postures m inputs"]:
    """dg by the adapted parameters and all strengths."""
    (slopes,) = _at_postures(partial(_by_inputs, _closure, effects), girdle, x[:6], z, elevation_deg)
    if len(x) == len(ANGLES):
        return slopes
    (predicted,) = _at_postures(partial(_by_inputs, _positions, effects), girdle, x[:6], z, elevation_deg)
    return np.concatenate([slopes, -predicted], axis=2)


# Landmarks are compiled apart from the closed chain, which every diagnosis has compiled already.


@partial(compiled, static_argnums=(0, 1))
def _by_angles(function, effects, girdle: Girdle, angles: Array, z: Array, elevation_deg: Array) -> tuple[Array, Array]:
    """The function of the chain and its derivatives by the angles, at every posture."""
    chain = _chain(effects, girdle, _inputs(effects, z, elevation_deg))
    return function(chain, angles), jacobian(lambda q: function(chain, q), angles)


@partial(compiled, static_argnums=(0, 1))
def _by_inputs(function, effects, girdle: Girdle, angles: Array, z: Array, elevation_deg: Array) -> tuple[Array]:
    """Its derivatives by the adapted parameters and all strengths: one reverse pass a component."""
    value, backward = jax.vjp(
        lambda inputs: function(_chain(effects, girdle, inputs), angles), _inputs(effects, z, elevation_deg)
    )

    def row(k):
        return backward(jnp.zeros_like(value).at[k].set(1.0))[0]

    return (jax.vmap(row)(jnp.arange(len(value))),)

"""Formulas of a mapping file for a landmark: ``2*centijc7 - ij``, ``(a + b)/2``, ``mean(a, b, c)`` of markers.

The grammar, with quotes round names that contain characters other than letters, digits, ``_``, ``.`` and ``:``:

    sum  = [+|-] term {(+|-) term}        term = factor {*|/ factor}
    factor = number | name | 'name' | (sum) | mean(sum, sum, ...)

The factors of a position sum to 1, so that the landmark moves with its markers whatever the origin is.
"""

import re

_TOKEN = re.compile(r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?![\w.:]))|(?P<name>'[^']+'|[\w.:]+)|(?P<sign>[-+*/(),]))")
_SIGNS = re.compile(r"[-+*/(]")

SUM = 1.0
"""Sum of the factors of a position."""

_ROUNDING = 1e-9
"""Tolerance of this sum, because thirds do not sum to 1 exactly."""

Factors = dict[str, float]
"""Factor of each marker, by name; the empty name holds the constant, which no position may have."""


def is_formula(text: str) -> bool:
    """Check whether a text that is no marker's name may be a formula."""
    return _SIGNS.search(text) is not None


def factors_of(text: str) -> Factors:
    """Parse a formula into the factor of each marker. ValueError, with the reason, where the formula is wrong."""
    reader = _Reader(text)
    found = reader.sum()
    if reader.tokens:
        raise ValueError(f"{reader.tokens[0]!r} is not expected there")
    constant = found.pop("", 0.0)
    total = sum(found.values())
    if constant:
        raise ValueError(f"{constant:g} is added to it, and a position is a sum of markers alone")
    if abs(total - SUM) > _ROUNDING:
        raise ValueError(f"the factors of the markers sum to {total:g}, those of a position to 1")
    return found


class _Reader:
    """Parser that reads one token after the other, from the left."""

    def __init__(self, text: str):
        self.tokens: list[str] = []
        place = 0
        while text[place:].strip():
            match = _TOKEN.match(text, place)
            if match is None:
                raise ValueError(f"{text[place:].strip()!r} cannot be read")
            self.tokens.append(match[0].strip())
            place = match.end()

    def sum(self) -> Factors:
        """Parse a sum of terms."""
        sign = -1.0 if self._next_is("-") else 1.0
        if sign > 0.0:
            self._next_is("+")
        found = _scaled(self._term(), sign)
        while self.tokens and self.tokens[0] in "+-":
            sign = 1.0 if self.tokens.pop(0) == "+" else -1.0
            found = _added(found, _scaled(self._term(), sign))
        return found

    def _term(self) -> Factors:
        found = self._factor()
        while self.tokens and self.tokens[0] in "*/":
            times, other = self.tokens.pop(0) == "*", self._factor()
            if set(other) == {""} and (times or other[""]):
                found = _scaled(found, other[""] if times else 1.0 / other[""])
            elif times and set(found) == {""}:
                found = _scaled(other, found[""])
            else:
                raise ValueError("a marker can be multiplied and divided by a number only")
        return found

    def _factor(self) -> Factors:
        if not self.tokens:
            raise ValueError("it breaks off")
        token = self.tokens.pop(0)
        if token == "(":
            return self._closed(self.sum())
        if token == "mean" and self._next_is("("):
            parts = [self.sum()]
            while self._next_is(","):
                parts.append(self.sum())
            total: Factors = {}
            for part in parts:
                total = _added(total, _scaled(part, 1.0 / len(parts)))
            return self._closed(total)
        if token[0] in "+-*/),":
            raise ValueError(f"{token!r} is not expected there")
        if re.fullmatch(r"[\d.]+", token):
            return {"": float(token)}
        return {token.strip("'"): 1.0}

    def _closed(self, found: Factors) -> Factors:
        if not self._next_is(")"):
            raise ValueError("a bracket is not closed")
        return found

    def _next_is(self, token: str) -> bool:
        if self.tokens and self.tokens[0] == token:
            self.tokens.pop(0)
            return True
        return False


def _scaled(factors: Factors, by: float) -> Factors:
    return {name: by * value for name, value in factors.items()}


def _added(one: Factors, other: Factors) -> Factors:
    return {name: one.get(name, 0.0) + other.get(name, 0.0) for name in {**one, **other}}

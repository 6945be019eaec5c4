"""A small plot with axes as SVG: light enough for a page with many, readable on light and on dark."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import escape

WIDTH, HEIGHT = 400, 270
LEFT, RIGHT, TOP, BOTTOM = 64, 12, 10, 44
INK = "#747d8d"
# Lines of a logarithmic axis closer together than this many decades are not all labelled.
MOST_LABELS = 6


@dataclass(frozen=True, slots=True)
class PlotLine:
    """Points with their look; a wide line is the true motion, drawn below the others."""

    points: tuple[tuple[float, float], ...]
    colour: str
    dashes: str = ""
    width: float = 2.0


@dataclass(frozen=True, slots=True)
class Axis:
    """From `low` to `high`, in decimal logarithms where it is logarithmic, over `start` to `end` in pixels."""

    label: str
    low: float
    high: float
    start: float
    end: float
    is_logarithmic: bool = False

    def place(self, value: float) -> float:
        """The pixel of a value."""
        shown = math.log10(value) if self.is_logarithmic else value
        return self.start + (shown - self.low) / (self.high - self.low) * (self.end - self.start)

    def ticks(self) -> list[tuple[float, str]]:
        """(pixel, text) of some round values."""
        if self.is_logarithmic:
            every = max(1, math.ceil((self.high - self.low) / MOST_LABELS))
            decades = range(math.ceil(self.low), math.floor(self.high) + 1, every)
            return [(self.place(10.0**k), f"1e{k}") for k in decades]
        step = round_step((self.high - self.low) / 4)
        first = math.ceil(self.low / step - 1e-9)
        values = [k * step for k in range(first, math.floor(self.high / step + 1e-9) + 1)]
        return [(self.place(value), f"{value:.6g}") for value in values]


def round_step(size: float) -> float:
    """The smallest of 1, 2, 5 times a power of ten that is not smaller."""
    power = 10.0 ** math.floor(math.log10(size))
    return next(factor * power for factor in (1, 2, 5, 10) if factor * power >= size * (1 - 1e-9))


def plot(lines: Sequence[PlotLine], x: str, y: str, equal: bool = False, logarithmic: bool = False) -> str:
    """The SVG; `equal`: one scale for both axes. ValueError where there are no points."""
    drawn = [_finite(line, logarithmic) for line in lines]
    xs = [a for line in drawn for a, _ in line.points]
    ys = [math.log10(b) if logarithmic else b for line in drawn for _, b in line.points]
    if not xs:
        raise ValueError("there are no points to draw")
    across, up = _axes(x, y, _span(xs), _span(ys), equal, logarithmic)
    body = "".join(_polyline(line, across, up) for line in drawn if len(line.points) > 1)
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}" '
        f'font-family="sans-serif" font-size="13" fill="{INK}">'
    )
    return f"{head}{_frame(across, up)}{body}</svg>"


def _finite(line: PlotLine, logarithmic: bool) -> PlotLine:
    points = tuple((a, b) for a, b in line.points if math.isfinite(a + b) and (b > 0 or not logarithmic))
    return PlotLine(points, line.colour, line.dashes, line.width)


def _span(values: Sequence[float]) -> tuple[float, float]:
    low, high = min(values), max(values)
    margin = 0.04 * (high - low) or 0.5 * max(abs(low), 1.0)
    return low - margin, high + margin


def _axes(
    x: str, y: str, of_x: tuple[float, float], of_y: tuple[float, float], equal: bool, logarithmic: bool
) -> tuple[Axis, Axis]:
    width, height = WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM
    if equal:
        unit = max((of_x[1] - of_x[0]) / width, (of_y[1] - of_y[0]) / height)
        of_x, of_y = _widened(of_x, unit * width), _widened(of_y, unit * height)
    return (
        Axis(x, *of_x, start=LEFT, end=WIDTH - RIGHT),
        Axis(y, *of_y, start=HEIGHT - BOTTOM, end=TOP, is_logarithmic=logarithmic),
    )


def _widened(span: tuple[float, float], size: float) -> tuple[float, float]:
    middle = (span[0] + span[1]) / 2
    return middle - size / 2, middle + size / 2


def _frame(across: Axis, up: Axis) -> str:
    grid = "".join(f"M{place:.1f} {TOP}V{HEIGHT - BOTTOM}" for place, _ in across.ticks())
    grid += "".join(f"M{LEFT} {place:.1f}H{WIDTH - RIGHT}" for place, _ in up.ticks())
    texts = "".join(
        f'<text x="{place:.1f}" y="{HEIGHT - BOTTOM + 17}" text-anchor="middle">{text}</text>'
        for place, text in across.ticks()
    )
    texts += "".join(
        f'<text x="{LEFT - 7}" y="{place + 4:.1f}" text-anchor="end">{text}</text>' for place, text in up.ticks()
    )
    middle = (TOP + HEIGHT - BOTTOM) / 2
    centre = (LEFT + WIDTH - RIGHT) / 2
    texts += f'<text x="{centre}" y="{HEIGHT - 6}" text-anchor="middle">{escape(across.label)}</text>'
    texts += f'<text transform="translate(14 {middle}) rotate(-90)" text-anchor="middle">{escape(up.label)}</text>'
    axes = f"M{LEFT} {TOP}V{HEIGHT - BOTTOM}H{WIDTH - RIGHT}"
    return (
        f'<path d="{grid}" stroke="{INK}" stroke-opacity="0.25" fill="none"/>'
        f'<path d="{axes}" stroke="{INK}" fill="none"/>{texts}'
    )


def _polyline(line: PlotLine, across: Axis, up: Axis) -> str:
    seen: list[tuple[float, float]] = []
    for place in ((across.place(a), up.place(b)) for a, b in line.points):
        if not seen or math.dist(seen[-1], place) > 1.5:  # pixels
            seen.append(place)
    points = " ".join(f"{round(x, 1):g},{round(y, 1):g}" for x, y in seen)
    dashes = f' stroke-dasharray="{line.dashes}"' if line.dashes else ""
    return (
        f'<polyline fill="none" stroke="{line.colour}" stroke-width="{line.width:g}" stroke-linejoin="round"{dashes} '
        f'points="{points}"/>'
    )

"""A moving picture of a scene: its bodies with their trails, rods between those that keep their
distance, and what they touch, in real time or within SECONDS.

What moves is drawn by places of one palette, so that no picture is converted; matplotlib is not
loaded.
"""

import math
import random
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import GifImagePlugin, Image, ImageChops, ImageDraw, ImageFont

from inverse_service.errors import InputError
from inverse_service.expressions import arrays, tree as ex
from inverse_service.integrators.trajectory import Array
from inverse_service.service.scenes import simulating, views
from inverse_service.simulation.scene_data import Progress, Scene
from inverse_service.simulation.sentences import say

FRAMES_A_SECOND, SECONDS, TRAIL = 25, 8.0, 1.0  # length at most; of a trail, s of the picture
SIZE, LEFT, TOP, SIDE = 480, 44, 26, 424  # pixels of the picture and of its square of axes
MARGIN = 1.1  # of the square, in parts of the motion
SHADES, DOT, CLOCK, LABELS, MARK = 6, 4, 14, 12, 4
WHITE, GRID, WALL, ROD, INK = "#ffffff", "#e4e4e4", "#e9e6df", "#5f6672", "#222222"
MOST_TICKS = 6
COARSE = 8  # pixels between the points where the gap to a wall that moves is known
MEMBERS = 24
# Distances at so many states that have nothing in common show which of them are the same at all.
STATES, SAME = 4, 1e-9
Box = tuple[float, float, float]  # the middle of the square, half of its side
Body = tuple[Array, Array]


@dataclass(frozen=True)
class Moving:
    """What moves: times (m,), the places of bodies over them, pairs of bodies with a rod, -1 for
    the origin, shapes that are touched, and when contacts press.
    """

    times: Array
    bodies: Sequence[Body]
    rods: Sequence[tuple[int, int]]
    walls: Sequence["Wall"]
    pressing: Mapping[str, Sequence[tuple[float, float]]]
    with_origin: bool


@dataclass(frozen=True)
class Wall:
    """Where a body with its coordinates `on` the axes x and y of the picture has a gap below 0."""

    gap: ex.Expression
    on: Mapping[ex.Expression, int]
    values: Mapping[ex.Expression, float]

    @property
    def moves(self) -> bool:
        """Whether it depends on the time."""
        return ex.holds(self.gap, ex.TIME)

    def inside(self, box: Box, moment: float, pixel: int) -> Image.Image:
        """A mask of the square."""
        x, y, half = box
        count = SIDE // pixel
        along = (np.arange(count) + 0.5) * 2 / count - 1
        axes = (
            np.broadcast_to(x + half * along, (count, count)),
            np.repeat((y - half * along)[:, None], count, axis=1),
        )
        table = {tree: axes[axis].ravel() for tree, axis in self.on.items()}
        gap = arrays.array_value(self.gap, {**self.values, **table, ex.TIME: moment})
        found = np.broadcast_to(gap, count * count).reshape(count, count).astype(np.float32)
        if pixel > 1:
            smooth = Image.fromarray(found).resize((SIDE, SIDE), Image.Resampling.BILINEAR)
            found = np.asarray(smooth)
        return Image.fromarray(np.where(found < 0, 255, 0).astype(np.uint8))


def simulate_moving(
    document: Any, progress: Progress | None, time_limit: float, path: str, is_whole: bool
) -> dict[str, Any]:
    """`simulate_tables` with a moving picture of the first method that has a trajectory, written to
    a .gif or .mp4 file; without tables where they are not asked for, so that no array is handed on.
    """
    ran = simulating.run_document(document, progress, time_limit)
    whole = simulating.with_tables(ran)
    write(Path(path), moving(ran.found.scene, whole["result"]["methods"], whole["tables"]))
    return whole if is_whole else {"result": whole["result"]}


def moving(
    scene: Scene, methods: Sequence[Mapping[str, Any]], tables: Mapping[str, views.Table]
) -> Moving:
    """What moves by the first method with a trajectory; InputError where nothing has a place."""
    method = next((one for one in methods if one["label"] in tables), None)
    plane = {"x", "y"} <= set(scene.coordinates) and not scene.bodies
    pairs = [("x", "y")] if plane else list(scene.bodies.values())
    if method is None or not pairs:
        raise InputError(say("no_body"))
    table = tables[method["label"]]
    bodies = [(table[x], table[y]) for x, y in pairs]
    if bodies[0][0].ndim == 2:  # members
        bodies = [(x[k], y[k]) for x, y in bodies for k in range(min(len(x), MEMBERS))]
    formulas = {one.name: one.expression for one in scene.own}
    formulas |= {name: ex.Symbol(name) for name in scene.coordinates}
    places = [(formulas[x], formulas[y]) for x, y in pairs]
    is_one = scene.ensemble is None  # members may differ in what a rod or a wall depends on
    rods = _rods(places, scene) if scene.bodies and is_one else []
    walls = list(_walls(places, scene)) if is_one else []
    pressing = {
        one["name"]: [(span["begin"], span["end"]) for span in one["rests"]]
        for one in method.get("contacts", ())
        if one["rests"]
    }
    return Moving(table["t"], bodies, rods, walls, pressing, bool(scene.bodies))


def _rods(
    places: Sequence[tuple[ex.Expression, ex.Expression]], scene: Scene
) -> list[tuple[int, int]]:
    """Pairs of bodies, -1 is the origin, whose distance is the same wherever the coordinates
    are.
    """
    draw = random.Random(0)  # that of NumPy takes longer to load than all pictures to draw
    names: list[ex.Expression] = [ex.TIME]
    for name in scene.coordinates:
        names += [ex.Symbol(name), ex.Velocity(name)]
    table = {name: np.array([draw.uniform(-2, 2) for _ in range(STATES)]) for name in names}
    found = arrays.array_values(
        [tree for place in places for tree in place], {**_numbers(scene), **table}
    )
    points = np.zeros((len(places) + 1, STATES, 2))
    for k, column in enumerate(found):
        points[1 + k // 2, :, k % 2] = column
    size = np.abs(points).max(axis=(1, 2))
    moves = np.ptp(points, axis=1).max(axis=1) > SAME * size
    pairs = []
    for a in range(len(points)):
        apart = np.linalg.norm(points[a] - points[a + 1 :], axis=2)
        scale = np.maximum(size[a], size[a + 1 :])
        good = (np.ptp(apart, axis=1) <= SAME * scale) & (apart.min(axis=1) > SAME * scale)
        good &= moves[a] | moves[a + 1 :]
        pairs += [(a - 1, a + int(k)) for k in np.flatnonzero(good)]
    return pairs


def _numbers(scene: Scene) -> dict[ex.Expression, float]:
    return {ex.Symbol(name): value for name, value in scene.values.items()}


def _walls(places: Sequence[tuple[ex.Expression, ex.Expression]], scene: Scene) -> Iterator[Wall]:
    """Gaps of one body to something fixed, or moved with the time: those that its place in the
    plane determines.
    """
    coordinates: set[ex.Expression] = {*map(ex.Symbol, scene.coordinates)}
    seen = set()
    for contact in scene.contacts:
        used = {one for one in coordinates if ex.holds(contact.gap, one)}
        for place in places:
            on = {tree: axis for axis, tree in enumerate(place) if tree in coordinates}
            key = (contact.gap, *on.items())
            if used and used <= set(on) and key not in seen:
                seen.add(key)
                yield Wall(contact.gap, on, _numbers(scene))


def write(path: Path, what: Moving) -> None:
    """Write the file."""
    pictures = frames(what)
    if path.suffix == ".gif":
        path.write_bytes(b"".join(_parts_of_gif(pictures)))
        return
    size, rate = f"{SIZE}x{SIZE}", str(FRAMES_A_SECOND)
    given = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", size, "-r", rate, "-i", "-"]
    command = ["ffmpeg", "-loglevel", "error", "-y", *given, "-pix_fmt", "yuv420p", str(path)]
    with suppress(BrokenPipeError), subprocess.Popen(command, stdin=subprocess.PIPE) as ffmpeg:
        assert ffmpeg.stdin is not None
        for picture in pictures:
            ffmpeg.stdin.write(picture.convert("RGB").tobytes())
    if ffmpeg.returncode:
        raise InputError("ffmpeg could not make the .mp4 file: write a .gif file.")


def _parts_of_gif(pictures: Iterator[Image.Image]) -> Iterator[bytes]:
    """The header, and of each picture the box of what changed: `Image.save` would keep all pictures
    before it writes one, which takes longer than to write them.
    """
    settings: Any = {"duration": 1000 // FRAMES_A_SECOND, "disposal": 1}
    before = next(pictures)
    yield from GifImagePlugin.getheader(before, info={"loop": 0})[0]
    yield from GifImagePlugin.getdata(before, **settings)
    for picture in pictures:
        box = ImageChops.subtract_modulo(picture, before).getbbox() or (0, 0, 1, 1)
        yield from GifImagePlugin.getdata(picture.crop(box), box[:2], **settings)
        before = picture
    yield b";"


def frames(what: Moving) -> Iterator[Image.Image]:
    """The pictures, with one palette."""
    times = what.times
    length = min(SECONDS, float(times[-1] - times[0]) or 1.0)
    moments = np.linspace(times[0], times[-1], max(2, int(FRAMES_A_SECOND * length)))
    ways = [np.array([np.interp(moments, times, one) for one in body]) for body in what.bodies]
    box = _box(ways, what.with_origin)
    palette = _Palette(len(ways))
    pen = _Pen(palette)
    background = _axes(pen, box)
    for wall in (wall for wall in what.walls if not wall.moves):
        background.paste(palette[WALL][-1], (LEFT, TOP), wall.inside(box, 0.0, 1))
    _grid(pen, background, box)
    x, y, half = box
    scale = SIDE / (2 * half)
    pixels = [
        np.stack([LEFT + (way[0] - x + half) * scale, TOP + (y + half - way[1]) * scale], axis=1)
        for way in ways
    ]
    origin = (LEFT + (half - x) * scale, TOP + (y + half) * scale)
    digits = digits_of_clock(abs(float(times[-1] - times[0])))
    colors = [views.color_of(place) for place in range(len(ways))]
    dots = {color: _dot(palette[color]) for color in colors}
    for frame, moment in enumerate(moments.tolist()):
        picture = background.copy()
        for wall in (wall for wall in what.walls if wall.moves):
            picture.paste(palette[WALL][-1], (LEFT, TOP), wall.inside(box, moment, COARSE))
        draw, first = ImageDraw.Draw(picture), max(0, frame - int(TRAIL * FRAMES_A_SECOND))
        at = [tuple(way[frame].tolist()) for way in pixels]
        for color, way in zip(colors, pixels, strict=True):
            trail = way[first : frame + 1]
            if len(trail) > 1 and np.isfinite(trail).all():
                draw.line(trail.ravel().tolist(), fill=palette[color][SHADES // 2])
        for a, b in what.rods:
            if all(map(math.isfinite, (*at[a], *at[b]))):
                draw.line((origin if a < 0 else at[a], at[b]), fill=palette[ROD][-1], width=3)
        for color, (u, v) in zip(colors, at, strict=True):
            if math.isfinite(u) and math.isfinite(v):
                dot, mask = dots[color]
                picture.paste(dot, (round(u) - DOT, round(v) - DOT), mask)
        pen.write(picture, f"t = {moment:.{digits}f}", (LEFT, TOP - 8), CLOCK)
        now = [
            name
            for name, spans in what.pressing.items()
            if any(begin <= moment <= end for begin, end in spans)
        ]
        if now:
            pen.write(picture, f"touching: {', '.join(now)}", (LEFT + 110, TOP - 8), LABELS)
        yield picture


def digits_of_clock(length: float) -> int:
    """How many show a hundredth of a motion: a clock that changes less often than the picture makes
    the file smaller.
    """
    return max(0, math.ceil(2 - math.log10(length or 1.0)))


def _box(ways: Sequence[Array], with_origin: bool) -> Box:
    points = np.concatenate([*ways, *([np.zeros((2, 1))] if with_origin else [])], axis=1)
    low, high = np.nanmin(points, axis=1), np.nanmax(points, axis=1)
    half = MARGIN / 2 * float((high - low).max()) or 1.0
    x, y = ((low + high) / 2).tolist()
    return x, y, half


class _Palette(dict[str, list[int]]):
    """Places of the palette for shares 1/SHADES, ..., 1 of colors on white."""

    def __init__(self, bodies: int) -> None:
        super().__init__()
        self.numbers: list[int] = []
        for color in (WHITE, GRID, WALL, ROD, INK, *map(views.color_of, range(bodies))):
            if color not in self:
                self[color] = self._shades(color)

    def _shades(self, color: str) -> list[int]:
        full = [int(color[k : k + 2], 16) for k in (1, 3, 5)]
        begin = len(self.numbers) // 3
        for k in range(1, SHADES + 1):
            self.numbers += [round(255 + (part - 255) * k / SHADES) for part in full]
        return list(range(begin, begin + SHADES))


class _Pen:
    """Writes texts; a letter is drawn once."""

    def __init__(self, palette: _Palette) -> None:
        self.palette = palette
        self._fonts: dict[int, Any] = {}
        self._letters: dict[tuple[str, int], tuple[Image.Image, Image.Image, int, int]] = {}

    def write(
        self,
        picture: Image.Image,
        text: str,
        at: tuple[float, float],
        size: int,
        share: float = 0.0,
    ) -> None:
        """A text with its base line at a place, from there to the right, or to the left by a share
        of its length.
        """
        letters = [self._letter(letter, size) for letter in text]
        x = at[0] - share * sum(letter[3] for letter in letters)
        for glyph, mask, rise, width in letters:
            picture.paste(glyph, (round(x), round(at[1]) - rise), mask)
            x += width

    def _letter(self, letter: str, size: int) -> tuple[Image.Image, Image.Image, int, int]:
        if (letter, size) not in self._letters:
            font = self._fonts.setdefault(size, ImageFont.load_default(size))
            width = round(font.getlength(letter))
            box = font.getbbox(letter, anchor="ls")
            drawn = Image.new("L", (max(1, box[2] - box[0]), max(1, box[3] - box[1])))
            ImageDraw.Draw(drawn).text((-box[0], -box[1]), letter, 255, font, anchor="ls")
            self._letters[letter, size] = (*_inked(drawn, self.palette[INK]), -box[1], width)
        return self._letters[letter, size]


def _ticks(low: float, high: float) -> list[float]:
    """Round numbers, at most MOST_TICKS."""
    least = (high - low) / MOST_TICKS
    unit = 10.0 ** math.floor(math.log10(least))
    step = next(unit * k for k in (1, 2, 5, 10) if unit * k >= least)
    return [k * step for k in range(math.ceil(low / step), math.floor(high / step) + 1)]


def _axes(pen: _Pen, box: Box) -> Image.Image:
    """The square with the numbers beside it."""
    picture = Image.new("P", (SIZE, SIZE), pen.palette[WHITE][-1])
    picture.putpalette(pen.palette.numbers)
    x, y, half = box
    for axis, middle in enumerate((x, y)):
        for value in _ticks(middle - half, middle + half):
            along = (value - middle + half) * SIDE / (2 * half)
            text = f"{float(f'{value:.6g}') or 0:g}"
            at = (LEFT - 6, TOP + SIDE - along + 4) if axis else (LEFT + along, TOP + SIDE + 18)
            pen.write(picture, text, at, LABELS, 1.0 if axis else 0.5)
    return picture


def _grid(pen: _Pen, picture: Image.Image, box: Box) -> None:
    """Lines at the numbers, and the axes, on top of walls that do not move."""
    draw, (x, y, half), end = ImageDraw.Draw(picture), box, TOP + SIDE
    for value in _ticks(x - half, x + half):
        u = LEFT + (value - x + half) * SIDE / (2 * half)
        draw.line((u, TOP, u, end), fill=pen.palette[GRID][-1])
        draw.line((u, end, u, end + MARK), fill=pen.palette[INK][-1])
    for value in _ticks(y - half, y + half):
        v = end - (value - y + half) * SIDE / (2 * half)
        draw.line((LEFT, v, LEFT + SIDE, v), fill=pen.palette[GRID][-1])
        draw.line((LEFT - MARK, v, LEFT, v), fill=pen.palette[INK][-1])
    draw.line((LEFT, TOP, LEFT, end, LEFT + SIDE, end), fill=pen.palette[INK][-1])


def _inked(covered: Image.Image, places: Sequence[int]) -> tuple[Image.Image, Image.Image]:
    """A picture of places of the palette by how far each pixel is covered, and the mask of those
    that are.
    """
    table = [0, *(places[min(SHADES - 1, k * SHADES // 256)] for k in range(1, 256))]
    places_only = covered.point(table).convert("P")
    return places_only, covered.point([0] + [255] * 255).convert("1")


def _dot(places: Sequence[int]) -> tuple[Image.Image, Image.Image]:
    """The dot of a body."""
    size, fine = 2 * DOT + 1, 8
    large = Image.new("L", (fine * size, fine * size))
    ImageDraw.Draw(large).ellipse((0, 0, fine * size - 1, fine * size - 1), fill=255)
    return _inked(large.reduce(fine), places)

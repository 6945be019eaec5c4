"""Moving pictures: rods, walls, trails, and members of ensembles at the right places."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from inverse_service.cli import simulate_command
from inverse_service.errors import InputError
from inverse_service.service.scenes import moving_pictures as mp, simulating
from inverse_service.service.scenes.views import color_of

BALL: dict[str, Any] = {
    "system": {"coordinates": ["x", "y"], "lagrangian": "(x'^2 + y'^2)/2 - y"},
    "initial": {"positions": {"x": 0, "y": 1}, "velocities": {"x": 1, "y": 0}},
    "step": 0.1,
    "time": 1,
    "methods": [{"method": "runge-kutta", "order": 4}],
}
PENDULUM: dict[str, Any] = {
    "system": {"coordinates": ["a", "b"], "lagrangian": "a'^2 + b'^2/2 + a'*b'*cos(a - b) + 2*cos(a) + cos(b)"},
    "initial": {"positions": {"a": 1, "b": 1}, "velocities": {"a": 0, "b": 0}},
    "points": {"elbow": ["sin(a)", "-cos(a)"], "bob": ["sin(a) + sin(b)", "-cos(a) - cos(b)"]},
    "step": 0.1,
    "time": 1,
    "methods": [{"method": "runge-kutta", "order": 4}],
}  # fmt: skip


def moving(document: dict[str, Any]) -> mp.Moving:
    ran = simulating.run_document(document, None, 20)
    whole = simulating.with_tables(ran)
    return mp.moving(ran.found.scene, whole["result"]["methods"], whole["tables"])


def rgb(picture: Image.Image) -> np.ndarray[Any, Any]:
    return np.asarray(picture.convert("RGB")).astype(int)


def near(pixels: np.ndarray[Any, Any], color: str) -> np.ndarray[Any, Any]:
    """The middle of the pixels of a color, as (x, y)."""
    full = [int(color[k : k + 2], 16) for k in (1, 3, 5)]
    rows, columns = np.nonzero((pixels == full).all(axis=2))
    return np.array([columns.mean(), rows.mean()])


def test_rods_join_what_keeps_its_distance_wherever_the_coordinates_are() -> None:
    """The origin and the elbow, the elbow and the bob; no pair of them is nearer in the motion."""
    assert moving(PENDULUM).rods == [(-1, 0), (0, 1)]


def test_bodies_on_a_circle_have_no_rod_and_a_fixed_point_is_an_end_of_one() -> None:
    """Kepler's circle keeps its distance in this motion alone; a pivot does not move."""
    kepler = {
        "system": {
            "coordinates": ["u", "w"],
            "lagrangian": "(u'^2 + w'^2)/2 + 1/sqrt(u^2 + w^2)",
        },
        "initial": {"positions": {"u": 1, "w": 0}, "velocities": {"u": 0, "w": 1}},
        "points": {"planet": ["u", "w"], "sun": ["0", "0"]},
    }
    assert moving(PENDULUM | kepler).rods == []
    swing = {
        "system": {"coordinates": ["a"], "lagrangian": "a'^2/2 + cos(a)"},
        "initial": {"positions": {"a": 1}, "velocities": {"a": 0}},
        "points": {"pivot": ["3", "0"], "bob": ["3 + sin(a)", "-cos(a)"]},
    }
    assert moving(PENDULUM | swing).rods == [(0, 1)]


def test_a_body_is_drawn_where_it_is() -> None:
    """The first and the last place of a ball, by the numbers at the axes: x from 0 to 1."""
    what = moving(BALL)
    pictures = list(mp.frames(what))
    assert len(pictures) == mp.FRAMES_A_SECOND
    first, last = (near(rgb(picture), color_of(0)) for picture in (pictures[0], pictures[-1]))
    side = mp.SIDE / mp.MARGIN
    assert last - first == pytest.approx([side, side / 2], abs=1)


@pytest.mark.parametrize(
    ("gap", "shares"), [("y - 1/4", [0.25] * 2), ("1/2 - x", [0.5] * 2), ("y + 1 - t", [0, 0.5])]
)
def test_walls_are_shaded_where_the_gap_is_negative(gap: str, shares: list[float]) -> None:
    """Of a square with sides 1: a floor, a wall, and a floor that rises with the time."""
    contacts = {"contacts": [{"gap": gap, "restitution": 1}], "methods": ["adaptive"]}
    (wall,) = moving(BALL | contacts).walls
    pixel = mp.COARSE if wall.moves else 1
    masks = [wall.inside((0.5, 0.5, 0.5), t, pixel) for t in (0.0, 1.5)]
    assert [np.asarray(mask).mean() / 255 for mask in masks] == pytest.approx(shares, abs=0.01)


def test_members_of_an_ensemble_are_bodies() -> None:
    """Three starts are three bodies, and their pictures are not empty."""
    document = BALL | {"ensemble": {"initial": {"positions": {"y": ["1", "2", "3"]}}}}
    what = moving(document)
    assert len(what.bodies) == 3
    assert next(mp.frames(what)).size == (mp.SIZE, mp.SIZE)


def test_a_body_at_rest_and_a_place_without_a_number_are_drawn() -> None:
    """A square without a size, and a column with nan."""
    times = np.linspace(0, 1, 5)
    still = mp.Moving(times, [(0 * times, 0 * times)], [], [], {}, False)
    assert len(list(mp.frames(still))) == 25
    ended = np.where(times < 0.5, times, np.nan)
    lost = mp.Moving(times, [(times, ended)], [(-1, 0)], [], {"floor": [(0, 1)]}, True)
    assert len(list(mp.frames(lost))) == 25


def test_a_file_has_the_pictures_that_are_drawn(tmp_path: Path) -> None:
    """Of each but the first it holds only the box that changed."""
    what, path = moving(PENDULUM), tmp_path / "pendulum.gif"
    mp.write(path, what)
    drawn = [rgb(picture) for picture in mp.frames(what)]
    with Image.open(path) as file:
        assert (file.n_frames, file.info["loop"]) == (len(drawn), 0)  # type: ignore[attr-defined]
        for place, picture in enumerate(drawn):
            file.seek(place)
            assert file.info["duration"] == 1000 // mp.FRAMES_A_SECOND
            assert (rgb(file) == picture).all()


@pytest.mark.parametrize(
    ("length", "digits"), [(1e-4, 6), (0.5, 3), (1.0, 2), (3.0, 2), (10.0, 1), (500.0, 0)]
)
def test_the_clock_shows_a_hundredth_of_the_whole(length: float, digits: int) -> None:
    assert mp.digits_of_clock(length) == digits
    assert 10.0**-digits <= length / 100 * (1 + 1e-12)


@pytest.mark.slow
def test_a_picture_loads_no_program_that_it_does_not_use(tmp_path: Path) -> None:
    """Half of what the command takes are imports."""
    unused = ["flint", "matplotlib", "numpy.ma", "numpy.polynomial", "numpy.random", "sympy"]
    program = (
        "import json, sys\n"
        "from inverse_service.service.scenes import moving_pictures\n"
        f"moving_pictures.simulate_moving(json.loads({json.dumps(PENDULUM)!r}), None, 20, sys.argv[1], False)\n"
        f"print(*(name for name in {unused} if name in sys.modules))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, str(tmp_path / "a.gif")], capture_output=True, text=True
    )
    assert (done.returncode, done.stdout.strip()) == (0, ""), done.stderr


@pytest.mark.parametrize("name", ["picture.png", "picture", "nowhere/picture.gif"])
def test_a_picture_that_cannot_be_written_is_refused_before_any_work(
    tmp_path: Path, name: str
) -> None:
    """The ending and the directory are looked at first."""
    with pytest.raises(InputError, match="--animate"):
        simulate_command.refuse_picture(tmp_path / name)

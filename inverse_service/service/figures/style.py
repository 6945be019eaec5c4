"""The style of figures: sizes, fonts, panels, captions."""

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure

TRUE_COLOR = "#222222"
SETTINGS: Any = matplotlib.rc_params_from_file(Path(__file__).parent / "figures.mplstyle", use_default_template=False)
RESOLUTION = 160
CAPTION_SIZE = 9


def new_figure(width: float, height: float) -> Figure:
    """An empty figure, sizes in inches."""
    return Figure(figsize=(width, height), layout="constrained")


@contextmanager
def panels(count: int, wide: int, width: float, height: float) -> Iterator[tuple[Figure, list[Axes]]]:
    """A figure with this many panels, `wide` per row, sizes in inches, in our settings, with one legend for all."""
    rows = -(-count // wide)
    with matplotlib.rc_context(SETTINGS):
        figure = new_figure(width, height * rows + 0.8)
        axes = list(figure.subplots(rows, wide, squeeze=False).ravel())
        yield figure, axes
        for empty in axes[count:]:
            empty.set_visible(False)
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside right upper", fontsize=8.5)


def save(figure: Figure, folder: Path, name: str, caption: str) -> list[str]:
    """Write NAME.svg and NAME.png with the caption below the picture. Return the names written."""
    width = float(figure.get_size_inches()[0])
    lines = textwrap.wrap(caption, int(width * 14.5)) if caption else []
    if lines:
        figure.supxlabel(plain("\n".join(lines)), x=0.012, ha="left", fontsize=CAPTION_SIZE, color="#333333")
    names = [f"{name}.svg", f"{name}.png"]
    with matplotlib.rc_context(SETTINGS):
        figure.savefig(folder / names[0], metadata={"Date": None, "Title": name})
        figure.set_layout_engine("none")  # the places found for the first file are those of the second
        figure.savefig(folder / names[1], dpi=RESOLUTION, metadata={"Title": name})
    return names


def run_of(result: Mapping[str, Any]) -> str:
    """The run in words: 600 steps of 0.05, 1 step of 0.1."""
    return f"{result['steps']} step{'s' if result['steps'] != 1 else ''} of {shown(result['step'])}"


def plain(text: str) -> str:
    """A text of the user, in which a dollar sign does not begin a matplotlib formula."""
    return text.replace("$", "\\$")


def joined(parts: Sequence[str]) -> str:
    """a, b and c."""
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}" if parts else ""


def shown(value: float) -> str:
    """A number in a caption: two digits, or a power of ten if that is shorter."""
    if value == 0:
        return "0"
    if 1e-3 <= abs(value) < 1e4:
        return f"{value:.3g}"
    mantissa, exponent = f"{value:.1e}".split("e")
    return f"{mantissa}e{int(exponent)}"

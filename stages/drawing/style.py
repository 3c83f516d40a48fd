"""How every figure looks: one matplotlib style, one width, one colour for each reward; drawing on pages in mm."""

from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

INCH = 25.4  # mm
WIDTH = 180.0  # mm, a page's text
DPI = 200  # of PNGs
SMALL = 6.5  # points, of notes
STYLE: Any = {
    "svg.hashsalt": "mimo",  # the same element ids each time
    "pdf.fonttype": 42,  # TrueType: text stays text, and journals take it
    "image.composite_image": False,  # pictures keep their own pixels in SVG and PDF
    "font.family": "DejaVu Sans",  # comes with matplotlib
    "font.size": 7,
    "axes.labelsize": 7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.5,
    "axes.labelpad": 2,
    "xtick.labelsize": SMALL,
    "ytick.labelsize": SMALL,
    "xtick.major.width": 0.5,
    "ytick.major.width": 0.5,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "legend.frameon": False,
    "legend.fontsize": 7,
    "lines.linewidth": 1.0,
    "savefig.dpi": DPI,
    "figure.facecolor": "white",
}
HEADING: Any = {"fontsize": 8, "fontweight": "bold"}  # of panels and columns
COLOURS = {  # Okabe and Ito's, told apart by the colour-blind; one for each reward of the paper, everywhere
    "mtl": "#0072B2",
    "mtl_surprise": "#56B4E9",
    "rtl": "#E69F00",
    "rtl_surprise": "#D55E00",
    "cais": "#009E73",
    "cais_surprise": "#CC79A7",
    "surprise": "#000000",
}
OTHER_COLOUR = "#666666"  # of rewards that are not the paper's, and of notes
INK, GROUND = "#333333", "#eeeeee"  # lines and shades of no reward; GROUND where the rope is on
DASHES: dict[str, Any] = {"attached": "-", "others": (0, (3, 1.5)), "all": "-"}  # by group of joints

Place = tuple[float, float]


def page(height: float) -> tuple[Figure, Axes]:
    """An empty figure of WIDTH and `height` mm, and axes over all of it whose units are mm from the lower left."""
    figure = Figure(figsize=(WIDTH / INCH, height / INCH))
    ax = figure.add_axes((0, 0, 1, 1))
    ax.set(xlim=(0, WIDTH), ylim=(0, height))
    ax.set_axis_off()
    ax.set_zorder(1)  # its text is over what `inset` adds
    return figure, ax


def inset(figure: Figure, corner: Place, width: float, height: float) -> Axes:
    """Axes whose lower left corner is at a place of a page, in mm."""
    across, up = figure.get_size_inches() * INCH
    return figure.add_axes((corner[0] / across, corner[1] / up, width / across, height / up))


def picture(ax: Axes, pixels: Any) -> None:
    """An image (rows, columns, 3) alone, in its own pixels."""
    ax.imshow(pixels, interpolation="none")
    ax.set(xticks=[], yticks=[])
    ax.spines[:].set_visible(False)


def box(ax: Axes, centre: Place, size: Place, text: str, fill: str = "white", edge: str = INK) -> None:
    """A box with text in its middle, on a page."""
    (x, y), (width, height) = centre, size
    corner, style = (x - width / 2, y - height / 2), "round,pad=0,rounding_size=1"
    ax.add_patch(FancyBboxPatch(corner, width, height, boxstyle=style, fc=fill, ec=edge, lw=0.8))
    ax.text(x, y, text, ha="center", va="center", linespacing=1.3)


def arrow(ax: Axes, *places: Place) -> None:
    """An arrow along straight lines from the first place of a page to the last."""
    *corners, end = places
    if len(corners) > 1:
        ax.plot(*zip(*corners, strict=True), color=INK, lw=0.8, solid_capstyle="butt")
    head = {"arrowstyle": "-|>,head_width=0.15,head_length=0.3", "color": INK, "lw": 0.8, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", end, corners[-1], arrowprops=head)


def note(ax: Axes, place: Place, text: str, **look: Any) -> None:
    """Small text at a place of a page, which is its middle unless `look` says otherwise."""
    plain: dict[str, Any] = {"fontsize": SMALL, "ha": "center", "va": "center", "linespacing": 1.3}
    ax.text(*place, text, **plain | look)


def heading(ax: Axes, place: Place, letter: str, text: str) -> None:
    """A panel's letter and title, at its upper left corner."""
    ax.text(*place, f"{letter}   {text}".strip(), va="top", **HEADING)

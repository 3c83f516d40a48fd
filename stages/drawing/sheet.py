"""What surrounds the film's two pictures: titles, the step's numbers, and curves of the whole run with a cursor."""

import io
from functools import cache
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from PIL import Image, ImageDraw, ImageFont

from mimo.record.artifact import Artifact
from mimo.science import analysis, summary
from mimo.world import body
from stages.drawing.style import COLOURS, DASHES, GROUND, OTHER_COLOUR, STYLE

Box = tuple[float, float, float, float]  # left, top, width, height in units, each a whole number of pixels

ACROSS, DOWN = 80, 45  # the sheet
TITLES: Box = (0, 0, 80, 4)
VIEW: Box = (0, 4, 53, 27)
EYE: Box = (54.5, 4, 24, 24)
PLOTS: Box = (0, 35, 80, 10)
CURVES_TOP, CURVES_HEIGHT = 35.5, 7
LEFT_OF_CURVES, RIGHT_OF_CURVES = 4.5, 2  # within a panel
LARGE = 1.9  # letters in units, to be read on a telephone
INK, SOFT, PAPER = "#1a1a1a", "#555555", "#ffffff"
PANELS = (  # heading, curve, factor from its units to those shown, how a value is written
    ("P(MOVE)", "move_probability", 1, "{:.2f}"),
    ("CAIS", "influence", 1, "{:.3f}"),
    ("MTL", "path_length", 100, "{:.1f} cm"),
)
LINES = {  # sizes in units
    "font.size": 1.3,
    "xtick.labelsize": 1.2,
    "ytick.labelsize": 1.2,
    "lines.linewidth": 0.14,
    "axes.linewidth": 0.06,
} | {
    f"{axis}tick.major.{what}": size for axis in "xy" for what, size in (("size", 0.3), ("width", 0.06), ("pad", 0.25))
}
LETTERS = Path(mpl.get_data_path()) / "fonts/ttf"


class Sheet:
    """A run's sheets.

    Args:
        run: its record.
        phases: the phases' steps.
        width: of a sheet in pixels, a multiple of ACROSS.
    """

    def __init__(self, run: Artifact, phases: dict[str, slice], width: int) -> None:
        self._unit, self._phases, self._limb = width // ACROSS, phases, str(run.about["limb"])
        self._title = f"{str(run.about['condition']).capitalize()} mobile"
        self._reward = f"reward: {summary.label(str(run.about['reward']))}"
        self.colour = COLOURS.get(str(run.about["reward"]), OTHER_COLOUR)
        record = {name: dataset.values for name, dataset in run.datasets.items()}
        limbs = {limb: body.attached(limb) for limb in body.LIMB_JOINTS}
        curves = analysis.curves(record, limbs, self._limb, temperature=1)  # Q is not among PANELS
        self._panels = []  # heading, how a value is written, curves by group of joints
        for heading, name, factor, form in PANELS:
            groups = {"all": name} if name in curves else {group: f"{name}/{group}" for group in analysis.GROUPS}
            if curves.keys() >= set(groups.values()):
                self._panels.append((heading, form, {group: factor * curves[own] for group, own in groups.items()}))
        self._blank = self._without_step()

    def pixels(self, box: Box) -> tuple[int, int, int, int]:
        """A box in pixels."""
        left, top, width, height = (round(self._unit * length) for length in box)
        return left, top, width, height

    def at(self, step: int, title: str, new: bool, beside: np.ndarray, within: np.ndarray) -> np.ndarray:
        """(height, width, 3) uint8: the sheet of a moment.

        Args:
            step: counted from 0.
            title: of the shot.
            new: whether to set the title off.
            beside: picture in third person, of the size of VIEW.
            within: what the eye sees, of any size.
        """
        page, steps = self._blank.copy(), self._phases["extinction"].stop
        draw = ImageDraw.Draw(page)
        paper, ink, soft = (INK, PAPER, PAPER) if new else (PAPER, INK, SOFT)
        self._paste(page, Image.new("RGB", (1, 1), paper), TITLES)
        length = self._write(draw, (1, 2), self._title, soft)
        self._write(draw, (length + 3, 2), title, ink, bold=True)
        self._write(draw, (ACROSS - 1, 2), f"step {step + 1} of {steps}", soft, "rm")
        for number, (_, form, groups) in enumerate(self._panels):
            left, top, width, height = self._axes(number)
            right = left + width
            for group, values in reversed(groups.items()):
                text = form.format(values[step])
                right -= 1 + self._write(draw, (right, 33.3), text, self._colour(group), "rm", bold=True)
            x = round(self._unit * (left + width * (step + 0.5) / steps))
            draw.line((x, self._unit * top, x, self._unit * (top + height)), INK, max(1, self._unit // 6))
        self._paste(page, Image.fromarray(beside), VIEW)
        self._paste(page, Image.fromarray(within), EYE)
        return np.asarray(page)

    def _paste(self, page: Image.Image, picture: Image.Image, box: Box) -> None:
        left, top, width, height = self.pixels(box)
        page.paste(picture.resize((width, height), Image.Resampling.NEAREST), (left, top))

    def _without_step(self) -> Image.Image:
        page = Image.new("RGB", (self._unit * ACROSS, self._unit * DOWN), PAPER)
        self._paste(page, self._plots(), PLOTS)
        draw = ImageDraw.Draw(page)
        for line, text in enumerate(("what the right eye sees", self._reward)):
            self._write(draw, (EYE[0] + EYE[2] / 2, 29.2 + 2 * line), text, SOFT, "mm")
        for number, (heading, _, _) in enumerate(self._panels):
            self._write(draw, (self._axes(number)[0] - 2.5, 33.3), heading, INK)
        return page

    def _plots(self) -> Image.Image:
        with mpl.rc_context():
            mpl.rcdefaults()  # whatever the user's own matplotlibrc says
            mpl.rcParams.update(STYLE | LINES)
            # An inch has 72 units, as it has points: sizes in points are sizes in units.
            figure = Figure(figsize=(PLOTS[2] / 72, PLOTS[3] / 72), dpi=72 * self._unit)
            FigureCanvasAgg(figure)
            for number, (_, _, groups) in enumerate(self._panels):
                self._panel(figure, number, groups)
            drawn = io.BytesIO()
            figure.savefig(drawn, format="png", dpi="figure")
        return Image.open(drawn).convert("RGB")

    def _panel(self, figure: Figure, number: int, groups: dict[str, np.ndarray]) -> None:
        left, top, width, height = self._axes(number)
        bottom = PLOTS[1] + PLOTS[3] - top - height
        ax = figure.add_axes((left / PLOTS[2], bottom / PLOTS[3], width / PLOTS[2], height / PLOTS[3]))
        rope = self._phases["attached"]
        ax.axvspan(rope.start + 0.5, rope.stop + 0.5, color=GROUND, lw=0, zorder=0)
        for place, (group, values) in enumerate(groups.items()):
            colour, smooth = self._colour(group), summary.smooth(values, self._phases, summary.window(self._phases))
            for phase in self._phases.values():
                ax.plot(np.arange(phase.start, phase.stop) + 1, smooth[phase], color=colour, ls=DASHES[group])
            if number == 0:
                says = self._limb.replace("_", " ") if group == "attached" else "other limbs"
                ax.text(0.03, 0.22 - 0.17 * place, says, color=colour, transform=ax.transAxes)
        ax.set_xlim(0.5, self._phases["extinction"].stop + 0.5)
        ax.set_ylim(0, 1 if number == 0 else 1.3 * max(values.max() for values in groups.values()))
        ax.set_xticks([phase.stop for phase in self._phases.values()])
        ax.yaxis.set_major_locator(MaxNLocator(2))
        ax.text(
            (rope.start + rope.stop) / 2,
            0.96,
            "rope",
            color=SOFT,
            transform=ax.get_xaxis_transform(),
            ha="center",
            va="top",
        )

    def _axes(self, number: int) -> Box:
        """Of a panel's curves."""
        across = ACROSS / len(self._panels)
        width = across - LEFT_OF_CURVES - RIGHT_OF_CURVES
        return number * across + LEFT_OF_CURVES, CURVES_TOP, width, CURVES_HEIGHT

    def _colour(self, group: str) -> str:
        return {"attached": self.colour, "others": OTHER_COLOUR, "all": INK}[group]

    def _write(
        self,
        draw: ImageDraw.ImageDraw,
        place: tuple[float, float],
        text: str,
        colour: str,
        anchor: str = "lm",
        bold: bool = False,
    ) -> float:
        """Large letters at a place in units; returns the text's length."""
        letters = _letters(LARGE * self._unit, bold)
        draw.text((place[0] * self._unit, place[1] * self._unit), text, colour, letters, anchor)
        return draw.textlength(text, letters) / self._unit


@cache
def _letters(size: float, bold: bool) -> ImageFont.FreeTypeFont:
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(LETTERS / name, size, layout_engine=ImageFont.Layout.BASIC)

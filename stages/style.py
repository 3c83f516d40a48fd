"""How figures and films look: letters, lines, and a colour for each reward."""

from typing import Any

STYLE: Any = {
    "svg.hashsalt": "mimo",  # the same element ids each time
    "font.family": "DejaVu Sans",  # comes with matplotlib
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.labelsize": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.6,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "legend.frameon": False,
    "legend.fontsize": 9,
    "lines.linewidth": 1.2,
    "savefig.dpi": 150,
    "figure.facecolor": "white",
}
COLOURS = {  # Okabe and Ito's, told apart by the colour-blind; one for each reward, everywhere
    "mtl": "#0072B2",
    "mtl_surprise": "#56B4E9",
    "rtl": "#E69F00",
    "rtl_surprise": "#D55E00",
    "cais": "#009E73",
    "cais_surprise": "#CC79A7",
    "surprise": "#000000",
}
OTHER_COLOUR = "#666666"  # of rewards that are not the paper's
SHADES = {"baseline": "#ffffff", "attached": "#eeeeee", "extinction": "#ffffff"}
DASHES = {"attached": "-", "others": (0, (3, 1.5)), "all": "-"}

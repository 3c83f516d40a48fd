"""The paper's figures 1 and 5: setting and agent. Every number is that of params, scene, body or network."""

from itertools import accumulate, pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from mimo.learning import network as layers
from mimo.learning.rewards import REWARDS
from mimo.science import summary
from mimo.settings import params
from mimo.world import body, eye
from mimo.world.protocol import ACTIONS, JOINTS, PHASES, steps
from mimo.world.scene import Scene
from stages.drawing import camera
from stages.drawing.style import (
    COLOURS,
    DPI,
    GROUND,
    INCH,
    INK,
    OTHER_COLOUR,
    Place,
    arrow,
    box,
    heading,
    inset,
    note,
    page,
    picture,
)

ROPE_COLOUR = "#d62020"
NO_TORQUE, MOVE = "NO_TORQUE", "MOVE"

Layer = layers.Linear | layers.LayerNorm | layers.Residual


def setting(p: params.Params, built: Scene, seen: np.ndarray) -> Figure:
    """Figure 1: the scene, the loop of perception and action, the protocol, the torques.

    Args:
        p: all of params.yaml.
        built: the scene.
        seen: (128, 128, 3) uint8, what the right eye sees while the rope is on.
    """
    figure, ax = page(143.0)
    side = INCH * camera.STILL / DPI  # a pixel of the picture is a pixel of the PNG
    picture(inset(figure, (1, 56), side, side), camera.still(built, p.protocol.limb, COLOURS["cais"]))
    picture(inset(figure, (2, 112), 23, 23), seen)
    note(ax, (13.5, 110), "the right eye's view")
    note(ax, (42, 97), "rope", color=ROPE_COLOUR, ha="right")
    heading(ax, (1, 142), "A", "MIMo-Mobile")
    heading(ax, (90, 142), "B", "Agent and environment")
    _loop(ax, p)
    heading(ax, (1, 53), "C", "Simulation, in agent steps")
    _timeline(ax, p)
    heading(ax, (112, 53), "D", "Torques (N m)")
    _torques(ax, p, built)
    return figure


def _loop(ax: Axes, p: params.Params) -> None:
    protocol, top, bottom = p.protocol, 122.0, 74.0
    seconds = protocol.updates_per_step * protocol.timestep
    updates = f"Environment, {protocol.updates_per_step} updates of {1000 * protocol.timestep:g} ms"
    forces = f"force on the mobile: {p.conditions.free.force:g} N (free), {p.conditions.noisy.force:g} N (noisy)"
    box(ax, (135, top + 6), (88, 12), f"{updates}\n{forces}", GROUND)
    learning = f"Expected SARSA ($\\gamma$ = {p.agent.gamma:g})"
    policy = f"Boltzmann policy (temperature {p.agent.temperature:g})"
    box(ax, (135, bottom - 6), (88, 12), f"Agent, a step every {1000 * seconds:g} ms\n{learning}, {policy}", GROUND)
    paying = [reward for reward in REWARDS if reward in COLOURS]  # the paper's
    middle, half = (top + bottom) / 2, 3 + 2 * len(paying)
    arrow(ax, (97, top), (97, bottom))
    note(ax, (98, middle), f"joint\nangles\n$s_t$ ({len(body.JOINTS)})", ha="left")
    arrow(ax, (121, top), (121, middle + 5))
    note(ax, (120, middle + 14), f"right eye\n{eye.SIZE} × {eye.SIZE}\nRGB", ha="right")
    box(ax, (121, middle), (20, 10), "Visual encoder\n(frozen)")
    arrow(ax, (121, middle - 5), (121, bottom))
    note(ax, (122, middle - 13), f"$h_t$ ({p.encoder.latent})", ha="left")
    arrow(ax, (131, middle), (139, middle))
    note(ax, (135, middle + 2.5), "$h_t$")
    arrow(ax, (149, top), (149, middle + half))
    note(ax, (148, middle + half + 6), "mobile\n(MTL)", ha="right")
    box(ax, (149, middle), (20, 2 * half), "")
    note(ax, (149, middle + half - 3), "Reward", fontsize=7)
    for row, reward in enumerate(paying):
        note(ax, (149, middle + half - 7.5 - 4 * row), summary.label(reward), color=COLOURS.get(reward, OTHER_COLOUR))
    arrow(ax, (149, middle - half), (149, bottom))
    note(ax, (150, middle - half - 6), f"$R_t$ ({JOINTS})", ha="left")
    arrow(ax, (171, bottom), (171, top))
    note(ax, (175.5, middle), f"action $a_t$\n{JOINTS} × {{{NO_TORQUE}, {MOVE}}}", rotation=90)
    arrow(ax, (171, middle), (159, middle))
    note(ax, (165, middle + 2.5), "$a_t$")


def _timeline(ax: Axes, p: params.Params) -> None:
    """The three phases, and one agent step of them."""
    protocol, left, width, low, high = p.protocol, 4.0, 98.0, 27.0, 39.0
    ends = [0, *accumulate(getattr(protocol, f"{name}_steps") for name in PHASES)]
    seconds, scale = protocol.updates_per_step * protocol.timestep, width / steps(protocol)
    for name, (first, last) in zip(PHASES, pairwise(ends), strict=True):
        text = f"{name}\n{first + 1}–{last}\n{(last - first) * seconds / 60:.3g} min"
        x, across = left + first * scale, (last - first) * scale
        _bar(ax, (x, low), across, high - low, text, fill=GROUND if name == "attached" else "white")
        if name == "attached":
            ax.plot((x, x + across), (high + 2, high + 2), color=ROPE_COLOUR, lw=1.5)
            limb = protocol.limb.replace("_", " ")
            note(ax, (x + across / 2, high + 4.5), f"rope from the {limb} to the mobile", color=ROPE_COLOUR)
    x, high, low = left + (ends[1] + ends[2]) / 2 * scale, low, 9.0
    ax.plot((left, x, left + width), (low + 7, high, low + 7), color=OTHER_COLOUR, lw=0.6, ls=":")
    first = 0
    for name, count, fill in (
        ("torque", protocol.torque_updates, INK),
        ("rest", protocol.updates_per_step - protocol.torque_updates, "white"),
    ):
        x, across = left + first / protocol.updates_per_step * width, count / protocol.updates_per_step * width
        _bar(ax, (x, low), across, 7, name, fill=fill, ink="white" if fill == INK else INK)
        note(ax, (x + across / 2, low - 4), f"{count} updates\n{1000 * count * protocol.timestep:g} ms")
        first += count
    note(ax, (left, low - 4), "$a_t$", ha="left")
    note(ax, (left + width, low - 4), "$R_t$, $s_{t+1}$, $h_{t+1}$", ha="right")
    note(ax, (left + width / 2, low + 10), f"a step: {first} updates, {1000 * seconds:g} ms")


def _bar(ax: Axes, corner: Place, width: float, height: float, text: str, fill: str, ink: str = INK) -> None:
    ax.add_patch(Rectangle(corner, width, height, fc=fill, ec=INK, lw=0.8))
    note(ax, (corner[0] + width / 2, corner[1] + height / 2), text, color=ink)


def _torques(ax: Axes, p: params.Params, built: Scene) -> None:
    """What each joint may be given; those of the rope's limb in bold."""
    left, right, top, line = 112.0, 179.0, 48.0, 3.15
    held, first = body.attached(p.protocol.limb), top - 8.8
    for y in (top, top - 6.8, first - (JOINTS - 0.4) * line):
        ax.plot((left, right), (y, y), color=INK, lw=0.6)
    note(ax, (left + 1, top - 3.4), "joint", ha="left")
    note(ax, (146, top - 3.4), NO_TORQUE)
    note(ax, (169, top - 3.4), f"{MOVE}:\none at random")
    for row, (name, limits) in enumerate(zip(body.ACTUATED, built.model.actuator_ctrlrange, strict=True)):
        y, look = first - row * line, {"fontweight": "bold" if held[row] else "normal"}
        note(ax, (left + 1, y), name, ha="left", **look)
        for x, torque in zip((147, 167, right - 1), (0.0, *limits), strict=True):
            note(ax, (x, y), f"{torque:+.2f}".replace("-", "−") if torque else "0", ha="right", **look)


def network(p: params.Params) -> Figure:
    """Figure 5: the agent's network, layer by layer, what goes in and what comes out.

    Args:
        p: for the state's length, the hidden layers' width and the policy.
    """
    sizes = {"$s_t$": len(body.JOINTS), "$h_t$": p.encoder.latent}
    inputs = sum(sizes.values())
    count = layers.size(inputs, p.agent.hidden)
    net = layers.over(np.empty(count), inputs, p.agent.hidden)
    figure, ax = page(64.0)
    y, width, gap = 51.0, 17.0, 3.0
    for (symbol, size), name, up in zip(sizes.items(), ("joint angles", "visual latent"), (7, -7), strict=True):
        box(ax, (12, y + up), (22, 9), f"{name}\n{symbol} ({size})")
        arrow(ax, (23, y + up), (27, y + up), (27, y), (35, y))
    note(ax, (30.5, y + 2.5), str(inputs))
    x = 43.5
    chain: list[Layer] = [net.inlet, net.inlet_norm, *net.residuals, net.outlet_norm, net.outlet]
    for layer in chain:
        box(ax, (x, y), (width, 10), _named(layer), GROUND)
        arrow(ax, (x + width / 2, y), (x + width / 2 + gap, y))
        x += width + gap
    box(ax, (x, y), (width, 10), f"Q values\n{JOINTS} × {ACTIONS}")
    policy = (f"Boltzmann policy,\ntemperature {p.agent.temperature:g}", f"P({MOVE})\n({JOINTS})")
    arrow(ax, (x, y - 5), (x, y - 16))
    bias = f"{p.agent.move_bias:+g}".replace("-", "− ").replace("+", "+ ")
    note(ax, (x - 1.5, y - 10.5), f"Q({MOVE}) {bias}", ha="right")
    for up, text in zip((-21, -35), policy, strict=True):
        box(ax, (x, y + up), (width + 8, 10), text)
    arrow(ax, (x, y - 26), (x, y - 30))
    arrow(ax, (x - 12.5, y - 35), (x - 22, y - 35))
    box(ax, (x - 38, y - 35), (32, 10), f"action $a_t$: {JOINTS} ×\n{NO_TORQUE} or {MOVE}")
    _residual(ax, net.residuals[0], (1, 11))
    learning = f"Expected SARSA ($\\gamma$ = {p.agent.gamma:g}), AdamW (learning rate {p.agent.learning_rate:g})"
    note(ax, (1, 5), f"{count} parameters; {learning}", ha="left")
    return figure


def _named(layer: Layer) -> str:
    """A layer's name and its sizes, of inputs and outputs where they differ."""
    if isinstance(layer, layers.Linear):
        outputs, inputs = layer.weight.shape
        return f"Linear\n{inputs} → {outputs}"
    if isinstance(layer, layers.LayerNorm):
        return f"LayerNorm\n{layer.weight.shape[-1]}"
    return f"Residual\n{layer.norm.weight.shape[-1]}"


def _residual(ax: Axes, layer: layers.Residual, corner: Place) -> None:
    """What a residual layer is made of."""
    x, y = corner
    ax.add_patch(Rectangle(corner, 96, 22, fc="none", ec=OTHER_COLOUR, lw=0.6, ls=":"))
    note(ax, (x + 2, y + 19), "Residual layer", ha="left", fontsize=7)
    middle = y + 7.0
    for place, text in zip((20, 42, 64), (_named(layer.linear), _named(layer.norm), "GELU"), strict=True):
        box(ax, (x + place, middle), (16, 9), text, GROUND)
        arrow(ax, (x + place - 14, middle), (x + place - 8, middle))
    arrow(ax, (x + 72, middle), (x + 80, middle))
    arrow(ax, (x + 8, middle), (x + 8, middle + 8), (x + 82, middle + 8), (x + 82, middle + 2))
    ax.add_patch(Circle((x + 82, middle), 2, fc="white", ec=INK, lw=0.8))
    note(ax, (x + 82, middle), "+", fontsize=8)
    arrow(ax, (x + 84, middle), (x + 93, middle))

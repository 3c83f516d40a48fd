"""A study's figure from its numbers: what stands in its rows, or along its axis."""

from collections.abc import Iterator

from mimo.science import summary
from mimo.science.measures import Found
from stages.drawing import mapped
from stages.drawing import studied as drawing
from stages.page.compared import Cell
from stages.page.studied import Studied

OWN, PUBLISHED = "the variant's runs", "published runs, same seeds"


def figure(own: Studied) -> str:
    """As SVG, for the page."""
    says = f"{own.study.title}: {', '.join(measure.title for measure in own.drawn.values())}; the numbers are below."
    if own.kind == "space":
        return _map(own, says)
    if own.kind == "along":
        assert own.study.axis is not None
        curves = {
            name: [drawing.Curve(line.label, line.condition, line.reward, line.points) for line in own.lines(name)]
            for name in own.drawn
        }
        axis = own.study.axis.rpartition(".")[2].replace("_", " ")
        return drawing.along(own.name, says, own.drawn, curves, axis, own.standard)
    if own.kind == "draws":
        legend = ("all encoders", "published encoder, same seeds", "each encoder")
        return drawing.in_rows(own.name, says, own.drawn, list(_encoders(own)), legend)
    return drawing.in_rows(own.name, says, own.drawn, [_row(own, cell) for cell in own.cells], (OWN, PUBLISHED))


def _map(own: Studied, says: str) -> str:
    columns = [
        mapped.Column(name.replace(" ", "\n"), ticks, few, published)
        for name, ticks, few, published in own.space.columns
    ]
    effects = {
        name: [
            mapped.Effect(f"{condition}, {summary.label(reward)}", condition, reward, found["main"])
            for cell, found in cells.items()
            for condition, reward in [cell.split("/")]
        ]
        for name, cells in own.made["space"]["measures"].items()
        if name in own.drawn
    }
    verdicts = [
        mapped.Verdict(f"{each['claim'].split()[0]} as {each['group']}", each["holds"], each["by"])
        for each in own.made["space"]["verdicts"]
    ]
    return mapped.mapped(own.name, says, columns, own.drawn, effects, verdicts)


def _row(own: Studied, cell: Cell) -> drawing.Row:
    marks = {name: drawing.Mark(found.own, found.published) for name, found in cell.found.items()}
    group = cell.variant.replace("_", " ") if len(own.variants) > 1 else cell.condition
    label = cell.label if len(own.variants) > 1 else summary.label(cell.reward)
    return drawing.Row(group, label, cell.reward, marks)


def _encoders(own: Studied) -> Iterator[drawing.Row]:
    """A row for each condition and reward."""
    by_measure = {name: {(one.condition, one.reward): one for one in own.encoders(name)} for name in own.drawn}
    for condition, reward in dict.fromkeys(pair for found in by_measure.values() for pair in found):
        marks = {}
        for name, found in by_measure.items():
            if one := found.get((condition, reward)):
                seeds = one.published.n
                dots = [each.effect for each in one.each.values()]
                marks[name] = drawing.Mark(Found(one.centre, one.both, seeds, one.published.seeds), one.published, dots)
        yield drawing.Row(condition, summary.label(reward), reward, marks)

"""How `twinscrew bench` prints: every figure that it measured."""

from rich.console import Console

from twinscrew.hil_sim.commands import bench

FIGURES = {
    "a figure": 7,
    "flat": {"load": 1.5},
    "rows": {"kalman": {"rmse": 0.25}},
    "rows and figures": {"kalman": {"rmse": 0.25}, "p50": 3.5},
    "tables": {"wire": {"small": {"p99": 8.5}}, "kalman": {"rmse": 0.25}, "p50": 3.5},
}


def test_every_figure_is_printed_however_deep_it_stands():
    console = Console(record=True, width=100)
    for name, values in FIGURES.items():
        bench._print(console, name, values)
    said = console.export_text()
    assert "a figure: 7" in said
    for figure, times in (("1.5", 1), ("0.25", 3), ("3.5", 2), ("8.5", 1)):
        assert said.count(figure) == times, figure

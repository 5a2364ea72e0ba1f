"""Labels of points."""

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

from armwright.pictures.point_labels import PointLabel, place_labels


def test_labels_hide_neither_points_nor_each_other() -> None:
    figure = Figure(figsize=(5.2, 4.2), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    points = [(float(x), float(y)) for x, y in np.random.default_rng(0).uniform(0.2, 0.5, (9, 2))]
    axes.scatter(*np.array([*points, (1.0, 1.0)]).T, label="designs")
    axes.set(xlim=(0, 1), ylim=(0, 1))
    labels = [PointLabel(f"design {i}\nYPP", point, "black") for i, point in enumerate(points[:4])]
    place_labels(axes, [*labels, PointLabel("beyond", (1.0, 1.0), "black")], points)
    figure.draw_without_rendering()
    assert [text.get_text() for text in axes.texts] == ["design 0\nYPP", "design 1\nYPP", "design 2\nYPP",
                                                        "design 3\nYPP", "beyond"]  # fmt: skip
    boxes = [Text.get_window_extent(text) for text in axes.texts]
    for i, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[:i])
        assert not any(box.contains(*place) for place in axes.transData.transform(points))
        assert axes.bbox.contains(box.x0, box.y0)
        assert axes.bbox.contains(box.x1, box.y1)

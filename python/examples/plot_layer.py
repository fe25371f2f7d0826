#!/usr/bin/env python3
"""Plots the layer of a part at a height: its pixels, and the contours that they come from.

    plot_layer.py PART [--height MM] [--dpi N] [-o PNG] [--library]

Draws with matplotlib where it is installed; without it, or with --library, the image of the layer itself becomes a 1-bit PNG.
"""
import argparse

import numpy as np

import lamina


def draw(plan, layer, path):
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot

    contours = plan.contours(layer.index)
    low, high = contours.point.min(axis=0) / 1e6 - 1, contours.point.max(axis=0) / 1e6 + 1
    per_mm = np.array(layer.dpi) / 25.4
    left, right = max(0, int(low[0] * per_mm[0])), min(layer.columns, int(high[0] * per_mm[0]))
    # Image row 0 is the back of the bed.
    top, bottom = max(0, layer.rows - int(high[1] * per_mm[1])), min(layer.rows, layer.rows - int(low[1] * per_mm[1]))
    figure, axes = pyplot.subplots(figsize=(8, 8))
    axes.imshow(layer.pixels(top, bottom, left, right), cmap="Greys", interpolation="nearest", alpha=0.5,
                extent=(left / per_mm[0], right / per_mm[0], (layer.rows - bottom) / per_mm[1], (layer.rows - top) / per_mm[1]))
    for points in contours:
        closed = np.vstack([points, points[:1]]) / 1e6
        axes.plot(closed[:, 0], closed[:, 1], linewidth=0.8)
    axes.set(xlabel="x, mm", ylabel="y, mm", title=f"layer {layer.index}, z = {layer.plane / 1e6} mm")
    figure.savefig(path, dpi=150)


def main():
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("part")
    words.add_argument("--height", type=float, default=1.0, help="mm above the bed")
    words.add_argument("--dpi", type=int, default=300)
    words.add_argument("-o", "--output", default="layer.png")
    words.add_argument("--library", action="store_true", help="without matplotlib")
    requested = words.parse_args()

    plan = lamina.plan(requested.part, {"bed.dpi": requested.dpi, "layers.thickness_mm": 0.1})
    bottoms = plan.heights["bottom"]
    layer = plan[int(np.searchsorted(bottoms, round(requested.height * 1e6), side="right")) - 1]
    print(layer)
    print(f"contours enclose {plan.contours(layer.index).area_mm2:.3f} mm2, "
          f"pixels cover {layer.set_pixels * 25.4 ** 2 / (layer.dpi[0] * layer.dpi[1]):.3f} mm2")
    try:
        if requested.library:
            raise ImportError
        draw(plan, layer, requested.output)
    except ImportError:
        layer.save(requested.output, "png")


if __name__ == "__main__":
    try:
        main()
    except lamina.Error as error:
        raise SystemExit(f"plot_layer: {error}")

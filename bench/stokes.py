#!/usr/bin/env python3
"""bench/stokes.py: creeping flow past regular arrays of spheres and through a large cell. scripts/bench stokes

    scripts/bench stokes [--cell SIDE]   writes bench/stokes.md

Runs lamina_bench (bench/stokes.cpp), which checks its answers. A drag is extrapolated by the square of the voxel's edge, by least
squares over three sizes; its error is the step from the finest size to that, and at least what a slit of the same hydraulic radius
may be off by at the finest size (docs/theory/pores.md).
"""
import argparse
import json
import os
import subprocess
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(ROOT, "bench"))
import figures  # noqa: E402
import tables  # noqa: E402

PROGRAM = os.environ.get("LAMINA_BENCH_PROGRAM", os.path.join(ROOT, "build/release/lamina_bench"))


def measured(pattern):
    done = subprocess.run([PROGRAM, "--benchmark_filter=" + pattern, "--benchmark_format=json"], check=True, stdout=subprocess.PIPE,
                          stderr=subprocess.DEVNULL)
    runs = json.loads(done.stdout)["benchmarks"]
    for run in runs:
        if run.get("error_occurred"):
            sys.exit(f"{run['name']}: {run['error_message']}")
    return runs


def extrapolated(sizes, drags):
    """Mobility (1 / drag) against 1 / size^2, at 0."""
    x, y = [1 / size**2 for size in sizes], [1 / drag for drag in drags]
    mx, my = sum(x) / len(x), sum(y) / len(y)
    slope = sum((a - mx) * (b - my) for a, b in zip(x, y)) / sum((a - mx)**2 for a in x)
    return 1 / (my - slope * mx)


def spheres():
    lattices = {}
    for run in measured("stokes/spheres/"):
        lattices.setdefault(run["name"].split("/")[2], {})[int(run["name"].split("/")[3])] = run
    for name, runs in lattices.items():
        sizes = sorted(runs)
        published = runs[sizes[0]]["published"]
        whole = extrapolated(sizes, [runs[size]["drag"] for size in sizes])
        finest = runs[sizes[-1]]
        error = max(abs(whole / finest["drag"] - 1), finest["error_floor"])
        yield [name.replace("_", " "), f"{published:g}"] + [f"{100 * (runs[size]['drag'] / published - 1):+.2f}" for size in sizes] + [
            f"{whole:.4g}", f"{100 * (whole / published - 1):+.2f}", f"{100 * error:.2f}",
            "yes" if abs(whole / published - 1) <= error else "no", f"{finest['steps']:.0f}"]


def cell(side):
    run = measured(f"stokes/cell/{side}/")[0]
    yield ["voxels", f"{side} x {side} x {side}"]
    yield ["void, %", f"{100 * run['porosity']:.1f}"]
    yield ["seconds, the grid's included", f"{run['real_time']:.1f}"]
    yield ["processor seconds", f"{run['cpu_time']:.1f}"]
    yield ["of these seconds, the grid", f"{run['grid_seconds']:.1f}"]
    yield ["steps to 1e-3", f"{run['steps']:.0f}"]
    yield ["bytes a void voxel, at the peak", f"{run['bytes_a_void_voxel']:.0f}"]
    yield ["cell updates in a processor second, millions", f"{run['updates'] / 1e6:.1f}"]
    yield ["copied in a processor second, GB read and written", f"{run['copied'] / 1e9:.1f}"]
    yield ["updates, of what copying allows", f"{run['of_copy']:.2f}"]
    yield ["k against voxels twice as large, %", f"{100 * run['change_from_coarse']:+.2f}"]


def page(side):
    machine = figures.machine(ROOT)
    yield "# Creeping flow: against published drags, and what it costs"
    yield ""
    yield (f"`scripts/bench stokes --cell {side}`, commit {figures.commit(ROOT)}, {machine['processor']}, {machine['cores']} cores, "
           f"{os.getloadavg()[0]:.0f} processes at work when it began. Walls are cut three times finer than the flow's voxels, as "
           "`lamina permeability` does; nothing is fitted.")
    yield ""
    yield "## Spheres"
    yield ""
    yield ("Drag K = F / (6 pi mu a U) of spheres off the grid, in cells of 48, 64 and 96 voxels a side: what it differs from the "
           "published one. Touching and SC: Zick and Homsy 1982; loose BCC and FCC: the series of Hasimoto 1959.")
    yield ""
    yield from tables.table(["array, share of solid", "published", "at 48, %", "at 64, %", "at 96, %", "extrapolated", "differs, %",
                              "reported error, +- %", "contains it", "steps at 96"], spheres())
    yield "## A cell of random spheres"
    yield ""
    yield ("A tenth of the side in radius, overlapping. A step of a cell reads and writes 264 bytes at least; copying is measured in "
           "the same run, by as many threads. Other programs on the machine lengthen seconds much more than processor seconds.")
    yield ""
    yield from tables.table(["what", "measured"], cell(side))


def main(arguments):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cell", type=int, choices=[96, 192, 256], default=96, help="voxels a side; 192 and 256 take minutes")
    options = parser.parse_args(arguments)
    text = "\n".join(page(options.cell)) + "\n"
    with open(os.path.join(ROOT, "bench/stokes.md"), "w", encoding="utf-8") as file:
        file.write(text.rstrip("\n") + "\n")
    print("wrote bench/stokes.md")


if __name__ == "__main__":
    main(sys.argv[1:])

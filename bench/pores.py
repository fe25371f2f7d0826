#!/usr/bin/env python3
"""bench/pores.py: permeability and porosity as lamina predicts them beside what Di Nisio 2022 measured. scripts/bench pores

    scripts/bench pores [--voxel UM]     writes bench/pores.md

Plans the seven configurations of that document's Table 8 (docs/examples/dinisio2022) for a cylinder of 25.4 mm and asks
`lamina permeability` of the written G-code. Nothing is fitted.
"""
import argparse
import csv
import json
import math
import os
import subprocess
import sys
import tempfile
import time

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(ROOT, "bench"))
import figures  # noqa: E402
import tables  # noqa: E402

LAMINA = os.environ.get("LAMINA_PROGRAM", os.path.join(ROOT, "build/release/lamina"))
TABLES = os.path.join(ROOT, "tests/reference/dinisio2022")


def table(name):
    with open(os.path.join(TABLES, name), encoding="utf-8") as file:
        rows = csv.DictReader((line for line in file if not line.startswith("#")), delimiter="\t")
        return {row["configuration"]: row for row in rows}


def write_cylinder(path, diameter, height, sides=180):
    with open(path, "w", encoding="ascii") as file:
        file.write("solid cylinder\n")
        for i in range(sides):
            (ax, ay), (bx, by) = ((diameter / 2 * math.cos(a), diameter / 2 * math.sin(a))
                                  for a in (2 * math.pi * i / sides, 2 * math.pi * ((i + 1) % sides) / sides))
            for facet in (((ax, ay, 0), (bx, by, 0), (bx, by, height)), ((ax, ay, 0), (bx, by, height), (ax, ay, height)),
                          ((0, 0, height), (ax, ay, height), (bx, by, height)), ((0, 0, 0), (bx, by, 0), (ax, ay, 0))):
                corners = "".join("vertex %.9g %.9g %.9g\n" % corner for corner in facet)
                file.write(f"facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\n")
        file.write("endsolid cylinder\n")


def predict(configuration, folder, voxel):
    toolpaths = os.path.join(folder, "part.gcode")
    subprocess.run([LAMINA, "extrude", os.path.join(folder, "part.stl"), "--job",
                    os.path.join(ROOT, "docs/examples/dinisio2022", configuration + ".toml"), "--overwrite", "-o", toolpaths],
                   check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    start = time.perf_counter()
    done = subprocess.run([LAMINA, "permeability", toolpaths, "--voxel", str(voxel), "--json"], check=True, stdout=subprocess.PIPE)
    return json.loads(done.stdout), time.perf_counter() - start


def page(voxel):
    flow, porosity = table("table_25.tsv"), table("table_17.tsv")
    rows, logs, voids = [], [], []
    with tempfile.TemporaryDirectory() as folder:
        write_cylinder(os.path.join(folder, "part.stl"), 25.4, 3)
        for configuration, measured in flow.items():
            found, seconds = predict(configuration, folder, voxel)
            along = found["flow"][2]
            ratio = along["k1_darcy"] / float(measured["k1_darcy"])
            helium = float(porosity[configuration]["effective_porosity_percent"])
            logs.append(math.log(ratio))
            voids.append(100 * found["porosity"] - helium)
            rows.append([f"`{configuration}`", measured["k1_darcy"], f"{along['k1_darcy']:.1f} +- {along['k1_error_darcy']:.1f}",
                         f"{ratio:.2f}", f"{helium:.2f}", f"{100 * found['porosity']:.2f}",
                         f"{100 * found['porosity_through'][2]:.2f}", f"{seconds:.1f}"])
    yield "# Permeability and porosity: predicted from the plan, and measured"
    yield ""
    machine = figures.machine(ROOT)
    yield (f"`scripts/bench pores`, commit {figures.commit(ROOT)}, {machine['processor']}, {machine['cores']} cores. `lamina permeability` of the G-code of one period of each plan, voxels of "
           f"{voxel} um; measured: Di Nisio 2022, Tables 25 and 17. Widths are those of single layers (the profile anet-a8); "
           "nothing is fitted on these tables.")
    yield ""
    yield from tables.table(["configuration", "k1 measured, D", "k1 predicted, D", "ratio", "effective porosity measured, %",
                              "void, %", "void that leads through, %", "seconds"], rows)
    yield ""
    spread = math.exp(math.sqrt(sum(value * value for value in logs) / len(logs)))
    yield (f"k1: a factor of {spread:.2f} rms, {math.exp(max(map(abs, logs))):.2f} at worst. Void: "
           f"{math.sqrt(sum(value * value for value in voids) / len(voids)):.2f} points rms.")


def main(arguments):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--voxel", type=float, default=10, help="um")
    options = parser.parse_args(arguments)
    with open(os.path.join(ROOT, "bench/pores.md"), "w", encoding="utf-8") as file:
        file.write("\n".join(page(options.voxel)) + "\n")
    print("wrote bench/pores.md")


if __name__ == "__main__":
    main(sys.argv[1:])

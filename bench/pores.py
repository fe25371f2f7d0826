#!/usr/bin/env python3
"""bench/pores.py: predicted permeability and porosity compared with measurements of Di Nisio 2022. scripts/bench pores

    scripts/bench pores [--voxel UM]     writes bench/pores.md
    scripts/bench pores --keep-inertia   the same, but the last table, which takes most of the time, stays as it is

Plans the seven configurations of Table 8 of Di Nisio 2022 (docs/examples/dinisio2022) for a cylinder of 25.4 mm and runs
`lamina permeability` on the written G-code. The acceleration was chosen with the results in view.
"""
import argparse
import csv
import json
import math
import os
import re
import subprocess
import sys
import tempfile

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(ROOT, "bench"))
import figures  # noqa: E402
import tables  # noqa: E402

LAMINA = os.environ.get("LAMINA_PROGRAM", os.path.join(ROOT, "build/release/lamina"))
INERTIA_VOXEL = 15  # um: six flows with inertia take a hundred times as long as one without
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


def solid_share(toolpaths, diameter):
    """Of the cylinder's layers but the first: what its beads are fed / the cylinder, walls and links too; no skirt."""
    fed, last, kind, z, heights = 0.0, 0.0, "", 0.0, set()
    with open(toolpaths, encoding="utf-8") as file:
        for line in file:
            if line.startswith(";TYPE:"):
                kind = line[6:].strip()
            words = {word[0]: float(word[1:]) for word in line.split(";")[0].split()[1:] if word[0] in "XYZE"}
            if line.startswith("G92"):
                last = words.get("E", last)
            elif line.startswith(("G0 ", "G1 ")):
                z = words.get("Z", z)
                if "E" in words:
                    if ("X" in words or "Y" in words) and z > 0.31 and "Skirt" not in kind:
                        fed += words["E"] - last
                        heights.add(z)
                    last = words["E"]
    return fed * math.pi / 4 * 1.75 ** 2 / (math.pi / 4 * diameter ** 2 * 0.3 * len(heights))


def plan(configuration, folder):
    toolpaths = os.path.join(folder, configuration + ".gcode")
    subprocess.run([LAMINA, "extrude", os.path.join(folder, "part.stl"), "--job",
                    os.path.join(ROOT, "docs/examples/dinisio2022", configuration + ".toml"), "--overwrite", "-o", toolpaths],
                   check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return toolpaths


def predict(toolpaths, voxel, options):
    start = os.times().children_user
    done = subprocess.run([LAMINA, "permeability", toolpaths, "--voxel", str(voxel), "--json", *options], check=True,
                          stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    return json.loads(done.stdout), os.times().children_user - start


def other_machine(folder, lag, acceleration):
    """A profile that differs in these alone."""
    with open(os.path.join(ROOT, "pipeline/machine/shipped/extruders/anet-a8.toml"), encoding="utf-8") as file:
        text = file.read()
    for key, value in (("lag_s", lag), ("acceleration_mm_s2", acceleration)):
        text, count = re.subn(rf"^{key} = .*$", f"{key} = {value}", text, flags=re.M)
        assert count == 1, key
    path = os.path.join(folder, "other.toml")
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)
    return ["--machine", path]


def commanded(toolpaths, acceleration):
    """The same toolpaths with another acceleration in M204, which counts before the profile's."""
    with open(toolpaths, encoding="utf-8") as file:
        text, count = re.subn(r"^M204 .*$", f"M204 P{acceleration} T{acceleration}", file.read(), flags=re.M)
    assert count == 1, toolpaths
    path = toolpaths.removesuffix(".gcode") + ".other.gcode"
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)
    return path


def first_table(folder, voxel, flow, porosity):
    """Rows, and what they come to."""
    rows, logs, voids, order = [], [], [], []
    for configuration, measured in flow.items():
        toolpaths = plan(configuration, folder)
        found, seconds = predict(toolpaths, voxel, [])
        void = 100 * (1 - solid_share(toolpaths, 25.4))
        along = found["flow"][2]
        helium = float(porosity[configuration]["effective_porosity_percent"])
        ratio = along["k1_darcy"] / float(measured["k1_darcy"])
        logs.append(math.log(ratio))
        voids.append(void - helium)
        order.append((float(measured["k1_darcy"]), along["k1_darcy"], configuration))
        rows.append([f"`{configuration}`", measured["k1_darcy"], f"{along['k1_darcy']:.1f} +- {along['k1_error_darcy']:.1f}",
                     f"{ratio:.2f}", f"{helium:.2f}", f"{void:.2f}", f"{voids[-1]:+.2f}", f"{100 * found['porosity']:.2f}",
                     f"{100 * found['connected']['bonded']:.2f}", f"{100 * found['connected']['unbonded']:.2f}", f"{seconds:.1f}"])
    yield from tables.table(["configuration", "k1 measured, D", "k1 predicted, D", "ratio", "helium porosity, %",
                              "void of the cylinder, %", "difference", "void of the period, %", "of it connected, beads bonded, %",
                              "not bonded, %", "processor seconds"], rows)
    yield ""
    yield (f"k1: a factor of {factor(logs)}, {swapped(order)} pairs in the wrong order. Void of the cylinder: {rms(voids):.2f} points rms, "
           f"{sum(abs(value) <= 2 for value in voids)} of {len(voids)} within 2.")


def second_table(folder, voxel, flow):
    rows = []
    for name, options in (("widths stated in the file, from the calibration's tables", ["--beads", "stated"]),
                          ("lag 0.047 s, 500 mm/s2: the profile", []),
                          ("the same, not spread along the lines", ["--beads", "deposited"]),
                          ("lag 0.046 s, 400 mm/s2", (0.046, 400)), ("lag 0.053 s, 500 mm/s2", (0.053, 500)),
                          ("lag 0.050 s, 1000 mm/s2", (0.050, 1000)), ("lag 0.052 s, speed at once", (0.052, 1000000))):
        files = {configuration: os.path.join(folder, configuration + ".gcode") for configuration in flow}
        if isinstance(options, tuple):
            files = {configuration: commanded(path, options[1]) for configuration, path in files.items()}
            options = other_machine(folder, *options)
        ratios = [predict(files[configuration], voxel, options)[0]["flow"][2]["k1_darcy"] /
                  float(measured["k1_darcy"]) for configuration, measured in flow.items()]
        rows.append([name, *(f"{ratio:.2f}" for ratio in ratios), factor([math.log(ratio) for ratio in ratios])])
    yield from tables.table(["beads", *(f"`{name}`" for name in flow), "factor"], rows)


def inertia_table(folder, flow):
    rows, logs = [], []
    for configuration, measured in flow.items():
        found, seconds = predict(os.path.join(folder, configuration + ".gcode"), INERTIA_VOXEL, ["--inertia", "--memory", "4G"])
        inertia = found["inertia"]
        # Printed for the density of water, 998.2 kg/m3: that of the air that was used.
        k2 = float(measured["k2_1e-3_m"]) * 1e-3 * 1.204 / 998.2 * 1e6
        logs.append(math.log(inertia["k2_m"] * 1e6 / k2))
        rows.append([f"`{configuration}`", f"{k2:.1f}", f"{inertia['k2_m'] * 1e6:.1f} +- {inertia['k2_error_m'] * 1e6:.1f}",
                     f"{math.exp(logs[-1]):.2f}", f"{seconds:.0f}"])
    yield from tables.table(["configuration", "k2 measured, um", "k2 predicted, um", "ratio", "processor seconds"], rows)
    yield ""
    yield f"k2: a factor of {factor(logs)}."


def page(voxel, kept):
    flow, porosity = table("table_25.tsv"), table("table_17.tsv")
    yield "# Permeability and porosity: predicted from the plan, and measured"
    yield ""
    machine = figures.machine(ROOT)
    yield (f"`scripts/bench pores`, commit {figures.commit(ROOT)}, {machine['processor']}, {machine['cores']} cores. "
           "`lamina permeability` of the G-code of a cylinder of 25.4 mm: one period of each plan, voxels of "
           f"{voxel} um, beads by the model of [docs/theory/bead.md](../docs/theory/bead.md) with the profile anet-a8. Measured: Di Nisio 2022, "
           "Tables 25 and 17. The model's numbers are what 100 % feeds, the melt's lag by the stabilisation distances of "
           "Table 11, and the profile's acceleration. The acceleration was chosen with measured k1 in view: the change that "
           "added the spread along lines replaced 400 by 500 mm/s2. Cura's `anet3d.def.json` has 500 as "
           "`machine_acceleration` and 1000 as `acceleration_print`; the table of other numbers has all three.")
    yield ""
    with tempfile.TemporaryDirectory() as folder:
        write_cylinder(os.path.join(folder, "part.stl"), 25.4, 3)
        yield from first_table(folder, voxel, flow, porosity)
        yield ""
        yield ("The void of the cylinder is what its volume has over what is fed, walls and links counted: all of it, if beads "
               "do not bond. Of the period's void, connected is what leads through, with all beads that touch bonded and with none.")
        yield ""
        yield "k1 predicted / measured with other numbers:"
        yield ""
        yield from second_table(folder, voxel, flow)
        yield ""
        if kept:
            yield kept
            return
        yield (f"Forchheimer's k2 (`--inertia`), commit {figures.commit(ROOT)}, voxels of {INERTIA_VOXEL} um; measured values are those of Table 25 for the density of "
               "air, 1.204 kg/m3, in place of that of water, 998.2 kg/m3, in which they are printed:")
        yield ""
        yield from inertia_table(folder, flow)


def factor(logs):
    return f"{math.exp(rms(logs)):.2f} rms, {math.exp(max(map(abs, logs))):.2f} at worst"


def rms(values):
    return math.sqrt(sum(value * value for value in values) / len(values))


def swapped(order):
    order = sorted(order)
    return sum(a[1] > b[1] for i, a in enumerate(order) for b in order[i + 1:])


def main(arguments):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--voxel", type=float, default=10, help="um")
    parser.add_argument("--keep-inertia", action="store_true")
    options = parser.parse_args(arguments)
    position, kept = os.path.join(ROOT, "bench/pores.md"), ""
    if options.keep_inertia:
        with open(position, encoding="utf-8") as file:
            text = file.read()
        kept = text[text.index("Forchheimer's k2"):].rstrip("\n")
    written = "\n".join(page(options.voxel, kept)) + "\n"
    with open(position, "w", encoding="utf-8") as file:
        file.write(written)
    print("wrote bench/pores.md")


if __name__ == "__main__":
    main(sys.argv[1:])

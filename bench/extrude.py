#!/usr/bin/env python3
"""Toolpaths of one part beside Debian's PrusaSlicer, Slic3r and CuraEngine: processor seconds and peak memory.

    bench/extrude.py PROGRAM PART.stl [FDMPRINTER.def.json] [--out DIR]

0.1 mm layers, two walls, 30 % raster, no solid layers, no supports, no skirt. Processor seconds (user and system, of the
best of three runs; of one run of the two slow peers) do not depend on what else the machine does as wall time does.
CuraEngine runs if its definitions (Debian's package cura) are named.
"""
import os
import subprocess
import sys

COMMON = ["--layer-height", "0.1", "--first-layer-height", "0.1", "--perimeters", "2", "--fill-density", "30%", "--fill-pattern",
          "rectilinear", "--top-solid-layers", "0", "--bottom-solid-layers", "0", "--skirts", "0", "--nozzle-diameter", "0.4"]
CURA = {"layer_height": 0.1, "layer_height_0": 0.1, "infill_line_distance": 1.5, "infill_sparse_density": 30, "infill_pattern": "lines",
        "top_layers": 0, "bottom_layers": 0, "wall_line_count": 2, "adhesion_type": "none", "machine_width": 220, "machine_depth": 220,
        "machine_height": 250, "line_width": 0.45, "center_object": "true", "roofing_layer_count": 0, "support_enable": "false",
        "machine_start_gcode": "", "machine_end_gcode": ""}


def measured(command, runs):
    best = None
    for _ in range(runs):
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        _, status, usage = os.wait4(process.pid, 0)
        if status != 0:
            return None
        seconds = usage.ru_utime + usage.ru_stime
        best = min(best or (seconds, 0), (seconds, usage.ru_maxrss / 1024))
    return best


def main():
    words = [a for a in sys.argv[1:] if a != "--out"]
    out = words.pop() if "--out" in sys.argv else "/dev/shm"
    program, part = words[:2]
    cura = ["CuraEngine", "slice", "-j", words[2] if len(words) > 2 else ""]
    for scope in ([], ["-e0"]):
        cura += scope
        for name, value in CURA.items():
            cura += ["-s", f"{name}={value}"]
    jobs = {"lamina": ([program, "extrude", part, "--machine", "marlin", "--layer", "0.1", "--walls", "2", "--bead", "0.45", "--fill",
                        "raster", "--bead-gap", "1.05", "--tolerance", "5", "--quiet", "-o"], 3),
            "CuraEngine": (cura + ["-l", part, "-o"], 3),
            "PrusaSlicer": (["prusa-slicer", "-g", part, *COMMON, "-o"], 1), "Slic3r": (["slic3r", part, *COMMON, "-o"], 1)}
    print("| program | processor s | peak MiB | moves | file MB |\n|---|---|---|---|---|")
    for name, (command, runs) in jobs.items():
        path = os.path.join(out, f"bench_{name}.gcode")
        result = measured(command + [path], runs)
        if result is None or not os.path.exists(path):
            print(f"| {name} | failed | | | |", flush=True)
            continue
        with open(path, encoding="utf-8", errors="replace") as file:
            moves = sum(1 for line in file if line.startswith(("G1 ", "G0 ")))
        print(f"| {name} | {result[0]:.2f} | {result[1]:.0f} | {moves} | {os.path.getsize(path) / 1e6:.1f} |", flush=True)


if __name__ == "__main__":
    main()

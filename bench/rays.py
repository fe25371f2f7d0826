#!/usr/bin/env python3
"""Times engine `rays` with bands of several heights against engine `contours`.

    scripts/bench rays BUILD... [--cache DIR] [--runs N]

Each BUILD is a program lamina, built with another kBandCrossings (stages/raster/raster.cpp); the first is the base. One ray is shot
for each band of rows, so that fewer crossings a band are more rays. Every build has to write the same layers first; then runs
without files (--format null) alternate, in reverse order every second time, and the medians of the ratios of a run to the base's
of the same round are printed. Parts are those of bench/make_parts.py --made --large, in --cache (default: build/bench/parts).
"""
import argparse
import json
import os
import shutil
import statistics
import sys
import tempfile

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path[:0] = [os.path.join(ROOT, "bench")]
from against import CASES, digest  # noqa: E402
from measure import started  # noqa: E402

JOBS = ("knot800k", "crowns-96", "benchies")


def main(arguments):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("builds", nargs="+")
    parser.add_argument("--cache", default=os.path.join(ROOT, "build/bench/parts"))
    parser.add_argument("--runs", type=int, default=11)
    options = parser.parse_args(arguments)
    with open(os.path.join(options.cache, "parts.json"), encoding="utf-8") as file:
        positions = {name: ",".join(f"{nm / 1e6:.6f}" for nm in part["at_nm"]) for name, part in json.load(file).items()}
    kinds = [(os.path.abspath(build), "rays") for build in options.builds] + [(os.path.abspath(options.builds[0]), "contours")]

    with tempfile.TemporaryDirectory() as work:
        out = os.path.join(work, "out")

        def run(case, kind, image_format):
            part, bed, layer = CASES[case]
            shutil.rmtree(out, ignore_errors=True)
            return started([kind[0], "jet", os.path.join(options.cache, part), "--bed", f"{bed}x{bed}", "--dpi", "1200",
                            "--layer", str(layer), "--at", positions[part], "--engine", kind[1], "--format", image_format,
                            "--quiet", "-o", out])

        def layers(case, kind):
            run(case, kind, "tiff-g4")
            return digest(os.path.join(out, "layers"))

        print("| job | build | engine | wall s | wall, to the base | processor, to the base |\n|---|---|---|---|---|---|")
        for case in JOBS:
            if len({layers(case, kind) for kind in kinds}) != 1:
                sys.exit(f"rays: {case}: the layers of two builds or engines differ")
            runs = {kind: [] for kind in kinds}
            for number in range(options.runs):
                for kind in kinds if number % 2 == 0 else reversed(kinds):
                    runs[kind].append(run(case, kind, "null"))
            for kind, taken in runs.items():
                wall, processor = (statistics.median(own[i] / base[i] for own, base in zip(taken, runs[kinds[0]])) for i in (0, 1))
                print(f"| `{case}` | {options.builds[[k[0] for k in kinds].index(kind[0])]} | {kind[1]} | "
                      f"{statistics.median(own[0] for own in taken):.3f} | {wall:.3f} | {processor:.3f} |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])

"""bench/rebuilt.py: distance of the surface that drops represent from the true one. scripts/bench rebuilt

    scripts/bench rebuilt               writes bench/rebuilt.md; some twenty seconds
    --tests DIR                         with test_dose; else build/release, built first

A sphere of 5 mm and wedges of 3, 5, 10 and 20 degrees become drops (tests/dose/rebuilt.h), by the centre of a pixel or by the share
of a voxel that they fill. The surface is rebuilt from the drops in two ways. Filled: each voxel is filled from the side of its
fullest neighbour. Blurred: drops are Gaussians of sigma a pixel in the plane and a third of a layer in height, and the surface is
where the saturation is half of that of a solid. From 1,500 points of the true surface the nearest change from solid to empty along
the normal is found, up to 0.4 mm away. Exit 1 if, filled, 16 levels of 0.30 mm are farther than pixels of 0.05 mm.
"""
import argparse
import os
import subprocess
import sys

import figures

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))


def measured(tests):
    """Rows of the test's table: shape, dpi, layer in um, levels, dithered, then RMS in um and lost points, filled and blurred."""
    run = subprocess.run([os.path.join(tests, "test_dose"), "--gtest_filter=Rebuilt.Table"], env={**os.environ, "LAMINA_REBUILT": "1"},
                         capture_output=True, text=True, check=True)
    return [line.split("\t")[1:] for line in run.stdout.splitlines() if line.startswith("row\t")]


def way_of(row):
    """A column's head."""
    levels = "pixels" if row[3] == "0" else f"{row[3]} levels"
    return f"{int(row[2]) / 1000:.2f} mm, {levels}{', dithered' if row[4] else ''}"


def page(rows):
    """The page, and whether every shape holds."""
    lines = ["# Surfaces rebuilt from drops", "", f"<!-- Made by scripts/bench rebuilt at commit {figures.commit(ROOT)} -->", "", *__doc__.splitlines()[5:], ""]
    fine = True
    for dpi in sorted({row[1] for row in rows}, key=int):
        here = [row for row in rows if row[1] == dpi]
        shapes = list(dict.fromkeys(row[0] for row in here))
        lines += [f"## {dpi} dpi", "", "RMS distance in um, filled / blurred.", "", "| | " + " | ".join(shapes) + " |",
                  "|---" * (len(shapes) + 1) + "|"]
        for way in dict.fromkeys(way_of(row) for row in here):
            reported = {row[0]: row for row in here if way_of(row) == way}
            cells = [f"{reported[shape][5]} / {reported[shape][7]}" for shape in shapes]
            lines.append(f"| {way} | " + " | ".join(cells) + " |")
        lines.append("")
        for shape in shapes:
            filled = {way_of(row): float(row[5]) for row in here if row[0] == shape}
            fine = fine and filled["0.30 mm, 16 levels"] <= filled["0.05 mm, pixels"]
    lost = sum(int(row[6]) + int(row[8]) for row in rows)
    lines.append(f"Points without a change within 0.4 mm: {lost}.")
    return "\n".join(lines) + "\n", fine


def main(arguments):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tests", help="directory of test_dose")
    options = parser.parse_args(arguments)
    tests = options.tests
    if tests is None:
        subprocess.run(["cmake", "--preset", "release"], cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
        subprocess.run(["cmake", "--build", "--preset", "release", "--target", "test_dose"], cwd=ROOT, check=True)
        tests = os.path.join(ROOT, "build", "release")
    text, fine = page(measured(tests))
    with open(os.path.join(ROOT, "bench", "rebuilt.md"), "w", encoding="utf-8") as out:
        out.write(text)
    print(text)
    sys.exit(0 if fine else 1)

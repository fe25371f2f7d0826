#!/usr/bin/env python3
"""bench/imports.py: compares `lamina machines --import` with a reader of its own, on printers of PrusaSlicer's vendor bundles
and on the presets of tests/corpus/orca. Writes bench/imports.md.

    apt-get download prusa-slicer && dpkg -x prusa-slicer_*.deb /tmp/prusa
    bench/imports.py --profiles /tmp/prusa/usr/share/PrusaSlicer/profiles

The bundles are under the AGPL and are not part of this repository. Exit code 1 if a value differs.
"""
import argparse
import glob
import json
import os
import re
import subprocess
import sys
import tomllib

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
PRINTERS = [
    ("Anycubic.ini", "Anycubic Mega Zero"), ("Anycubic.ini", "Anycubic 4Max Pro 2.0"), ("BIBO.ini", "BIBO2 Touch E1 right only extrusion"),
    ("Creality.ini", "Creality Ender-3 (0.4 mm nozzle)"), ("FLSun.ini", "FLSun Q5"), ("LulzBot.ini", "Taz6 Aero 0.5mm"),
    ("PrusaResearch.ini", "Original Prusa MINI & MINI+"), ("RatRig.ini", "RatRig V-Core-3-300"), ("TriLAB.ini", "DeltiQ 2 - 0.6 nozzle"),
    ("Ultimaker.ini", "Ultimaker 2"), ("Voron.ini", "Voron_v2_250 0.4 nozzle"), ("Zonestar.ini", "Zonestar Z5X"),
]
# lamina's key, PrusaSlicer's, Orca's
NUMBERS = [
    ("bed.build_height_mm", "max_print_height", "printable_height"), ("material.nozzle_mm", "nozzle_diameter", "nozzle_diameter"),
    ("material.filament_mm", "filament_diameter", "filament_diameter"), ("material.density_g_cm3", "filament_density", "filament_density"),
    ("material.price_kg", "filament_cost", "filament_cost"), ("material.nozzle_degc", "temperature", "nozzle_temperature"),
    ("material.first_nozzle_degc", "first_layer_temperature", "nozzle_temperature_initial_layer"),
    ("material.bed_degc", "bed_temperature", "hot_plate_temp"),
    ("material.first_bed_degc", "first_layer_bed_temperature", "hot_plate_temp_initial_layer"),
    ("speed.print_mm_s", "infill_speed", "sparse_infill_speed"), ("speed.travel_mm_s", "travel_speed", "travel_speed"),
]
PLACEHOLDERS = {"first_layer_temperature": "first_nozzle_degc", "temperature": "nozzle_degc", "first_layer_bed_temperature": "first_bed_degc",
          "bed_temperature": "bed_degc", "nozzle_temperature_initial_layer": "first_nozzle_degc",
          "bed_temperature_initial_layer_single": "first_bed_degc"}


def sections(path):
    found, current = {}, None
    with open(path, encoding="utf-8") as file:
        for line in file:
            line = line.strip()
            if head := re.fullmatch(r"\[(.+)\]", line):
                current = found.setdefault(head[1], {})
            elif current is not None and line and line[0] not in "#;":
                key, _, value = line.partition("=")
                current[key.strip()] = value.strip()
    return found


def resolved(all_sections, kind, name):
    section, settings = all_sections[f"{kind}:{name}"], {}
    for base in filter(None, (base.strip() for base in section.get("inherits", "").split(";"))):
        settings |= resolved(all_sections, kind, base)
    return settings | {key: value for key, value in section.items() if key != "inherits"}


def bundle(path, printer):
    every = sections(path)
    own = resolved(every, "printer", printer)
    settings = {}
    for kind, key in (("print", "default_print_profile"), ("filament", "default_filament_profile")):
        name = own.get(key, "")
        name = name.split('"')[1] if name.startswith('"') else name.split(";")[0].strip()
        if f"{kind}:{name}" in every:
            settings |= resolved(every, kind, name)
    return settings | own


def preset(path, follows=True):
    with open(path, encoding="utf-8") as file:
        own = json.load(file)
    files = {os.path.basename(name)[:-5]: name for name in glob.glob(os.path.join(ROOT, "tests/corpus/orca/*/*.json"))}
    base = preset(files[own["inherits"]], False) if "inherits" in own else {}
    settings = base | own
    if not follows or own["type"] != "machine":
        return settings
    process = preset(files[settings["default_print_profile"]], False)
    filament = preset(files[settings["default_filament_profile"][0]], False)
    return process | filament | settings


def first(value):
    return float(value[0] if isinstance(value, list) else value.split(",")[0])


def bed(value):
    points = [tuple(map(float, point.split("x"))) for point in (value if isinstance(value, list) else value.split(","))]
    low, high = [min(axis) for axis in zip(*points)], [max(axis) for axis in zip(*points)]
    return low, [b - a for a, b in zip(low, high)], {p for p in points} <= {(x, y) for x in (low[0], high[0]) for y in (low[1], high[1])}


def code_line(line):
    """A line of code with lamina's placeholders, or None if it has anything but plain temperatures."""
    def placeholder(found):
        name = re.sub(r"\[\w+\]$", "", found[1])
        return "{" + PLACEHOLDERS[name] + "}" if name in PLACEHOLDERS else "?"
    line = re.sub(r"[\[{]\s*(\w+(?:\[\w+\])?)\s*[\]}]", placeholder, line)
    return None if re.search(r"\?|\[|\{(?!first_|nozzle_|bed_)", line) else line


def compare(settings, profile, replaced, orca):
    wrong, checked = [], 0
    corner, size, rectangle = bed(settings["printable_area" if orca else "bed_shape"])
    got = profile["bed"]
    if rectangle and (got["size_mm"] != size or got["corner_mm"] != corner):
        wrong.append(f"bed {got['size_mm']} {got['corner_mm']}")
    if not rectangle and not all(0.6 * full < part < full for part, full in zip(got["size_mm"], size)):
        wrong.append(f"bed {got['size_mm']} of {size}")
    checked += 2
    for key, prusa, orca_key in NUMBERS:
        section, name = key.split(".")
        value = settings.get(orca_key if orca else prusa)
        if not value or first(value) == 0:
            continue
        checked += 1
        if abs(profile[section].get(name, 0) - first(value)) > 1e-9:
            wrong.append(f"{key} {profile[section].get(name)} for {value}")
    for mine, theirs in (("start", "start_gcode"), ("end", "end_gcode")):
        text = settings.get(("machine_" if orca else "") + theirs, "")
        text = text if orca else text.strip('"').replace("\\n", "\n").replace('\\"', '"')
        if mine in replaced:
            continue
        lines = profile["code"][mine].split("\n")
        for line in text.split("\n"):
            expected = code_line(line)
            if expected is None:
                continue
            checked += 1
            if expected not in lines:
                wrong.append(f"{theirs}: no line '{expected}'")
    return wrong, checked


def imported(lamina, words):
    """The profile, which of its code was replaced, and how many settings were not used."""
    for more in ([], ["--plain-code"]):
        run = subprocess.run([lamina, "machines", "--import", *words, *more], capture_output=True, text=True, check=False)
        if run.returncode == 0:
            unused = int(re.search(r": (\d+) settings were not used", run.stderr)[1])
            replaced = [found[1] for found in re.finditer(r"(start|end|layer)_gcode: is (?:left out|replaced)", run.stderr)]
            return tomllib.loads(run.stdout), replaced, unused
        if "--plain-code" not in run.stderr:
            break
    sys.exit(f"{words}: {run.stderr}")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--profiles", default="/usr/share/PrusaSlicer/profiles")
    parser.add_argument("--lamina", default=os.path.join(ROOT, "build/release/lamina"))
    parser.add_argument("--dry-run", action="store_true", help="do not write bench/imports.md")
    arguments = parser.parse_args()
    jobs = [(file, name, bundle(os.path.join(arguments.profiles, file), name), [os.path.join(arguments.profiles, file), "--printer", name], False)
            for file, name in PRINTERS if os.path.isdir(arguments.profiles)]
    for path in sorted(glob.glob(os.path.join(ROOT, "tests/corpus/orca/machine/Acme*.json"))):
        jobs.append(("orca/" + os.path.basename(path), "", preset(path), [path], True))
    rows, failures = [], 0
    for file, name, settings, words, orca in jobs:
        profile, replaced, unused = imported(arguments.lamina, words)
        wrong, checked = compare(settings, profile, replaced, orca)
        failures += len(wrong)
        for what in wrong:
            print(f"{file} {name}: {what}", file=sys.stderr)
        size = " x ".join(f"{value:g}" for value in profile["bed"]["size_mm"] + [profile["bed"]["build_height_mm"]])
        m = profile["material"]
        rows.append(f"| {file} | {name} | {size} | {m['nozzle_mm']:g} | {m['first_nozzle_degc']:g} / {m['first_bed_degc']:g} | "
                    f"{'conditions in ' + ', '.join(replaced) if replaced else 'translated'} | {checked} | {len(wrong)} | {unused} |")
    text = ("# Imported profiles\n\n`bench/imports.py` compares bed, nozzle, filament, temperatures, speeds and lines of code with a reader of its own.\n"
            "Bundles: prusa-slicer 2.5.0+dfsg-4 of Debian.\n\n| file | printer | bed, height in mm | nozzle in mm | first layer in degC | code | "
            "values compared | different | settings not used |\n|---|---|---|---|---|---|---|---|---|\n" + "\n".join(rows) + "\n")
    print(text)
    if not arguments.dry_run:
        with open(os.path.join(ROOT, "bench/imports.md"), "w", encoding="utf-8") as page:
            page.write(text)
    return 1 if failures or not jobs else 0


if __name__ == "__main__":
    sys.exit(main())

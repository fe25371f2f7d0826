#!/usr/bin/env python3
"""bench/beads.py: forms of the bead model compared with measurements of Di Nisio 2022. scripts/bench beads

    scripts/bench beads     writes bench/beads.md; five minutes

The form that lamina has (docs/theory/bead.md) and others that were tried, computed here in steps of 0.005 mm, independently of stages/bead.
Each takes its lag from the distances of Table 11 alone; no width is read for any number.
"""
import csv
import math
import os

import figures
from tables import table

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
HEIGHT, REFERENCE, STEP, CELL = 0.3, 15.0, 0.005, 0.02
AREA = math.pi / 4 * HEIGHT ** 2 + (0.4 - HEIGHT) * HEIGHT  # a stadium of 0.4 mm: 100 %
FULL = math.pi / 4 * HEIGHT ** 2
AT_ONCE = math.inf


class Form:
    """order: lags in series; index: tau ~ (flow / flow at 15 mm/s)^(index - 1), of a melt whose pressure ~ flow^index;
    jump: mm/s by which both sides of a joint may be faster than the slower stretch; spread: see spread()."""

    def __init__(self, name, acceleration, order=1, index=1.0, jump=0.0, spread=""):
        self.name, self.acceleration, self.order, self.index = name, acceleration, order, index
        self.jump, self.spread, self.tau = jump, spread, 0.05


def rows_of(number):
    with open(os.path.join(ROOT, f"tests/reference/dinisio2022/table_{number}.tsv"), encoding="utf-8") as file:
        return list(csv.DictReader((line for line in file if not line.startswith("#")), delimiter="\t"))


def width_of(area, pressed):
    if area >= FULL:
        return HEIGHT + (area - FULL) / HEIGHT
    return 4 * area / (math.pi * HEIGHT) if pressed else math.sqrt(max(area, 0) * 4 / math.pi)


def phases(form, intervals, begin, end):
    """(length, area, speed, acceleration) of what the head does: a planner joins stretches at the slower of their speeds."""
    stitches = [begin] + [min(a[2], b[2]) for a, b in zip(intervals, intervals[1:])] + [end]
    if form.acceleration == AT_ONCE:
        return [(length, area, speed, 0.0) for length, area, speed in intervals]
    for i in range(len(intervals) - 1, -1, -1):
        stitches[i] = min(stitches[i], math.sqrt(stitches[i + 1] ** 2 + 2 * form.acceleration * intervals[i][0]))
    found = []
    for i, (length, area, speed) in enumerate(intervals):
        stitches[i + 1] = min(stitches[i + 1], math.sqrt(stitches[i] ** 2 + 2 * form.acceleration * length))
        first, last = (min(speed, joint + form.jump) for joint in (stitches[i], stitches[i + 1]))
        peak = max(first, last, min(speed, math.sqrt((first ** 2 + last ** 2) / 2 + form.acceleration * length)))
        up, down = ((peak ** 2 - v ** 2) / (2 * form.acceleration) for v in (first, last))
        for part, at, change in ((up, first, form.acceleration), (length - up - down, peak, 0.0), (down, peak, -form.acceleration)):
            if part > 1e-9:
                found.append((part, area, at, change))
    return found


def deposit(form, parts, flow):
    """(place, length, area, pressed) of short pieces."""
    position, first, pressed, pieces = 0.0, flow, True, []
    for length, area, speed, change in parts:
        count = max(1, math.ceil(length / STEP))
        for i in range(count):
            a, b = (math.sqrt(max(speed ** 2 + 2 * change * length * j / count, 1e-6)) for j in (i, i + 1))
            time, feed = 2 * length / count / (a + b), area * (a + b) / 2
            tau = form.tau * (max(flow, 1e-3) / (AREA * REFERENCE)) ** (form.index - 1)
            fade = math.exp(-time / tau)
            if form.order == 2:
                before, first = first, feed + (first - feed) * fade
                flow = (before + first) / 2 + (flow - (before + first) / 2) * fade
            else:
                flow = feed + (flow - feed) * fade
            deposited = flow / b
            pressed = deposited >= FULL or (pressed and area >= FULL)
            pieces.append((position + length * (i + 1) / count, length / count, deposited, pressed))
        position += length
    return pieces


def share(kind, u):
    """The fraction of the material deposited around a position that is below u, in bead widths (bore, behind: in radii of the bore)."""
    if kind == "finger":  # what would lie further behind than a bead's width, 1.4 %, lies nearer
        return 0.0 if u <= -1 else 1 - math.acos(min(math.exp(math.pi * u) / 2, 1)) / math.acos(math.exp(-math.pi) / 2)
    if kind == "behind":
        return min(max(u + 1, 0.0), 1.0)
    u = min(max(2 * u if kind == "disc" else u, -1.0), 1.0)
    return 0.5 + (u * math.sqrt(1 - u * u) + math.asin(u)) / math.pi


def spread(form, pieces):
    """(place, width) along the line."""
    if not form.spread:
        return [(position, width_of(area, pressed)) for position, _, area, pressed in pieces]
    volume, held = {}, {}
    for position, length, area, pressed in pieces:
        reach = 0.2 if form.spread in ("bore", "behind") else width_of(area, pressed)
        left, cell = 0.0, math.floor((position - length / 2 - 1.01 * reach) / CELL)
        while left < 1:
            right = share(form.spread, ((cell + 1) * CELL - position + length / 2) / reach)
            right = 1.0 if right > 1 - 1e-9 else right
            volume[cell] = volume.get(cell, 0) + (right - left) * area * length
            held[cell] = held.get(cell, 0) + (right - left) * area * length * pressed
            left, cell = right, cell + 1
    found = []
    for cell in sorted(volume):
        part = held[cell] / volume[cell] if volume[cell] > 0 else 1
        area = volume[cell] / CELL
        found.append(((cell + 0.5) * CELL, part * width_of(area, True) + (1 - part) * width_of(area, False)))
    return found


def at(widths, position):
    low, high = 0, len(widths) - 1
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if widths[middle][0] <= position else (low, middle)
    (a, wa), (b, wb) = widths[low], widths[high]
    return wa + (wb - wa) * (position - a) / (b - a)


def rms(errors):
    return math.sqrt(sum(error * error for error in errors) / len(errors))


def take_lag(form):
    """The median of the twelve rows; how far those from 175 % on scatter about it."""
    taus = []
    for row in rows_of(11):
        speed, distance = float(row["thin_speed_mm_s"]), float(row["stabilisation_distance_mm"])
        low, high = 0.001, 0.5
        for _ in range(16):
            form.tau = (low + high) / 2
            area = next(piece[2] for piece in deposit(form, phases(form, [(10.0, AREA, REFERENCE), (30.0, AREA, speed)], REFERENCE, speed),
                                                  AREA * REFERENCE) if piece[0] >= 10 + distance)
            low, high = (low, form.tau) if width_of(area, True) < 0.4 - 0.01 else (form.tau, high)
        taus.append((low + high) / 2)
    form.tau = sum(sorted(taus)[5:7]) / 2
    return rms([math.log(tau / form.tau) for tau in taus[2:]])


def long_line(form, thin_area, speed):
    intervals = [(10.0, AREA, REFERENCE), (30.0, thin_area, speed), (10.0, AREA, REFERENCE)]
    widths = [w for position, w in spread(form, deposit(form, phases(form, intervals, REFERENCE, REFERENCE), AREA * REFERENCE)) if 5 < position < 45]
    return min(widths), max(widths)


def repeated(form, extrusion, speed):
    area = AREA * extrusion / 100
    return spread(form, deposit(form, phases(form, [(1.5, area, speed), (1.5, area, 30.0)] * 8, speed, speed), area * REFERENCE))


def samples():
    for number, speed in ((13, 15.0), (14, 11.25), (15, 7.5)):
        found = {}
        for row in rows_of(number):
            found.setdefault(row["sample"], []).append((float(row["thick_mm"]), float(row["thin_mm"])))
        for name, widths in found.items():
            yield float(name[1:]), speed, sum(w[0] for w in widths) / 3, sum(w[1] for w in widths) / 3


def pore(form, extrusion, speed, spacing):
    widths = repeated(form, extrusion, speed)
    gap = [spacing - (at(widths, 17.25 + 0.01 * i) + 0.4) / 2 for i in range(-150, 151)]
    half = gap[150] / 2
    ends = [next((i for i in range(150) if gap[150 + sign * i] < half), 150) for sign in (-1, 1)]
    return f"{gap[150]:.3f} x {0.01 * sum(ends):.2f}"


def row_of(form):
    scatter = take_lag(form)
    thin, thick = [], []
    for row in rows_of(11):
        found = long_line(form, AREA, float(row["thin_speed_mm_s"]))
        thin.append(found[0] - float(row["thin_width_min_mm"]))
        thick.append(found[1] - float(row["thick_width_max_mm"]))
    threads = [long_line(form, AREA * float(row["thin_extrusion_percent"]) / 100, REFERENCE)[0] - float(row["thin_width_min_mm"])
               for row in rows_of(12)]
    mean, middle = [], []
    for extrusion, speed, wide, narrow in samples():
        widths = repeated(form, extrusion, speed)
        for begin, measured in ((15.0, wide), (16.5, narrow)):
            mean.append(sum(at(widths, begin + 0.01 * (i + 0.5)) for i in range(150)) / 150 - measured)
            middle.append(at(widths, begin + 0.75) - measured)
    return [form.name, f"{form.tau:.3f}", f"{100 * scatter:.0f} %", *(f"{rms(errors):.3f}" for errors in (thin, thick, threads, mean, middle)),
            *(pore(form, *sample) for sample in ((75, 15.0, 0.40), (100, 11.25, 0.43), (125, 7.5, 0.49)))]


FORMS = (Form("**500 mm/s2, spread as a finger: lamina's**", 500, spread="finger"),
         Form("500 mm/s2", 500), Form("400 mm/s2", 400), Form("400 mm/s2, finger", 400, spread="finger"),
         Form("1000 mm/s2, finger", 1000, spread="finger"), Form("speed at once", AT_ONCE), Form("at once, finger", AT_ONCE, spread="finger"),
         Form("500 mm/s2, disc of the bead's width", 500, spread="disc"), Form("500 mm/s2, disc of the bore, 0.4 mm", 500, spread="bore"),
         Form("500 mm/s2, evenly over 0.2 mm behind the nozzle", 500, spread="behind"),
         Form("500 mm/s2, finger, two equal lags in series", 500, order=2, spread="finger"),
         Form("500 mm/s2, finger, melt of power law 0.69", 500, index=0.69, spread="finger"),
         Form("500 mm/s2, finger, melt of power law 0.32", 500, index=0.32, spread="finger"),
         Form("500 mm/s2, finger, joints jump by 10 mm/s", 500, jump=10, spread="finger"))


def page():
    yield "# Forms of the bead model, compared with measurements"
    yield ""
    yield (f"`scripts/bench beads` at commit {figures.commit(ROOT)}: the forms computed by steps of 0.005 mm, apart from lamina's code. Root mean square of widths in mm "
           "against Di Nisio 2022; 100 % is 0.1007 mm2. Each form takes its lag from the stabilisation distances of Table 11; rows: how far "
           "those from 175 % on scatter about it. Pores: width x length in mm, of Table 16 0.10 x 0.86, 0.12 x 0.91, 0.14 x 0.98.")
    yield ""
    yield from table(["form", "lag, s", "rows", "Table 11, thin", "thick", "Table 12", "Tables 13 to 15, mean", "middle", "B75", "B100", "B125"],
                     [row_of(form) for form in FORMS])
    yield ("Accelerations: 500 mm/s2 is the maker's for this printer in Cura (anet3d.def.json), 400 that of Marlin's example, 1000 the default "
           "of Repetier. Planners join stretches of one direction at the slower of their speeds (Marlin, Repetier), so no joint jumps; the "
           "last row is what it would be. A melt whose pressure grows as flow^n lags the longer the slower it flows; 0.69 and 0.32 are "
           "published for PLA (Materials 2023, 16, 7664, Table 1). With either, rows of Table 11 disagree more about the lag than without.")


def main(_):
    with open(os.path.join(ROOT, "bench/beads.md"), "w", encoding="utf-8") as file:
        file.write("\n".join(page()) + "\n")
    print("wrote bench/beads.md")

#!/usr/bin/env python3
"""bench/jet.py: whole jobs, mesh on disk to layer files on disk, in turn with Debian's PrusaSlicer 2.5. scripts/bench jet

    scripts/bench                 all jobs but the largest (an hour on two slow cores, nearly all of it PrusaSlicer's)
    scripts/bench --large         and 72 Benchies in one STL of 811 MB
    scripts/bench --case NAME     this one only (can be repeated); --runs N turns (default 3); --alone without PrusaSlicer
    scripts/bench --mslicer PROGRAM    and mslicer's command line in alternating runs, its pixels compared with ours (bench/mslicer.py)
    scripts/bench --memory        the runs that measure memory only
    scripts/bench --report        only writes bench/README.md again from bench/results/*.json

Before any number is kept, the answers are checked: both engines and all runs give the same manifest (with the hash of
every layer), PrusaSlicer gives the same number and size of images, and differing pixels are counted.
Options: --models DIR (default: LAMINA_MODELS, else ../shared/models), --cache DIR (default: build/bench).
"""
import argparse
import hashlib
import json
import os
import shutil
import statistics
import subprocess
import sys
import time

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(ROOT, "bench"))
import figures  # noqa: E402
import mslicer  # noqa: E402
import prusa  # noqa: E402
from measure import build, measured, median_of, models_default, say  # noqa: E402

# name, part, copies, side of the bed (mm), layer (mm), how many times as fast as PrusaSlicer we mean to be
CASES = {
    "terrain": ("terrain.stl", 1, 100, 0.1, 50),
    "benchy": ("benchy15.stl", 1, 100, 0.1, 110),
    "crowns-20": ("crowns96.stl", 1, 400, 0.48, 52),
    "crowns-96": ("crowns96.stl", 1, 400, 0.1, 85),
    "copies-20": ("crown.stl", 96, 400, 0.48, 52),
    "copies-96": ("crown.stl", 96, 400, 0.1, 85),
    "benchies": ("benchies72.stl", 1, 400, 0.1, 38),
}
LARGE = {"benchies"}
DPI = 1200
PEER_OF = {"copies-20": "crowns-20", "copies-96": "crowns-96"}  # PrusaSlicer plans the same plate as one mesh


def last_object(log):
    """The JSON object that `lamina --json` prints."""
    with open(log, errors="replace", encoding="utf-8") as file:
        text = file.read()
    return json.loads(text[text.index("{"):text.rindex("}") + 1])


def file_digest(path):
    with open(path, "rb") as file:
        return hashlib.sha256(file.read()).hexdigest()


class Bench:
    def __init__(self, options):
        self.options = options
        self.cache = os.path.abspath(options.cache)
        self.parts_folder = os.path.join(self.cache, "parts")
        self.work = os.path.join(self.cache, "work")
        os.makedirs(self.work, exist_ok=True)
        with open(os.path.join(self.parts_folder, "parts.json"), encoding="utf-8") as file:
            self.parts = json.load(file)
        self.lamina = os.path.join(ROOT, "build/release/lamina")

    def job(self, case, engine, file_format, extra=()):
        """The command line of one of our runs, and its output directory, which is empty when it starts."""
        part, copies, bed, layer, _ = CASES[case]
        out = os.path.join(self.work, f"{case}-{engine}-{file_format}")
        shutil.rmtree(out, ignore_errors=True)
        command = [self.lamina, "jet", os.path.join(self.parts_folder, part), "--bed", f"{bed}x{bed}", "--dpi", str(DPI),
                   "--layer", str(layer), "--engine", engine, "--format", file_format, "--json", "--quiet", "-o", out]
        if copies > 1:
            command += ["--copies", str(copies)]
        else:
            command += ["--at", ",".join(f"{nm / 1e6:.6f}" for nm in self.parts[part]["at_nm"])]
        return command + list(extra), out

    def peer(self, case):
        """The command line of PrusaSlicer's run, and its archive. It plans copies as the one mesh that they make."""
        part, _, bed, layer, _ = CASES[PEER_OF.get(case, case)]
        settings = os.path.join(self.work, f"{case}.ini")
        prusa.write_settings(settings, bed, DPI, layer)
        archive = os.path.join(self.work, f"{case}.sl1")
        if os.path.exists(archive):
            os.remove(archive)
        return prusa.command(settings, os.path.join(self.parts_folder, part), archive), archive

    def other_peer(self, case):
        """The command line of mslicer's run, and its file."""
        part, _, bed, layer, _ = CASES[case]
        path, goo = os.path.join(self.parts_folder, part), os.path.join(self.work, f"{case}.goo")
        if os.path.exists(goo):
            os.remove(goo)
        side = -(-bed * DPI * 5 // 127)
        return mslicer.command(self.options.mslicer, path, goo, [side * 25.4 / DPI] * 2, [side] * 2, layer, mslicer.box_of(path)), goo

    def run_case(self, case):
        part, copies, bed, layer, target = CASES[case]
        side = -(-bed * DPI * 5 // 127)  # ceil(bed * dpi / 25.4)
        say(f"bench: {case}: {part}{' x ' + str(copies) if copies > 1 else ''}, {bed} mm at {DPI} dpi, {layer} mm")
        with open(os.path.join(self.parts_folder, part), "rb") as file:  # into the page cache, for both
            while file.read(1 << 22):
                pass
        variants = [("rays", "tiff-g4"), ("contours", "tiff-g4"), ("rays", "null"), ("contours", "null")]
        runs = {variant: [] for variant in variants}
        peer_runs, archive, summary, digest, out_g4 = [], None, {}, None, None
        peer_turns = 0 if self.options.alone else 1 if case in LARGE else self.options.runs
        other_runs, goo = [], None
        other_command = self.other_peer(case) if self.options.mslicer and copies == 1 else None
        for turn in range(self.options.runs):
            if other_command:
                command, goo = other_command
                other_runs.append(measured(command, os.path.join(self.work, "mslicer.log")))
                say(f"  mslicer           {other_runs[-1]['wall']:8.3f} s {other_runs[-1]['peak_mib']:7.0f} MiB")
            if turn < peer_turns:
                command, archive = self.peer(case)
                peer_runs.append(measured(command, os.path.join(self.work, "prusa.log")))
                say(f"  PrusaSlicer       {peer_runs[-1]['wall']:8.3f} s {peer_runs[-1]['peak_mib']:7.0f} MiB")
            for variant in variants:
                for _ in range(self.options.repeat):
                    command, out = self.job(case, *variant)
                    log = os.path.join(self.work, "lamina.log")
                    runs[variant].append(measured(command, log))
                    summary["-".join(variant)] = last_object(log)
                    if variant[1] != "null":
                        found = file_digest(os.path.join(out, "manifest.json"))
                        if digest not in (None, found):
                            sys.exit(f"bench: {case}: {out} is not what an earlier run gave; see scripts/compare")
                        digest, out_g4 = found, out
                say(f"  {' '.join(variant):17} {runs[variant][-1]['wall']:8.3f} s {runs[variant][-1]['peak_mib']:7.0f} MiB")

        layers = len(os.listdir(os.path.join(out_g4, "layers")))
        result = {"case": case, "part": part, "copies": copies, "bed_mm": bed, "dpi": DPI, "layer_mm": layer,
                  "target": target, "triangles": self.parts[part]["triangles"] * copies, "layers": layers,
                  "columns": side, "rows": side, "machine": figures.machine(self.cache), "commit": figures.commit(ROOT),
                  "date": time.strftime("%Y-%m-%d"), "manifest_sha256": digest,
                  "lamina": {"-".join(variant): median_of(runs[variant]) for variant in variants}, "summary": summary}
        if peer_runs:
            result["prusa"] = median_of(peer_runs)
            result["prusa"]["version"] = prusa.version()
            result["prusa"].update(self.check_peer(case, archive, layers, side))
        if other_runs:
            result["mslicer"] = dict(median_of(other_runs), version=mslicer.version(self.options.mslicer),
                                     **self.check_other_peer(case, goo, layers))
        result["limit"] = self.limit(case)
        figures.save(ROOT, case, result)

    def check_peer(self, case, archive, layers, side):
        """Number and size of PrusaSlicer's images, and pixels that differ from ours in five layers."""
        images = prusa.image_names(archive)
        size = prusa.image_size(archive, images[0])
        if size != (side, side):
            sys.exit(f"bench: {case}: PrusaSlicer's images are {size}, ours {side} x {side}")
        if abs(len(images) - layers) > 1:
            sys.exit(f"bench: {case}: PrusaSlicer has {len(images)} layers, ours {layers}")
        found = {"layers": len(images), "images_compared": 0, "pixels_different": 0, "pixels_different_max": 0}
        if CASES[case][1] > 1:  # our copies stand elsewhere than the one mesh's
            return found
        different = [prusa.different_pixels(archive, images[index], pbm)
                     for index, pbm in self.some_layers(case, min(layers, len(images)))]
        found.update(images_compared=len(different), pixels_different=sum(different), pixels_different_max=max(different))
        say(f"  {found['pixels_different']} pixels of {found['images_compared']} layers differ from PrusaSlicer's")
        return found

    def some_layers(self, case, layers):
        """Number and PBM file of five of our layers, one after the other."""
        for index in sorted({0, layers // 4, layers // 2, 3 * layers // 4, layers - 1}):
            command, out = self.job(case, "rays", "pbm", ["--layers", f"{index}:{index + 1}"])
            measured(command, os.path.join(self.work, "pbm.log"))
            yield index, os.path.join(out, "layers", os.listdir(os.path.join(out, "layers"))[0])
            shutil.rmtree(out)

    def check_other_peer(self, case, path, layers):
        """Number and size of mslicer's images, and pixels that differ from ours in five layers."""
        goo = mslicer.Goo(path)
        if abs(goo.layers - layers) > 1:
            sys.exit(f"bench: {case}: mslicer has {goo.layers} layers, ours {layers}")
        different = [mslicer.different_pixels(goo, index, pbm) for index, pbm in self.some_layers(case, min(layers, goo.layers))]
        say(f"  {sum(different)} pixels of {len(different)} layers differ from mslicer's")
        return {"layers": goo.layers, "images_compared": len(different), "pixels_different": sum(different),
                "pixels_different_max": max(different)}

    def limit(self, case):
        """Seconds that no program can be faster than, as --timing has them: the median of five runs."""
        seconds = []
        for _ in range(5):
            command, _ = self.job(case, "rays", "tiff-g4", ["--timing"])
            done = subprocess.run(command, check=True, stdout=subprocess.PIPE)
            seconds.append(json.loads(done.stdout)["timing"]["limit"]["seconds"])
        return statistics.median(seconds)

    def memory(self):
        """Peak resident memory: 100 layers against 10,000 of one part, and a large bed with a small budget."""
        result = {"machine": figures.machine(self.cache), "commit": figures.commit(ROOT), "date": time.strftime("%Y-%m-%d"),
                  "layers": [], "budget": []}
        for layer in (0.24, 0.0024):
            peaks = []
            for turn in range(3):
                out = os.path.join(self.work, "memory")
                shutil.rmtree(out, ignore_errors=True)
                command = [self.lamina, "jet", os.path.join(self.parts_folder, "gyroid.stl"), "--bed", "30x30", "--dpi",
                           "600", "--layer", str(layer), "--json", "--quiet", "-o", out]
                run = measured(command, os.path.join(self.work, "memory.log"))
                peaks.append(run["peak_mib"])
                count = len(os.listdir(os.path.join(out, "layers")))
            result["layers"].append({"layer_mm": layer, "layers": count, "peak_mib": statistics.median(peaks),
                                     "wall": run["wall"]})
            say(f"  {count} layers: {statistics.median(peaks):.1f} MiB, {run['wall']:.2f} s")
            shutil.rmtree(out, ignore_errors=True)
        for case, budget in (("crowns-96", "1G"), ("crowns-96", "256M"), ("crowns-96", "1M")):
            command, out = self.job(case, "rays", "tiff-g4", ["--memory", budget])
            log = os.path.join(self.work, "memory.log")
            run = measured(command, log)
            summary = last_object(log)
            result["budget"].append({"case": case, "memory": budget, "peak_mib": run["peak_mib"], "wall": run["wall"],
                                     "manifest_sha256": file_digest(os.path.join(out, "manifest.json")),
                                     "summary": summary})
            say(f"  {case} --memory {budget}: {run['peak_mib']:.1f} MiB, {run['wall']:.2f} s")
            shutil.rmtree(out, ignore_errors=True)
        if len({entry["manifest_sha256"] for entry in result["budget"]}) != 1:
            sys.exit("bench: --memory changed the bytes of a job")
        figures.save(ROOT, "memory", result)


def main(arguments):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--large", action="store_true")
    parser.add_argument("--case", action="append", choices=sorted(CASES))
    parser.add_argument("--runs", type=int, default=3, help="turns: PrusaSlicer, ours, PrusaSlicer, ours, ...")
    parser.add_argument("--repeat", type=int, default=3, help="runs of ours a turn")
    parser.add_argument("--alone", action="store_true", help="without PrusaSlicer")
    parser.add_argument("--mslicer", metavar="PROGRAM")
    parser.add_argument("--memory", action="store_true")
    parser.add_argument("--report", action="store_true")
    parser.add_argument("--models", default=models_default())
    parser.add_argument("--cache", default=os.path.join(ROOT, "build/bench"))
    options = parser.parse_args(arguments)
    if options.report:
        figures.write_readme(ROOT, CASES)
        return
    if not os.path.isdir(options.models):
        sys.exit(f"bench: {options.models}: no such folder; name the folder of real parts with --models")
    build("lamina", "lamina_bench")
    cases = options.case or [case for case in CASES if options.large or case not in LARGE]
    make = [sys.executable, os.path.join(ROOT, "bench/make_parts.py"), options.models,
            os.path.join(os.path.abspath(options.cache), "parts")]
    subprocess.run(make + (["--large"] if LARGE & set(cases) else []), check=True)
    bench = Bench(options)
    if not options.memory:
        for case in cases:
            bench.run_case(case)
    if options.memory or not options.case:
        bench.memory()
    shutil.rmtree(bench.work)
    figures.write_readme(ROOT, CASES)


if __name__ == "__main__":
    main(sys.argv[1:])

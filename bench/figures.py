"""bench/figures.py: results of scripts/bench as JSON files and as bench/README.md. A number without its commit is not printed."""
import json
import os
import platform
import re
import subprocess

import growth_page
from tables import seconds, table


def commit(root):
    """Short name of the commit, with + where sources differ from it."""
    name = subprocess.run(["git", "-C", root, "rev-parse", "--short=10", "HEAD"], check=True, text=True,
                          stdout=subprocess.PIPE).stdout.strip()
    changed = subprocess.run(["git", "-C", root, "status", "--porcelain", "--", "stages", "pipeline", "cmake",
                              "CMakeLists.txt"], check=True, text=True, stdout=subprocess.PIPE).stdout
    return name + ("+" if changed.strip() else "")


def machine(cache):
    """What ran it; `cache` is the folder of parts and outputs, whose file system writing depends on."""
    def first(path, pattern):
        try:
            with open(path, encoding="utf-8") as file:
                return re.search(pattern, file.read())[1].strip()
        except (OSError, TypeError):
            return "?"

    memory = first("/proc/meminfo", r"MemTotal:\s+(\d+)")
    return {"processor": first("/proc/cpuinfo", r"model name\s*:\s*(.*)"), "cores": len(os.sched_getaffinity(0)),
            "memory_gib": round(int(memory) / 2**20, 1) if memory != "?" else 0,
            "system": first("/etc/os-release", r'PRETTY_NAME="(.*)"'), "kernel": platform.release().split("-")[0],
            "files_on": subprocess.run(["stat", "--file-system", "--format=%T", cache], text=True,
                                       stdout=subprocess.PIPE).stdout.strip(),
            "compiler": subprocess.run(["g++", "-dumpfullversion"], text=True, stdout=subprocess.PIPE).stdout.strip()}


def folder(root):
    return os.path.join(root, "bench", "results")


def save(root, name, result):
    os.makedirs(folder(root), exist_ok=True)
    with open(os.path.join(folder(root), name + ".json"), "w", encoding="utf-8") as file:
        text = json.dumps(result, indent=1, sort_keys=True)
        file.write(text.replace(os.path.abspath(root) + os.sep, "") + "\n")  # paths as in any clone


def load(root, name):
    try:
        with open(os.path.join(folder(root), name + ".json"), encoding="utf-8") as file:
            return json.load(file)
    except FileNotFoundError:
        return None


def spread(entry):
    return f"{seconds(entry['wall'])} s ({seconds(entry['fastest'])} to {seconds(entry['slowest'])})"


DESCRIPTION = {
    "terrain": "Mount St. Helens as a closed terrain, 645,364 triangles",
    "benchy": "3DBenchy at 1.5 times its size, 225,154 triangles",
    "crowns-20": "96 dental crowns as one mesh of 372,288 triangles",
    "crowns-96": "the same, thinner layers",
    "copies-20": "one crown of 3,878 triangles, `--copies 96`",
    "copies-96": "the same, thinner layers",
    "benchies": "72 Benchies as one mesh of 16.2 million triangles (811 MB)",
}


def times_the_limit(result, wall):
    """A multiple of the limit of --timing at the same commit, or - without one."""
    limit = result.get("limit")
    return f"{wall / limit:.1f}" if limit else "-"


def time_rows(results):
    for name, result in results:
        rays, contours = result["lamina"]["rays-tiff-g4"], result["lamina"]["contours-tiff-g4"]
        peer = result.get("prusa")
        pixels = result["layers"] * result["columns"] * result["rows"]
        yield [f"`{name}`: {DESCRIPTION[name]}", f"{result['layers']} of {result['columns']} x {result['rows']}",
               spread(peer) if peer else "-", spread(rays), f"{peer['wall'] / rays['wall']:.1f}" if peer else "-",
               spread(contours), f"{peer['wall'] / contours['wall']:.1f}" if peer else "-", str(result["target"]),
               times_the_limit(result, rays["wall"]), times_the_limit(result, contours["wall"]),
               f"{pixels / rays['wall'] / 1e9:.1f}"]


def memory_rows(results):
    for name, result in results:
        rays, peer = result["lamina"]["rays-tiff-g4"], result.get("prusa")
        yield [f"`{name}`", f"{peer['peak_mib']:.0f} MiB" if peer else "-", f"{rays['peak_mib']:.0f} MiB",
               f"{rays['peak_mib'] / peer['peak_mib']:.2f}" if peer else "-",
               f"{seconds(peer['processor'])} s" if peer else "-",
               *(f"{seconds(result['lamina'][key]['processor'])} s" for key in ("rays-tiff-g4", "contours-tiff-g4")),
               f"{peer['processor'] / rays['processor']:.1f}" if peer else "-"]


# Steps of layers in summaries, and as those until 2026-11-21 name them.
STEPS = (("raster", "raster_threads"), ("encode", "encode_threads"), ("store", "write_threads"))


def stage_rows(results):
    for name, result in results:
        for variant in ("rays-tiff-g4", "rays-null", "contours-tiff-g4", "contours-null"):
            part = result["summary"].get(variant, {}).get("seconds", {})
            if not part:
                continue
            yield [f"`{name}`", variant.replace("-", ", ", 1), seconds(result["lamina"][variant]["wall"])] + [
                f"{1000 * value:.0f}" for value in [part.get(key, 0) for key in ("load", "index", "layers")] +
                [part.get("threads", {}).get(step, part.get(older, 0)) for step, older in STEPS]]


def limit_rows(results):
    for name, result in results:
        if limit := result.get("limit"):
            yield [f"`{name}`", f"{1e3 * limit:.1f} ms", seconds(result["lamina"]["rays-tiff-g4"]["wall"]) + " s"]


def mslicer_text(root, results):
    """mslicer compared with ours, where it was run: wrong pixels next to the time."""
    rows = []
    for name, result in results:
        if "mslicer" not in result:
            continue
        peer, ours = result["mslicer"], result["lamina"]["rays-tiff-g4"]
        rows.append([f"`{name}`", spread(peer), f"{seconds(peer['processor'])} s", times_the_limit(result, peer["wall"]),
                     f"{peer['peak_mib']:.0f} MiB", f"{peer['pixels_different']} of {peer['images_compared']} layers", spread(ours),
                     f"{seconds(ours['processor'])} s", times_the_limit(result, ours["wall"]),
                     f"{peer['wall'] / ours['wall']:.1f}"])
    yield "## mslicer"
    yield ""
    yield ("The jobs of its published benchmark: [race.md](race.md)." if os.path.exists(os.path.join(root, "bench/race.md"))
           else "The jobs of its published benchmark: `scripts/bench race`.")
    yield ""
    if rows:
        yield ("mslicer (`bench/mslicer.py`) writes one `.goo` of grey runs, ours 1-bit TIFF files; runs alternate, the part files "
               "are in the page cache. Pixels whose centre is on the other side of the surface count as wrong.")
        yield ""
        yield from table(["job", "mslicer", "processor time", "times the limit", "peak memory", "wrong pixels", "lamina, rays",
                          "processor time", "times the limit", "times as fast"], rows)


def pixel_rows(results):
    for name, result in results:
        peer = result.get("prusa")
        if not peer or not peer.get("images_compared"):
            continue
        yield [f"`{name}`", f"{result['layers']} and {peer['layers']}", str(peer["images_compared"]),
               str(peer["pixels_different"]), str(peer["pixels_different_max"]),
               f"{result['columns'] * result['rows'] / 1e6:.1f} million"]


def memory_text(root):
    memory = load(root, "memory")
    if not memory:
        return
    yield "## Memory"
    yield ""
    few, many = memory["layers"]
    yield (f"Peak resident memory of one part (a gyroid of 246,820 triangles) in {few['layers']} layers: "
           f"{few['peak_mib']:.1f} MiB; in {many['layers']} layers: {many['peak_mib']:.1f} MiB "
           f"({100 * (many['peak_mib'] / few['peak_mib'] - 1):+.1f} %). Commit {memory['commit']}, {memory['date']}.")
    yield ""
    yield "`crowns-96` (357 million pixels a layer) under a budget for the layers in flight; the bytes written are the same:"
    yield ""
    rows = []
    for entry in memory["budget"]:
        summary = entry["summary"]
        own = sum(summary.get(key, 0) for key in ("mesh_bytes", "index_bytes")) / 2**20
        rows.append([f"`--memory {entry['memory']}`", f"{entry['peak_mib']:.1f} MiB", f"{own:.1f} MiB",
                     f"{summary.get('peak_layer_bytes', 0) / 2**20:.1f} MiB", str(summary.get("max_layers_in_flight", "?")),
                     f"{entry['wall']:.2f} s"])
    yield from table(["budget", "peak resident", "mesh + index", "layers in flight, bytes", "layers in flight", "time"], rows)


def lines(root, cases):
    results = [(name, load(root, name)) for name in cases]
    results = [(name, result) for name, result in results if result]
    yield "# Measured"
    yield ""
    yield "Written by `scripts/bench`; edits are lost. Raw figures: `bench/results/*.json`."
    yield ""
    if not results:
        yield "Nothing has been measured yet."
        return
    first = results[0][1]
    about = first["machine"]
    yield (f"{about['processor']}, {about['cores']} cores, {about['memory_gib']} GiB; {about['system']}, kernel "
           f"{about['kernel']}, g++ {about['compiler']}, release build; parts and outputs "
           f"on {about['files_on']}.")
    stamps = sorted({(result["commit"], result["date"]) for _, result in results})
    yield "Commit " + "; ".join(f"{name} on {date}" for name, date in stamps) + ". A + means that sources were changed."
    others = max(entry.get("others", 0) for _, result in results
                 for entry in [result.get("prusa", {}), *result["lamina"].values()])
    yield f"Other programs used at most {100 * others:.0f} % of the processors during the runs of one kind."
    version = next((result["prusa"]["version"] for _, result in results if "prusa" in result), None)
    yield ""
    yield ("Whole processes, mesh on disk (in the page cache) to layer files on disk, run in turn; medians, and the fastest "
           "and slowest run. Absolute times move with the machine, ratios much less. The peer is Debian's PrusaSlicer "
           f"{version or ''} `--export-sla` with supports, pad, grey levels and every compensation off (`bench/prusa.py`); "
           "it plans the copies as the one mesh that they make. Every run of ours, whichever engine, gave the same "
           "manifest, which holds a hash of each layer file.")
    yield ""
    yield "## Time"
    yield ""
    yield from table(["job", "layers", "PrusaSlicer", "lamina, rays", "times as fast", "lamina, contours", "times as fast",
                      "meant", "times the limit, rays", "the same, contours", "Gpx/s, rays"], time_rows(results))
    yield "## Peak resident memory and processor time"
    yield ""
    yield from table(["job", "PrusaSlicer", "lamina, rays", "part of it", "processor time, PrusaSlicer", "rays", "contours",
                      "PrusaSlicer / rays"], memory_rows(results))
    rows = list(pixel_rows(results))
    if rows:
        yield "## Pixels"
        yield ""
        yield ("Layers of both programs, decoded and compared. Ours are exact (see the tests); PrusaSlicer's vertices are "
               "rounded on the way, so single pixels at edges differ.")
        yield ""
        yield from table(["job", "layers", "compared", "pixels that differ, all", "in the worst layer", "pixels a layer"], rows)
    yield from mslicer_text(root, results)
    yield "## Rays"
    yield ""
    yield "Why a layer has few rays, with the times of more: [rays.md](rays.md)."
    yield ""
    yield "## Where the time goes"
    yield ""
    yield ("Wall time of the process; then milliseconds from the last run's summary: load, index and layers follow each "
           "other, the last three columns happen within layers and are summed over threads.")
    yield ""
    yield from table(["job", "engine, format", "process, s", "load", "index", "layers", "raster", "encode", "write"],
                     stage_rows(results))
    yield "## What no program can be faster than"
    yield ""
    yield ("The limit of `--timing`, on one thread: reading the part's file, writing files of the same sizes (temporary name, rename), "
           "and touching each crossing of a row with the part's surface once, in memory.")
    yield ""
    yield from table(["job", "limit", "the whole job, rays"], limit_rows(results))
    yield from memory_text(root)
    yield from growth_page.readme(load(root, "growth"), {commit for commit, _ in stamps})
    yield "## Again"
    yield ""
    yield "    scripts/bench             # an hour on two slow cores; nearly all of it is the peer's"
    yield "    scripts/bench --large     # and the 811 MB plate"
    yield "    scripts/bench --alone     # ours only, a few minutes"
    yield "    scripts/bench --mslicer PROGRAM    # and mslicer's command line in alternating runs"
    yield ""
    yield ("The parts are made by `bench/make_parts.py` from the models folder (`LAMINA_MODELS`). Single stages are timed by "
           "Google Benchmark: `LAMINA_MODELS=... build/release/lamina_bench`.")


def write_readme(root, cases=tuple(DESCRIPTION)):
    text = "\n".join(lines(root, cases)).rstrip() + "\n"
    with open(os.path.join(root, "bench", "README.md"), "w", encoding="utf-8") as file:
        file.write(text)

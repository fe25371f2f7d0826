"""bench/growth_page.py: the page of scripts/bench growth, and its lines for bench/README.md."""
from tables import seconds, table

ABOUT = {
    "triangles": ("triangles", "a torus knot, 236 layers of 22.3 million pixels"),
    "layers": ("layers", "a knot of 100,000 triangles, 5.6 million pixels a layer"),
    "pixels": ("pixels a layer", "the same, 100 layers"),
    "copies": ("copies", "of one part of 1,000 triangles, 20 layers of 89 million pixels"),
    "meshes": ("different parts", "of 1,000 triangles each in files of their own, 20 layers of 89 million pixels"),
    "threads": ("threads", "knot800k: 800,000 triangles, 472 layers of 22.3 million pixels"),
}
PRODUCTS = {"levels": "`--levels 4`", "dither": "`--core 0.7`", "program": "`--saturation 70` on production-1200", "fill": "`--fill raster`, two walls",
            "inspect": "`--inspect`", "slice": "`slice`", "extrude": "`extrude`"}


def about(name):
    """Size and job of a series."""
    if name == "batch-jobs":
        return "jobs", "of a batch, dry runs of a cube"
    if name.startswith("overlaps-"):
        where = "1 um apart" if name == "overlaps-near" else "at one position"
        return "items", f"of a 3MF build, {where}: `{'jet' if name == 'overlaps-jet' else 'info'}`"
    if "-" not in name:
        return ABOUT[name]
    if name.startswith("pages-"):
        return "pages", f"`{name[6:]}` of one TIFF, 512 x 512 pixels a page"
    product, size = name.split("-")
    if name == "program-layers":
        return "layers", "a print program of production-1200, a knot of 100,000 triangles, as many drops in each layer"
    return ABOUT[size][0], f"{PRODUCTS[product]}, {ABOUT[size][1]}"


def slope_text(value):
    return "flat" if value is None else f"{value:.2f}"


def verdict(found):
    if found["worse"]:
        return "**WORSE THAN LINEAR**: " + "; ".join(found["worse"]) + "."
    return f"No term is worse than linear: no slope of processor time or memory is above {found['steepest']}."


def slope_rows(found):
    for name, series in found["series"].items():
        if series["slopes"]:
            entries = series["entries"]
            yield [about(name)[0], f"{entries[0]['x']:,} to {entries[-1]['x']:,}", about(name)[1],
                   *(slope_text(series["slopes"][measure]) for measure in ("wall", "processor", "peak"))]


def slopes(found):
    yield from table(["against", "from, to", "job", "wall time", "processor time", "peak memory"], slope_rows(found))
    yield verdict(found)
    yield ""


def bounds(found):
    shares = found["shares"]
    if not shares:
        return
    threads = next(iter(shares.values()))["threads"]
    if threads < 2:
        yield "Serial shares are not known: they need two threads."
        yield ""
        return
    rows = []
    for case, share in shares.items():
        phases = share["phases"]
        wall, serial = (sum(span[key] for span in phases.values()) for key in ("wall", "serial"))
        longest = max(phases, key=lambda name: phases[name]["serial"])
        minimum = {int(n): min_seconds for n, min_seconds in share["bounds"].items()}
        rows.append([f"`{case}`", f"{1e3 * wall:.0f}", f"{1e3 * serial:.0f}", f"{longest}, {1e3 * phases[longest]['serial']:.0f}",
                     *(f"{1e3 * minimum[n]:.0f} ({wall / minimum[n]:.1f} x)" for n in (16, 64)), f"{1e3 * share['limit']:.0f}"])
    yield (f"Minimum wall milliseconds on more cores: Amdahl's bound, from the processor time and the serial seconds of each phase of "
           f"runs on {threads} threads (`--timing`, `bench/amdahl.py`). Memory and files that cores share make runs longer. The last "
           "column is the limit of one thread: reading, writing and touching each crossing once.")
    yield ""
    yield from table(["job", f"{threads} threads, ms", "of it one thread alone", "most of that", "16 cores", "64 cores",
                      "limit, ms"], rows)


def of_other_commits(found):
    """A sentence about series that were measured again."""
    again = {}
    for name, series in found["series"].items():
        if "commit" in series:
            again.setdefault((series["commit"], series["date"]), []).append(" against ".join(reversed(about(name))))
    return "".join(f" At commit {commit} on {date}: " + "; ".join(names) + "." for (commit, date), names in again.items())


def lines(found):
    where = found["machine"]
    yield "# Growth"
    yield ""
    yield "Written by `scripts/bench growth` (`bench/growth.py`); edits are lost."
    yield ""
    yield (f"{where['processor']}, {where['cores']} cores, {where['memory_gib']} GiB; {where['system']}, kernel {where['kernel']}. Commit "
           f"{found['commit']} on {found['date']}. The least of {found['runs']} runs of whole processes; parts in the page cache, "
           f"outputs in memory. Other programs used {100 * found['others']:.0f} % of the processors.{of_other_commits(found)}")
    yield ""
    yield ("A slope is that of least squares in log-log over the upper two decades: of what a job takes beyond the smallest of its "
           "series against what it has beyond it. 1 is linear; what grows by less than a tenth is flat.")
    yield ""
    yield from slopes(found)
    for name, series in found["series"].items():
        size, job = about(name)
        yield f"## {size.capitalize()}: {job}"
        yield ""
        yield from table([size, "wall, s", "processor, s", "peak, MiB"], [
            [f"{entry['x']:,}", seconds(entry["wall"]), seconds(entry["processor"]), f"{entry['peak'] / 2**20:.1f}"]
            for entry in series["entries"]])
    if found["shares"]:
        yield "## More cores"
        yield ""
        yield from bounds(found)


def readme(found, commits):
    """A section of bench/README.md, whose other figures are of these commits. Figures of another commit are in growth.md alone."""
    if not found:
        return
    yield "## Growth"
    yield ""
    if commits != {found["commit"]}:
        yield "Time and memory against copies, layers, pixels, triangles, parts, jobs and threads: [growth.md](growth.md)."
        yield ""
        return
    yield (f"Slopes in log-log over the upper two decades (1 is linear), commit {found['commit']}, {found['date']}; all figures in "
           "[growth.md](growth.md).")
    yield ""
    yield from slopes(found)
    yield from bounds(found)

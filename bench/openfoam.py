#!/usr/bin/env python3
"""bench/openfoam.py: creeping flow through two printed cells, compared with OpenFOAM. scripts/bench openfoam

    scripts/bench openfoam [--voxels UM ...]     writes bench/openfoam.md

Plans two configurations of Di Nisio 2022, has `lamina permeability` cut their period into voxels (--void) and compute the flow, and
makes an OpenFOAM mesh of the same voxels: a hexahedron for each voxel of the void, walls where solid is, cyclic patches where the
box repeats. simpleFoam solves for a small uniform force along z; k follows from the mean velocity.
"""
import argparse
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(ROOT, "bench"))
import figures  # noqa: E402
import pores  # noqa: E402
import tables  # noqa: E402

CELLS = {"Raster": [20, 10, 20 / 3], "F1.5E75C1": [20, 10]}  # voxels in um; 20 / 3 takes minutes of the second cell
FORCE = 1e-6  # a Reynolds number of about 1e-5 in voxels of side 1 and viscosity 1
DARCY = 9.869233e-13
PROJECT = os.environ.get("WM_PROJECT_DIR", "/usr/share/openfoam")  # Debian's; simpleFoam reads its controlDict there
HEAD = "FoamFile {{ version 2.0; format ascii; class {kind}; object {name}; }}\n"


def read_nrrd(path):
    """Void as an array [z, y, x]."""
    import numpy
    with open(path, "rb") as file:
        head, data = file.read().split(b"\n\n", 1)
    sizes = [int(word) for word in re.search(rb"sizes: (.*)", head)[1].split()]
    return numpy.frombuffer(data, numpy.uint8, count=sizes[0] * sizes[1] * sizes[2]).reshape(sizes[::-1]) != 0


def faces_between(void):
    """Faces of the void as (axis, lower corner, owner, neighbour, whether the owner lies above), sorted into patches: inner ones,
    walls, and for each axis those at its lower and its upper end. Corners are places of points."""
    import numpy
    number = numpy.full(void.shape, -1)
    number[void] = numpy.arange(void.sum())
    inner, walls, ends = [], [], {}
    for axis in range(3):
        dim = 2 - axis  # arrays are [z, y, x]
        repeated = numpy.concatenate([numpy.take(number, [-1], dim), number, numpy.take(number, [0], dim)], dim)
        count = number.shape[dim]
        for step in range(count + 1):
            below, above = numpy.take(repeated, step, dim), numpy.take(repeated, step + 1, dim)
            for kind, mask in (("both", (below >= 0) & (above >= 0)), ("below", (below >= 0) & (above < 0)),
                               ("above", (below < 0) & (above >= 0))):
                at = numpy.argwhere(mask)
                if not len(at):
                    continue
                corner = numpy.insert(at, dim, step, axis=1)[:, ::-1]  # x, y, z
                at_end = step in (0, count)
                lower, upper = below[mask], above[mask]
                if kind == "both" and at_end:
                    ends[axis, step == count] = (axis, corner, lower if step == count else upper, None, step == 0)
                elif kind == "both":
                    inner.append((axis, corner, lower, upper, False))
                # A wall at the end belongs to the cell inside the box alone.
                elif kind == "below" and step > 0:
                    walls.append((axis, corner, lower, None, False))
                elif kind == "above" and step < count:
                    walls.append((axis, corner, upper, None, True))
    return inner, walls, ends


def points_of(axis, corner, backwards):
    """Four points a face, as positions; counterclockwise as viewed from the side to which the normal points, away from the owner."""
    import numpy
    a, b = numpy.zeros(3, int), numpy.zeros(3, int)
    a[(axis + 1) % 3] = b[(axis + 2) % 3] = 1
    ring = [corner, corner + b, corner + a + b, corner + a] if backwards else [corner, corner + a, corner + a + b, corner + b]
    return numpy.stack(ring, 1)


def write_list(folder, name, kind, rows):
    with open(os.path.join(folder, name), "w", encoding="ascii") as file:
        file.write(HEAD.format(kind=kind, name=name) + f"{len(rows)}\n(\n" + "\n".join(rows) + "\n)\n")


def write_mesh(void, folder):
    import numpy
    os.makedirs(folder)
    inner, walls, ends = faces_between(void)
    owner, neighbour = (numpy.concatenate([face[k] for face in inner]) for k in (2, 3))
    order = numpy.lexsort((neighbour, owner))
    faces = [numpy.concatenate([points_of(face[0], face[1], face[4]) for face in inner])[order]]
    owners, patches, start = [owner[order]], [], len(order)
    groups = [("walls", walls)] + [(f"{'xyz'[axis]}{'01'[upper]}", [ends[axis, upper]]) for axis, upper in sorted(ends)]
    for name, group in groups:
        before = start
        for face in group:
            faces.append(points_of(face[0], face[1], face[4]))
            owners.append(face[2])
            start += len(face[2])
        if name == "walls":
            text = "type wall;"
        else:
            step = [0, 0, 0]
            axis = "xyz".index(name[0])
            step[axis] = void.shape[2 - axis] * (1 if name[1] == "0" else -1)
            text = (f"type cyclic; neighbourPatch {name[0]}{1 - int(name[1])}; transform translational; "
                    f"separationVector ({step[0]} {step[1]} {step[2]});")
        patches.append(f"{name} {{ {text} nFaces {start - before}; startFace {before}; }}")
    faces, owners = numpy.concatenate(faces), numpy.concatenate(owners)
    sides = numpy.array(void.shape[::-1]) + 1
    used, which = numpy.unique((faces[..., 2] * sides[1] + faces[..., 1]) * sides[0] + faces[..., 0], return_inverse=True)
    which = which.reshape(faces.shape[:2])
    positions = zip(used % sides[0], used // sides[0] % sides[1], used // (sides[0] * sides[1]))
    write_list(folder, "points", "vectorField", [f"({x} {y} {z})" for x, y, z in positions])
    write_list(folder, "faces", "faceList", [f"4({a} {b} {c} {d})" for a, b, c, d in which])
    write_list(folder, "owner", "labelList", [str(cell) for cell in owners])
    write_list(folder, "neighbour", "labelList", [str(cell) for cell in neighbour[order]])
    write_list(folder, "boundary", "polyBoundaryMesh", patches)
    return [name for name, _ in groups[1:]]


def write_case(void, folder):
    cyclic = write_mesh(void, os.path.join(folder, "constant/polyMesh"))

    def write(name, kind, text):
        os.makedirs(os.path.dirname(os.path.join(folder, name)), exist_ok=True)
        with open(os.path.join(folder, name), "w", encoding="ascii") as file:
            file.write(HEAD.format(kind=kind, name=os.path.basename(name)) + text + "\n")

    ends = " ".join(f"{name} {{ type cyclic; }}" for name in cyclic)
    write("0/U", "volVectorField", "dimensions [0 1 -1 0 0 0 0]; internalField uniform (0 0 0);\n"
          f"boundaryField {{ walls {{ type noSlip; }} {ends} }}")
    write("0/p", "volScalarField", "dimensions [0 2 -2 0 0 0 0]; internalField uniform 0;\n"
          f"boundaryField {{ walls {{ type zeroGradient; }} {ends} }}")
    write("constant/transportProperties", "dictionary", "transportModel Newtonian; nu 1;")
    write("constant/turbulenceProperties", "dictionary", "simulationType laminar;")
    write("constant/fvOptions", "dictionary", "force { type vectorSemiImplicitSource; selectionMode all; volumeMode specific; "
          f"injectionRateSuSp {{ U ((0 0 {FORCE}) 0); }} }}")
    write("system/controlDict", "dictionary", """application simpleFoam; startFrom startTime; startTime 0; stopAt endTime; endTime 6000;
deltaT 1; writeControl timeStep; writeInterval 6000; writePrecision 12; timePrecision 8; runTimeModifiable false;
functions { mean { type volFieldValue; libs (fieldFunctionObjects); fields (U); operation volIntegrate; regionType all;
  writeFields false; executeControl timeStep; writeControl timeStep; writeInterval 10; } }""")
    write("system/fvSchemes", "dictionary", """ddtSchemes { default steadyState; } gradSchemes { default Gauss linear; }
divSchemes { default none; div(phi,U) Gauss linear; div((nuEff*dev2(T(grad(U))))) Gauss linear; }
laplacianSchemes { default Gauss linear orthogonal; } interpolationSchemes { default linear; } snGradSchemes { default orthogonal; }""")
    write("system/fvSolution", "dictionary", """solvers { p { solver PCG; preconditioner DIC; tolerance 1e-14; relTol 0.02; }
  U { solver smoothSolver; smoother symGaussSeidel; tolerance 1e-16; relTol 0.05; } }
SIMPLE { consistent yes; nNonOrthogonalCorrectors 0; pRefCell 0; pRefValue 0; residualControl { U 1e-6; p 1e-5; } }
relaxationFactors { equations { U 0.95; } }""")


def run(command, folder, environment=None):
    """Standard output, processor seconds and the peak of memory in MB."""
    reported = os.path.join(folder, "time")
    done = subprocess.run(["/usr/bin/time", "-f", "%U %S %M", "-o", reported, *command], cwd=folder, env=environment, check=True,
                          stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    with open(reported, encoding="ascii") as file:
        user, system, peak = (float(word) for word in file.read().split()[-3:])
    return done.stdout, user + system, peak / 1024


def by_openfoam(void, voxel, folder):
    """Permeability along z in darcy, what it changed by in the last 20 iterations, iterations, processor seconds, memory in MB."""
    shutil.rmtree(folder, ignore_errors=True)
    write_case(void, folder)
    _, seconds, peak = run(["simpleFoam"], folder, {**os.environ, "WM_PROJECT_DIR": PROJECT})
    with open(os.path.join(folder, "postProcessing/mean/0/volFieldValue.dat"), encoding="ascii") as file:
        steps = [(int(line.split()[0]), float(line.replace("(", " ").replace(")", " ").split()[3]))
                 for line in file if not line.startswith("#")]
    darcy = [flow / void.size / FORCE * (voxel * 1e-6) ** 2 / DARCY for _, flow in steps]
    return darcy[-1], abs(darcy[-1] / darcy[-3] - 1), steps[-1][0], seconds, peak


def compared(folder, name, voxels):
    """Rows of a cell, and what both programs come to."""
    toolpaths, rows, theirs = pores.plan(name, folder), [], []
    for voxel in sorted(voxels, reverse=True):
        path = os.path.join(folder, "void.nrrd")
        reported, seconds, peak = run([pores.LAMINA, "permeability", toolpaths, "--voxel", str(voxel), "--json", "--void", path,
                                   "--overwrite"], folder)
        found = json.loads(reported)
        edges = [1e3 * side / count for side, count in zip(found["window_mm"], found["voxels"])]
        if max(edges) - min(edges) > 1e-3 * voxel:
            sys.exit(f"bench openfoam: {name} has no cubes of {voxel:g} um; take another size")
        void = read_nrrd(path)
        k, change, steps, their_seconds, their_peak = by_openfoam(void, edges[2], os.path.join(folder, "case"))
        if change > 1e-4:
            sys.exit(f"bench openfoam: simpleFoam has not settled in {name} at {voxel:g} um")
        theirs.append(k)
        ours = found["flow"][2]
        rows.append([f"`{name}`", f"{edges[2]:.3g}", f"{void.sum()}", f"{100 * void.mean():.2f}", f"{100 * found['porosity']:.2f}",
                     f"{k:.1f}", f"{steps}", f"{their_seconds:.1f}",
                     f"{their_peak:.0f}", f"{ours['k1_darcy']:.1f} +- {ours['k1_error_darcy']:.1f}", f"{ours['steps']}",
                     f"{seconds:.1f}", f"{peak:.0f}"])
        print(*rows[-1], flush=True)
    return rows, theirs, ours


def page(voxels, folder):
    machine = figures.machine(ROOT)
    version = subprocess.run(["dpkg-query", "-W", "-f", "${Version}", "openfoam"], check=False, stdout=subprocess.PIPE,
                             stderr=subprocess.DEVNULL, text=True).stdout or "of another source"
    yield "# Creeping flow compared with OpenFOAM"
    yield ""
    yield (f"`scripts/bench openfoam`, commit {figures.commit(ROOT)}, openfoam {version}, {machine['processor']}, {machine['cores']} "
           f"cores, {os.getloadavg()[0]:.0f} processes running at the start. Periods of two configurations of Di Nisio 2022, as "
           "lamina deposits their beads; k1 along z in darcy.")
    yield ""
    yield ("OpenFOAM's mesh has a hexahedron for each voxel of void that lamina wrote (`--void`): walls are steps, and the void of "
           "whole voxels deviates in both directions. So its result is not extrapolated; its error is the change from the previous size. "
           "simpleFoam (SIMPLEC, linear differences, Reynolds number about 1e-5) runs on one core, for z alone. lamina cuts voxels "
           "three times finer for walls; its k1 is extrapolated from these voxels and twice as large ones. Its time and memory include "
           "reading the toolpaths, cutting voxels, pores, throats and the flow along all of x, y and z at both sizes.")
    yield ""
    rows, ends = [], []
    pores.write_cylinder(os.path.join(folder, "part.stl"), 25.4, 6)
    for name, sizes in CELLS.items():
        cell, theirs, ours = compared(folder, name, voxels or sizes)
        rows += cell
        k, error, step = ours["k1_darcy"], ours["k1_error_darcy"], abs(theirs[-1] - theirs[-2])
        ends.append([f"`{name}`", f"{theirs[-1]:.1f} +- {step:.1f}", f"{k:.1f} +- {error:.1f}",
                     f"{100 * (k / theirs[-1] - 1):+.1f}",
                     "yes" if abs(k - theirs[-1]) <= step + error else "no"])
    yield from tables.table(["cell", "voxel, um", "void voxels", "of all, %", "void, three times finer, %", "OpenFOAM, D",
                              "iterations", "processor seconds", "MB", "lamina, D", "steps along z", "processor seconds", "MB"], rows)
    yield "Both at the finest:"
    yield ""
    yield from tables.table(["cell", "OpenFOAM, D", "lamina, D", "lamina differs, %", "within both errors"], ends)


def main(arguments):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--voxels", type=float, nargs="+", default=[], help="edges, um, at least two, for both cells")
    options = parser.parse_args(arguments)
    if len(set(options.voxels)) == 1:
        parser.error("two sizes of voxels at least, for the error")
    if not shutil.which("simpleFoam"):
        sys.exit("bench openfoam: no simpleFoam here; install Debian's package openfoam")
    if importlib.util.find_spec("numpy") is None:
        sys.exit("bench openfoam: this Python has no numpy; install Debian's package python3-numpy and run it by /usr/bin/python3")
    with tempfile.TemporaryDirectory() as folder:
        text = "\n".join(page(options.voxels, folder)) + "\n"
    with open(os.path.join(ROOT, "bench/openfoam.md"), "w", encoding="utf-8") as file:
        file.write(text.rstrip("\n") + "\n")
    print("wrote bench/openfoam.md")


if __name__ == "__main__":
    main(sys.argv[1:])

#include "pipeline/cli/outputs.h"
#include "pipeline/cli/plan_command.h"

namespace lamina::pipeline {
namespace {

const KeyChoice kKeys = {"bed.size_mm", "layers",     "heights",    "place", "image.fill", "load", "run.output",
                         "run.threads", "run.memory", "run.layers", "slice", "fill",       "part"};

const OptionSpec kOwn[] = {{"--resume", "", "go on with an interrupted job: whole layers are kept", "", "Run"},
                           {"--overwrite", "", "replace an earlier job in the directory", "", "Run"},
                           {"--dry-run", "", "load, place and index, write nothing", "", "Run"}};

/// A sliced job keeps its job beside its manifest.
Status resolve(const Arguments& arguments, Job& job) {
  const InputFile asked = {arguments.text("--job"), "the job file"};
  const std::string kept = job.output + "/job.toml";
  return check_outputs({&asked, 1}, {&kept, 1});
}

PlanCommand row() {
  return {Product::kContours,
          kKeys,
          "Cuts parts into layers: closed contours in exact nanometres, outer ones counter-clockwise, holes clockwise, as\n"
          "SVG, CLI or 3MF slices, and fills them if a pattern or walls are asked for.",
          kOwn,
          {},
          "Lengths are mm, angles degrees. Keys of a filling that have no option are set by --set fill.KEY=VALUE, between\n"
          "heights by fill.range, for one part by part.fill; docs/filling.md has all of them.\n\n"
          "Examples:\n"
          "  lamina slice bracket.stl --layer 0.1 -o out                      out/bracket.svg\n"
          "  lamina slice bracket.stl --layer 0.05 --format cli-binary -o out\n"
          "  lamina slice a.stl b.stl --layer 0.2 --format 3mf -o out\n"
          "  lamina slice part.stl --layer 0.3 --walls 1 --pattern raster --bead 0.4 --bead-gap 0.12 --angle 90 -o out\n"
          "  lamina slice part.stl --layer 0.3 --pattern raster --stagger 0,0.26 --gap-formula '0.1+0.6*h' -o out",
          false,
          resolve};
}

}  // namespace

const Command slice_command = {"slice", "contours of every layer, and their filling: SVG, CLI, 3MF slices",
                               [] { return plan_spec(row()); },
                               [](const Arguments& arguments, Context& context) { return plan(row(), arguments, context); }};

}  // namespace lamina::pipeline

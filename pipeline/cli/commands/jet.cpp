#include <fmt/format.h>

#include "pipeline/cli/plan_command.h"
#include "pipeline/job/material.h"
#include "stages/write/image_format.h"

namespace lamina::pipeline {
namespace {

// clang-format off
const KeyChoice kKeys = {"bed", "layers", "heights", "place", "image.format", "image.mirror", "machine", "dose", "fill", "segment.fill",
                            "segment.rule", "segment.thick_mm", "segment.thin_mm", "segment.continuous_lines", "segment.spacing_sc_mm",
                            "segment.spacing_cc_mm", "segment.gap_mm", "segment.shift_mm", "segment.thick_width_mm",
                            "segment.thin_width_mm", "load", "run", "part"};
// clang-format on

const OptionSpec kOwn[] = {
    {"--material", "NAME|NAME,...", "powder of all parts, or of each in their order; two vats can hold two", "",
     "Machine and binder"},
    {"--resume", "", "go on with an interrupted job; finished layers whose hash holds are kept", "", "Run"},
    {"--overwrite", "", "replace an earlier job in the directory", "", "Run"},
    {"--dry-run", "", "load, place and index, tell what it would take, write nothing", "", "Run"}};

std::string closing() {
  std::string text = "Formats:\n";
  for (const auto& format : write::image_formats()) text += fmt::format("  {:<16}{}\n", format.id, format.description);
  return text +
         "\nLengths are mm, angles degrees. Part options hold for every part; a job file sets them for each.\n\n"
         "Examples:\n"
         "  lamina jet bracket.stl -o out                                  a part in the middle of the bed\n"
         "  lamina jet a.stl b.3mf --bed 400x400 --dpi 600 --copies 12 -o out\n"
         "  lamina jet part.obj --unit inch --rotate 0,0,90 --shrink 1.02,1.02,1.025 -o out\n"
         "  lamina jet a.stl b.stl --material steel,bronze --machine nuferbj -o out\n"
         "  lamina jet part.stl --layers 100:110 --format png -o look      ten layers only\n"
         "  lamina jet part.stl --shard 1/4 -o out                         a quarter; then lamina merge out -o out\n"
         "  lamina jet part.stl --fill segmented --thin 1.5 --shell 1 -o out   pores planned by the filling, in a solid shell\n"
         "  lamina jet part.stl --dpi 600 --save-job job.toml --dry-run    write the job, plan nothing\n"
         "  lamina jet --job job.toml -o out --resume";
}

Status resolve(const Arguments& arguments, Job& job) {
  if (!arguments.has("--material")) return {};
  const Status status = set_materials(arguments.text("--material"), job);
  return status ? status : Error{Fault::kUsage, "--material: " + status.error().message};
}

PlanCommand row() {
  return {Product::kImages,
          kKeys,
          "Plans a binder-jet job: the exact 1-bit image of every layer of the bed, layers/000000.tif and up from the\n"
          "bottom, and a manifest.json. The same parts and options give the same bytes on every machine.",
          kOwn,
          {},
          closing(),
          true,
          resolve};
}

}  // namespace

const Command jet_command = {"jet", "binder jetting: exact 1-bit images of every layer of the bed, and a manifest",
                             [] { return plan_spec(row()); },
                             [](const Arguments& arguments, Context& context) { return plan(row(), arguments, context); }};

}  // namespace lamina::pipeline

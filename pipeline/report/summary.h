// pipeline/report/summary.h: the summary of a job, as text and as JSON, in one form for all products.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "stages/data/choices.h"
#include "stages/data/mesh.h"
#include "stages/data/status.h"
#include "stages/support/text/json_value.h"

namespace lamina::pipeline {

struct Timing;

struct Summary {
  Product product = Product::kImages;
  bool dry_run = false;
  std::string output, format, machine;  // machine: empty without one
  std::string layer_text;               // "of 0.1 mm"
  double height_mm = 0;                 // of the highest layer's top
  std::uint32_t layers_total = 0, layers_planned = 0, layers_kept = 0;
  std::uint64_t triangles = 0;  // with copies
  double volume_mm3 = 0;        // of set pixels, contours or beads
  std::uint64_t bytes_written = 0;
  double load_seconds = 0, index_seconds = 0, layer_seconds = 0;  // wall
  std::optional<double> estimated_layer_seconds;                  // of processors, of a dry run that sampled layers
  std::vector<std::pair<std::string_view, double>> step_seconds;  // of each step, over all threads
  std::shared_ptr<Timing> timing;                                 // null unless the job requests it
  std::uint64_t mesh_bytes = 0, index_bytes = 0, peak_layer_bytes = 0, memory_budget_bytes = 0, peak_resident_bytes = 0;
  std::uint32_t max_layers_in_flight = 0;
  std::uint32_t oversized_layers = 0;  // held more than the budget by themselves, and ran alone
  std::vector<PartSummary> parts;
  std::vector<Warning> warnings;

  // --- specific to the product
  using Lines = std::vector<std::pair<std::string, std::string>>;  // name, text
  std::string estimate_text;                                       // of the bytes to be written, of a dry run; or empty
  Lines head, results, end;                                        // before the layers, after them, after memory
  Json facts = Json::object();                                     // names and values of the product
  std::vector<std::vector<std::string>> quote;                     // rows of a table of costs; empty for none

  /// Aligned lines with units, then one line per warning.
  std::string text() const;
  /// One JSON object on one line. Lengths in mm or nm, times in seconds and sizes in bytes, as the keys say.
  std::string json() const;
};

/// Each part on a line, its notes below it; of more than 20 parts each file; as in a summary.
Summary::Lines part_lines(const std::vector<PartSummary>& parts);
Json part_json(const PartSummary& part);
Json warnings_json(const std::vector<Warning>& warnings);
/// Lines with their names aligned.
std::string text_of(const Summary::Lines& lines);

/// The command of a product: jet, slice, extrude.
std::string_view command_name(Product product);

}  // namespace lamina::pipeline

#include "pipeline/manifest/possible.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <set>
#include <stdexcept>

#include "stages/formats/level_format.h"
#include "stages/formats/slice_format.h"
#include "stages/program/dialect.h"
#include "stages/support/text/readable.h"

namespace lamina {
namespace {

constexpr std::size_t kLongestName = 255, kLongestMaterial = 40;  // bytes
constexpr std::int64_t kMostMicroseconds = 1'000'000'000'000;     // of a layer, as a replay counts them
constexpr std::uint32_t kMostDrops = 64;                          // of a pixel
constexpr std::int64_t kMostDots = 25'400, kMostSpan = 1'000'000'000'000, kLeastPixel = 1000;

/// Of the letters that read::check_material allows.
bool is_material(std::string_view name) {
  return !name.empty() && name.size() <= kLongestMaterial && std::ranges::all_of(name, [](unsigned char c) {
    return (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || c == '-' || c == '_';
  });
}

std::string no_such(std::string_view what, std::string_view value) {
  return fmt::format("\"{}\" is {}, which lamina does not write", what, one_line(value.substr(0, 80)));
}

std::string fault_of_images(const ManifestHead& head) {
  const auto extension = write::extension_of(head.format);
  if (!extension) return no_such("format", head.format);
  if (head.extension != *extension) return no_such("extension", head.extension);
  if (!head.file.empty()) return no_such("file", head.file);
  std::set<std::string_view> names;
  for (const JobMaterial& material : head.materials) {
    if (!is_material(material.name) || !names.insert(material.name).second) return no_such("materials", material.name);
  }
  constexpr std::size_t kMostVats = 2;  // several drops are of a machine, whose vats the materials are in
  if (head.most_drops > kMostDrops || (head.drops_of_materials() && head.materials.size() > kMostVats)) {
    return no_such("most_drops", fmt::format("{}", head.most_drops));
  }
  const bool grey = write::find_level_format(head.format) != nullptr;
  const bool right = head.levels == 2 || head.levels == 4 || head.levels == 16;
  const bool drops = head.most_drops > 0;  // also as grey, of a job with a machine
  if (head.levels > 0 ? !right || (!grey && !drops) : grey && !drops) {
    return no_such("levels", fmt::format("{}", head.levels));
  }
  if (grey && (drops == head.machine.empty() || (!drops && !head.materials.empty()))) return no_such("format", head.format);
  constexpr std::uint32_t kMostHeadDrops = 15;
  if (head.head_drops > kMostHeadDrops || head.sweep_drops < 1 || head.sweep_drops > head.head_drops) {
    return no_such("sweep_drops", fmt::format("{}", head.sweep_drops));
  }
  if (head.machine.empty()) return {};
  for (const JobMaterial& material : head.materials) {
    if (material.vat > 1) return no_such("vat", fmt::format("{}", material.vat));
  }
  const auto* dialect = write::find_dialect(head.dialect);
  if (dialect == nullptr) return no_such("dialect", head.dialect);
  return head.program_extension == dialect->extension ? "" : no_such("program_extension", head.program_extension);
}

std::string fault_of_contours(const ManifestHead& head) {
  const auto* slice = write::find_slice_format(head.format);
  if (slice == nullptr) return no_such("format", head.format);
  const bool layer_files = head.file.empty() && !slice->extension.empty();
  if (head.extension != (layer_files && slice->layer_files ? slice->extension : ""))
    return no_such("extension", head.extension);
  if (head.file.empty()) return slice->layer_files || slice->extension.empty() ? "" : no_such("file", "absent");
  const bool named = is_file_name(head.file) && !slice->extension.empty() && head.file.ends_with(slice->extension);
  return named ? "" : no_such("file", head.file);
}

std::string fault_of_moves(const ManifestHead& head) {
  if (head.format != "gcode" && head.format != "sml") return no_such("format", head.format);
  if (!head.extension.empty()) return no_such("extension", head.extension);
  return is_file_name(head.file) ? "" : no_such("file", head.file);
}

}  // namespace

bool is_file_name(std::string_view name) {
  return !name.empty() && name.size() <= kLongestName && name != "." && name != ".." &&
         name.find_first_of(std::string_view("/\0", 2)) == std::string_view::npos;
}

PixelAxis possible_axis(std::int64_t dots, std::int64_t length, std::int64_t span) {
  if (dots < 1 || dots > kMostDots || span < 1 || span > kMostSpan || span / dots < kLeastPixel || length < 1 ||
      length > kNmReach) {
    throw std::invalid_argument("its grid is none of a bed");
  }
  return PixelAxis(dots, length, span);
}

std::string what_is_impossible(const ManifestHead& head) {
  for (const PartSummary& part : head.parts) {
    if (!part.path.empty() && !is_file_name(part.path)) return no_such("path", part.path);
  }
  switch (head.product) {
    case Product::kImages: return fault_of_images(head);
    case Product::kContours: return fault_of_contours(head);
    case Product::kMoves: break;
  }
  return fault_of_moves(head);
}

std::string what_is_impossible(const Layer& layer) {
  const bool possible = layer.bottom >= 0 && layer.thickness > 0 && std::int64_t{layer.bottom} + layer.thickness <= kNmReach;
  return possible ? "" : fmt::format("lies at {} nm and is {} nm thick", layer.bottom, layer.thickness);
}

std::string what_is_impossible(const ProgramRecord& program) {
  if (program.added_sweeps > program.sweeps || std::abs(program.added_microseconds) > program.microseconds) {
    return fmt::format("has {} added sweeps in {} microseconds", program.added_sweeps, program.added_microseconds);
  }
  const bool possible = program.microseconds >= 0 && program.microseconds <= kMostMicroseconds;
  return possible ? "" : fmt::format("takes {} microseconds", program.microseconds);
}

}  // namespace lamina

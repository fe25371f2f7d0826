#include "pipeline/job_keys.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "pipeline/nearest_name.h"
#include "pipeline/number_text.h"
#include "stages/write/image_format.h"

namespace lamina::pipeline {
namespace {

constexpr double kLeastMm = 1e-6;  // 1 nm
constexpr double kMostMm = 2147;   // what 32 bits of nanometres hold, in whole mm
constexpr double kMostFactor = 1e6;

// A word of a fixed list <-> a value.
template <class Value>
struct Word {
  std::string_view word;
  Value value;
};
constexpr Word<FillRule> kFillRules[] = {
    {"nonzero", FillRule::kNonzero}, {"positive", FillRule::kPositive}, {"evenodd", FillRule::kEvenOdd}};
constexpr Word<Engine> kEngines[] = {{"rays", Engine::kRays}, {"contours", Engine::kContours}, {"both", Engine::kBoth}};
constexpr Word<Mirror> kMirrors[] = {
    {"none", Mirror::kNone}, {"x", Mirror::kX}, {"y", Mirror::kY}, {"xy", Mirror::kXY}};
constexpr Word<int> kUnits[] = {{"mm", 0}, {"cm", 0}, {"m", 0}, {"um", 0}, {"inch", 0}, {"foot", 0}};

std::string not_one_of(std::string_view text, std::span<const std::string_view> words) {
  return fmt::format("'{}' is none of {}{}", text, fmt::join(words, ", "), suggest(text, words));
}

template <class Value, std::size_t N>
std::string read_word(const Word<Value> (&words)[N], std::string_view text, Value& value) {
  std::vector<std::string_view> names;
  for (const auto& [word, meaning] : words) {
    if (word == text) {
      value = meaning;
      return {};
    }
    names.push_back(word);
  }
  return not_one_of(text, names);
}

template <class Value, std::size_t N>
std::string write_word(const Word<Value> (&words)[N], Value value) {
  for (const auto& [word, meaning] : words) {
    if (meaning == value) return std::string(word);
  }
  return {};
}

std::string write_switch(bool value) { return value ? "true" : "false"; }

template <std::size_t N>
std::string write_list(const std::array<double, N>& values) {
  std::vector<std::string> texts;
  for (const double value : values) texts.push_back(number_text(value));
  return fmt::format("{}", fmt::join(texts, ","));
}

std::string read_dpi(std::string_view text, Job& job) {
  const auto pieces = split(text, ",x");
  if (pieces.size() > 2) return fmt::format("'{}' is not one or two numbers; write 1200 or 1200x600", text);
  std::array<std::int64_t, 2> dpi{};
  for (std::size_t i = 0; i < 2; ++i) {
    if (auto wrong = read_whole(pieces[std::min(i, pieces.size() - 1)], 1, 25400, dpi[i]); !wrong.empty()) return wrong;
  }
  job.dpi = dpi;
  return {};
}

std::string read_format(std::string_view text, Job& job) {
  if (write::find_image_format(text) == nullptr) {
    std::vector<std::string_view> ids;
    for (const auto& format : write::image_formats()) ids.push_back(format.id);
    return not_one_of(text, ids);
  }
  job.format = text;
  return {};
}

std::string read_path(std::string_view text, std::string& path) {
  if (text.empty()) return "is empty; name a file or directory";
  if (text.find('\0') != std::string_view::npos) return "holds a zero byte; name a file or directory";
  path = text;
  return {};
}

// Factors of 0 flatten a part; of shrink, negative ones make no sense.
std::string read_factors(std::string_view text, double low, bool negative, std::array<double, 3>& factors) {
  std::array<double, 3> parsed{};
  if (auto wrong = read_triple(text, negative ? -kMostFactor : low, kMostFactor, "", true, parsed); !wrong.empty()) {
    return wrong;
  }
  for (const double factor : parsed) {
    if (std::abs(factor) < low) {
      return fmt::format("{} is out of range; give factors of at least {}", number_text(factor), low);
    }
  }
  factors = parsed;
  return {};
}

using Form = KeyForm;
using Text = std::string_view;

const JobKey kJobKeys[] = {
    {"bed", "size_mm", "--bed", "WIDTHxDEPTH", "size of the bed in mm; the image covers all of it", true,
     [](Text t, Job& j) { return read_pair(t, kLeastMm, kMostMm, " mm", j.bed_mm); },
     [](const Job& j) { return write_list(j.bed_mm); }, Form::kList},
    {"bed", "dpi", "--dpi", "DPI|XxY", "pixels per inch along x and y, each 1 to 25400", true, read_dpi,
     [](const Job& j) { return fmt::format("{},{}", j.dpi[0], j.dpi[1]); }, Form::kList},
    {"layers", "thickness_mm", "--layer", "MM", "thickness of a layer in mm", true,
     [](Text t, Job& j) { return read_number(t, kLeastMm, kMostMm, " mm", j.layer_mm); },
     [](const Job& j) { return number_text(j.layer_mm); }, Form::kBare},
    {"place", "gap_mm", "--gap", "MM", "between parts and copies that are arranged, in mm", true,
     [](Text t, Job& j) { return read_number(t, 0, kMostMm, " mm", j.gap_mm); },
     [](const Job& j) { return number_text(j.gap_mm); }, Form::kBare},
    {"image", "format", "--format", "FORMAT", "of the layer files", true, read_format,
     [](const Job& j) { return j.format; }, Form::kString},
    {"image", "fill", "--fill", "RULE",
     "what is solid where shells overlap: nonzero (any), positive (drops shells turned inside out), evenodd", true,
     [](Text t, Job& j) { return read_word(kFillRules, t, j.fill_rule); },
     [](const Job& j) { return write_word(kFillRules, j.fill_rule); }, Form::kString},
    {"image", "mirror", "--mirror", "x|y|xy|none", "turn the image over: x swaps left and right, y back and front", true,
     [](Text t, Job& j) { return read_word(kMirrors, t, j.mirror); },
     [](const Job& j) { return write_word(kMirrors, j.mirror); }, Form::kString},
    {"load", "repair", "--no-repair", "", "plan open meshes as they are instead of closing them", true,
     [](Text t, Job& j) { return read_switch(t, j.repair); },
     [](const Job& j) { return write_switch(j.repair); }, Form::kBare, "false"},
    {"load", "drop_bad", "--drop-bad", "", "drop facets with coordinates that are no numbers instead of refusing the file",
     true, [](Text t, Job& j) { return read_switch(t, j.drop_bad); },
     [](const Job& j) { return write_switch(j.drop_bad); }, Form::kBare, "true"},
    {"load", "weld_um", "--weld", "UM", "repair joins open edges that are at most this far apart, in micrometres", true,
     [](Text t, Job& j) { return read_number(t, 0, 1e6, " um", j.weld_um); },
     [](const Job& j) { return number_text(j.weld_um); }, Form::kBare},
    {"run", "output", "-o,--output", "DIR", "directory for the layers and the manifest", false,
     [](Text t, Job& j) { return read_path(t, j.output); }, [](const Job& j) { return j.output; }, Form::kString},
    {"run", "engine", "--engine", "ENGINE", "rays, contours, or both to compare them; all give the same bytes", false,
     [](Text t, Job& j) { return read_word(kEngines, t, j.engine); },
     [](const Job& j) { return write_word(kEngines, j.engine); }, Form::kString},
    {"run", "threads", "--threads", "N", "0 for all that the machine has", false,
     [](Text t, Job& j) {
       std::int64_t threads = 0;
       auto wrong = read_whole(t, 0, 4096, threads);
       if (wrong.empty()) j.threads = static_cast<std::uint32_t>(threads);
       return wrong;
     },
     [](const Job& j) { return fmt::format("{}", j.threads); }, Form::kBare},
    {"run", "memory", "--memory", "SIZE", "what the layers in flight may hold beside the mesh: 256M, 1G", false,
     [](Text t, Job& j) { return read_bytes(t, j.memory_bytes); },
     [](const Job& j) {
       for (const auto& [letter, shift] : {std::pair{"G", 30}, {"M", 20}, {"K", 10}}) {
         if (j.memory_bytes % (1ull << shift) == 0) return fmt::format("{}{}", j.memory_bytes >> shift, letter);
       }
       return fmt::format("{}", j.memory_bytes);
     },
     Form::kString},
    {"run", "layers", "--layers", "A:B", "only layers A to B - 1, counted from 0 at the bottom; A: and :B are open", false,
     [](Text t, Job& j) {
       std::array<std::uint32_t, 2> range{};
       auto wrong = read_layer_range(t, range);
       if (wrong.empty()) j.layers = range;
       return wrong;
     },
     [](const Job& j) {
       if (!j.layers) return std::string();
       const auto [first, last] = *j.layers;
       return last == UINT32_MAX ? fmt::format("{}:", first) : fmt::format("{}:{}", first, last);
     },
     Form::kString},
    {"run", "shard", "--shard", "I/N", "only the I-th of N equal shares of the layers, I from 1; see lamina merge", false,
     [](Text t, Job& j) {
       std::array<std::uint32_t, 2> shard{};
       auto wrong = read_shard(t, shard);
       if (wrong.empty()) j.shard = shard;
       return wrong;
     },
     [](const Job& j) {
       return j.shard ? fmt::format("{}/{}", (*j.shard)[0] + 1, (*j.shard)[1]) : std::string();
     },
     Form::kString},
};

const PartKey kPartKeys[] = {
    {"part", "path", "", "FILE", "STL, OBJ or 3MF file; in a job file, relative to that file", true,
     [](Text t, PartRequest& p) { return read_path(t, p.path); }, [](const PartRequest& p) { return p.path; },
     Form::kString},
    {"part", "unit", "--unit", "UNIT", "of STL and OBJ, which carry none: mm, cm, m, um, inch, foot", true,
     [](Text t, PartRequest& p) {
       int ignored = 0;
       auto wrong = read_word(kUnits, t, ignored);
       if (wrong.empty()) p.unit = t;
       return wrong;
     },
     [](const PartRequest& p) { return p.unit; }, Form::kString},
    {"part", "copies", "--copies", "N", "of each part, 1 to 1000000", true,
     [](Text t, PartRequest& p) {
       std::int64_t copies = 0;
       auto wrong = read_whole(t, 1, 1'000'000, copies);
       if (wrong.empty()) p.copies = static_cast<std::uint32_t>(copies);
       return wrong;
     },
     [](const PartRequest& p) { return fmt::format("{}", p.copies); }, Form::kBare},
    {"part", "at_mm", "--at", "X,Y", "where the part's box starts, in mm from the bed's front left; else arranged", true,
     [](Text t, PartRequest& p) {
       std::array<double, 2> at{};
       auto wrong = read_pair(t, 0, kMostMm, " mm", at);
       if (wrong.empty()) p.at_mm = at;
       return wrong;
     },
     [](const PartRequest& p) { return p.at_mm ? write_list(*p.at_mm) : std::string(); }, Form::kList},
    {"part", "bottom_mm", "--bottom", "MM", "height of the part's lowest point above the bed, in mm", true,
     [](Text t, PartRequest& p) { return read_number(t, 0, kMostMm, " mm", p.bottom_mm); },
     [](const PartRequest& p) { return number_text(p.bottom_mm); }, Form::kBare},
    {"part", "scale", "--scale", "S|X,Y,Z", "factors per axis of the file; a negative one mirrors", true,
     [](Text t, PartRequest& p) { return read_factors(t, 1e-6, true, p.scale); },
     [](const PartRequest& p) { return write_list(p.scale); }, Form::kList},
    {"part", "rotate_deg", "--rotate", "X,Y,Z", "degrees about x, then y, then z, after scaling", true,
     [](Text t, PartRequest& p) { return read_triple(t, -36000, 36000, " degrees", false, p.rotate_deg); },
     [](const PartRequest& p) { return write_list(p.rotate_deg); }, Form::kList},
    {"part", "shrink", "--shrink", "S|X,Y,Z", "factors per axis of the bed that make up for shrinkage, applied last", true,
     [](Text t, PartRequest& p) { return read_factors(t, 0.1, false, p.shrink); },
     [](const PartRequest& p) { return write_list(p.shrink); }, Form::kList},
};

}  // namespace

std::span<const JobKey> job_keys() { return kJobKeys; }
std::span<const PartKey> part_keys() { return kPartKeys; }

}  // namespace lamina::pipeline

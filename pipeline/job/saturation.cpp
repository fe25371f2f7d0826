// The list dose.saturation_range of a job.
#include <fmt/format.h>

#include <optional>

#include "pipeline/job/keys.h"
#include "stages/data/text/ranges.h"

namespace lamina::pipeline {
namespace {

/// A wish of which each part may be left out.
struct RangeWish {
  std::optional<double> percent, core;
};

constexpr Key<RangeWish> kRangeKeys[] = {
    field<&RangeWish::percent>({"saturation_range", "saturation_percent"}, kSaturationPercent),
    field<&RangeWish::core>({"saturation_range", "core_saturation_percent"}, kSaturationPercent),
};

}  // namespace

std::string read_saturation_ranges(const TomlValue& list, std::vector<SaturationRange>& ranges, Place& at) {
  if (auto wrong = check_tables(list, "from_mm, to_mm and saturation_percent"); !wrong.empty()) return wrong;
  std::vector<SaturationRange> read;
  for (TomlValue table : list.value) {
    SaturationRange& range = read.emplace_back();
    at = table.place;
    if (auto wrong = take_ends(table, range.from_mm, range.to_mm, at); !wrong.empty()) return wrong;
    RangeWish wish;
    if (auto wrong = read_table<RangeWish>(table, "saturation_range", kRangeKeys, wish, at); !wrong.empty()) return wrong;
    if (!wish.percent) return fmt::format("{}: saturation_percent is missing", range_name(range.from_mm, range.to_mm));
    range.percent = *wish.percent;
    range.core_percent = wish.core;
  }
  ranges = std::move(read);
  return {};
}

std::string saturation_ranges_text(const std::vector<SaturationRange>& ranges) {
  std::string text;
  for (const auto& [from, to, percent, core] : ranges) {
    text += fmt::format("{}{{ from_mm = {}, to_mm = {}, saturation_percent = {}", text.empty() ? "" : ", ", number_text(from),
                        number_text(to), number_text(percent));
    if (core) text += fmt::format(", core_saturation_percent = {}", number_text(*core));
    text += " }";
  }
  return text.empty() ? text : fmt::format("[{}]", text);
}

}  // namespace lamina::pipeline
